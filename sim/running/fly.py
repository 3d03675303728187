"""A mission from take-off to its recording: one loop over `fly`, whoever watches it."""

import math
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager

from planning.planner import Planner
from planning.planner_loading import PlannerError, find_planner_target, load_planner
from sim.facts.flight import Flight
from sim.facts.metrics.metric import Outcome
from sim.mission.mission import Mission
from sim.mission.recorder import Heading, Recorder
from sim.mission.snapshot import Snapshot
from sim.mission.trial import Trial, prefix_errors


class FlyingMission(AbstractContextManager["FlyingMission"]):
    """A mission that can be flown once, by iterating over it, and its outcome.

        flying = fly(trial)
        for snapshot in flying:
            ...
        outcome = flying.land()

    To leave the loop ends the mission. The context manager ends it also if an error comes before the loop.
    """

    def __init__(self, trial: Trial, planner: Planner, begun: float) -> None:
        """Build the mission at its first scan; begun: value of `time.perf_counter` when its start-up began."""
        self.trial = trial
        self._begun = begun
        self._recorder = Recorder(trial.repeat)
        with prefix_errors(trial.place, PlannerError):
            self.mission = Mission(trial.scenario, planner, trial.seed, trial.repeat)
        self.heading = _make_heading(self.mission, trial.planner)
        # In seconds, without the first scan, which counts with the others.
        self._start_up = time.perf_counter() - begun - math.fsum(self.mission.clock.seconds.values())

    def __iter__(self) -> Iterator[Snapshot]:
        for snapshot in self.mission.fly():
            self._recorder.add(snapshot)
            yield snapshot

    def land(self) -> Outcome:
        """End the mission; its outcome is marked as interrupted unless all scans were flown."""
        mission = self.mission
        mission.close()
        wall = time.perf_counter() - self._begun
        return Outcome(
            self.heading.make_recording(self._recorder),
            seconds={**mission.clock.seconds, "start_up": self._start_up},
            wall_s=wall,
            faults=mission.faults,
            planning_s=mission.clock.laps["planning"],
            planning_cpu_s=mission.clock.planning_cpu_s,
        )

    def __exit__(self, *error: object) -> None:
        self.mission.close()


def fly(trial: Trial, planner: Planner | None = None, *, begun: float | None = None) -> FlyingMission:
    """The mission of a trial, ready to be flown; InputError if it cannot be built.

    planner: by default it is loaded by the trial's text. begun: value of `time.perf_counter` when start-up began, by
    default now.
    """
    start = time.perf_counter() if begun is None else begun
    return FlyingMission(trial, load_planner(trial.planner) if planner is None else planner, start)


def fly_mission(trial: Trial, planner: Planner | None = None) -> Outcome:
    """Fly a mission to its end, with nobody watching; arguments and errors as those of `fly`."""
    flying = fly(trial, planner)
    for _ in flying:
        pass
    return flying.land()


def record(mission: Mission, snapshots: Iterable[Snapshot], planner: str = "from outside") -> Flight:
    """A mission flown by `Mission.step`, with tables and figures; marked as interrupted if it was not flown to the end.

    snapshots: all snapshots that its steps returned, in order. planner: a name to show for the planner.
    """
    recorder = Recorder(mission.repeat)
    for snapshot in snapshots:
        recorder.add(snapshot)
    return Flight(_make_heading(mission, planner).make_recording(recorder))


def is_built_in(trial: Trial) -> bool:
    """True if planner and all parts of a trial are built in. InputError if no planner has that name."""
    parts = all(name in registry.built_in for registry, name in trial.scenario.plugins)
    return find_planner_target(trial.planner).startswith("planning.") and parts


def _make_heading(mission: Mission, planner: str) -> Heading:
    return Heading(
        mission.scenario, planner, mission.seed, mission.repeat, mission.forest, sees_truth=mission.sees_truth
    )
