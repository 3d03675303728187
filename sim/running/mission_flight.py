"""A mission from take-off to its recording, both for a single run and for a trial of a study."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from planning.planner import Planner
from planning.planner_loading import PlannerError, find_planner_target, load_planner
from sim.facts.metrics.metric import Outcome
from sim.mission.mission import Mission
from sim.mission.recorder import Recorder
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.mission.trial import Trial, prefix_errors
from sim.scenario.scenario import encode_scenario

Watch = Callable[[Snapshot], bool]  # gets each scan, and returns False to end the mission


def fly_mission(
    trial: Trial,
    watching: Callable[[Mission], AbstractContextManager[Watch]],
    prepare: Callable[[], object] = lambda: None,
    planner: Planner | None = None,
) -> Outcome:
    """Fly a mission; it is marked as interrupted if it ends before its last scan.

    watching: a context around all scans; its value is called with each of them. prepare: called before the mission is
    built; its time counts as start-up. planner: object to use; by default it is loaded by the trial's text. InputError
    if the mission cannot be built.
    """
    start = time.perf_counter()
    prepare()
    mission = make_mission(trial, planner)
    recorder = Recorder(trial.repeat)
    with mission:
        start_up = time.perf_counter() - start
        with watching(mission) as watch:
            for snapshot in mission.fly():
                recorder.add(snapshot)
                if not watch(snapshot):
                    break
    wall = time.perf_counter() - start
    return Outcome(
        make_recording(mission, recorder, trial.planner),
        seconds={**mission.clock.seconds, "start_up": start_up},
        wall_s=wall,
        faults=mission.faults,
        planning_s=mission.clock.laps["planning"],
        planning_cpu_s=mission.clock.planning_cpu_s,
    )


def make_mission(trial: Trial, planner: Planner | None = None) -> Mission:
    """The mission of a trial at its first scan; InputError if it cannot be built. planner: as in `fly_mission`."""
    if planner is None:
        planner = load_planner(trial.planner)
    with prefix_errors(trial.place, PlannerError):
        return Mission(trial.scenario, planner, trial.seed, trial.repeat)


def make_recording(mission: Mission, recorder: Recorder, planner: str) -> Recording:
    """Recording of the scans flown so far; it is marked as interrupted unless these are all."""
    return recorder.recording(
        scenario=encode_scenario(mission.scenario),
        planner=planner,
        seed=mission.seed,
        forest=mission.forest,
        interrupted=len(recorder) < len(mission.scenario.scan_times),
        sees_truth=mission.sees_truth,
    )


def is_built_in(trial: Trial) -> bool:
    """True if planner and all parts of a trial are built in. InputError if no planner has that name."""
    parts = all(name in registry.built_in for registry, name in trial.scenario.plugins)
    return find_planner_target(trial.planner).startswith("planning.") and parts
