"""The mission loop: sense, track, communicate, plan, fly."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.contract import exchange_of, is_stateful, reset, with_truth
from planning.planner import Plan, Planner, Situation
from sim.mission.knowledge import Knowledge
from sim.mission.plan_check import checked_plans, handed, usable_plans
from sim.mission.plan_exchange import Links, lost_messages, open_links
from sim.mission.snapshot import Snapshot, reported_positions
from sim.mission.tracker_setup import initial_tracks
from sim.mission.wind import Air
from sim.mission.world_setup import forest_and_people
from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_pose
from sim.sensing.fault import BREAKDOWN, Fault
from sim.sensing.sensors import Sensors
from sim.sensing.stopwatch import Stopwatch
from sim.world.trajectories import Trajectories
from sim.world.world import World
from tracking.errors import InputError
from tracking.metrics.ospa import ospa
from tracking.numerics.arrays import Array, Indices
from tracking.track import Track


class Mission:
    """A mission, scan by scan. The seed decides forest and people; seed and repeat decide all other randomness.

    `fly` flies it with its planner. `step` flies it from scan to scan, with your own plans or with the planner's:

        mission = Mission(scenario, seed=3)
        while not mission.over:
            snapshot = mission.step([Plan(...) for situation in mission.team])
    """

    def __init__(self, scenario: Scenario, planner: Planner | None = None, seed: int = 0, repeat: int = 0) -> None:
        """Grow the forest, compute the people's paths and build the world; ValueError if that is impossible."""
        self.scenario, self.seed, self.repeat = scenario, seed, repeat
        self.clock = Stopwatch()
        self.faults: list[Fault] = []
        self.frames: list[NDArray[np.uint8] | None] = []  # images of the last scan, one per UAV; None if not rendered
        self.forest, self.people = forest_and_people(scenario, seed)
        # An oracle gets access to the true positions here.
        self.planner, self.sees_truth = with_truth(planner, partial(_places, self.people))
        exchange = exchange_of(self.planner)
        chance = partial(stream, seed, repeat=repeat)
        self.rng = chance("planner")  # the planner's only source of chance, apart from the seed of its reset
        self._reset = is_stateful(self.planner)  # True while the reset before the first decision is due
        starts = [self.people.at(time)[0] for time in (0.0, 1 / scenario.rates.sensing)]
        self._knowledge = Knowledge(
            scenario, self.forest, initial_tracks(scenario, *starts), exchange=exchange, rng=chance("intents")
        )
        self._rounds = exchange.rounds
        self._delay = round(scenario.network.plan_delay * scenario.rates.sensing)  # scans
        self._coming: dict[int, list[Plan]] = {}  # plans not yet flown, by the scan at which they are due
        self._working = list(range(len(scenario.uavs)))  # UAVs that had not broken down at the last scan
        self._radio = chance("network")
        self._air = None if scenario.wind.calm else Air(scenario.wind, scenario.rates.physics, chance("wind"))
        self._times = scenario.scan_times
        self._k = 0  # the present scan
        self._commands = np.zeros((len(scenario.uavs), 2))  # m/s, flown at present
        self._sensed: _Sensed | None = None  # None until the present scan is sensed
        self._team: list[Situation] | None = None  # None until the present scan's situations are made
        self._world = World(scenario, self.forest, self.people.positions.shape[1], seed, repeat=repeat)
        try:
            self._sensors = Sensors(scenario, self._world, self.forest, rng=chance("sensors"), clock=self.clock)
        except BaseException:
            self._world.close()
            raise

    @property
    def over(self) -> bool:
        """True after the last scan and after `close`."""
        return self._k >= len(self._times)

    @property
    def time(self) -> float:
        """Time of the present scan [s]; time of the scenario's last scan if the mission is over or closed."""
        return self._times[min(self._k, len(self._times) - 1)]

    @property
    def team(self) -> list[Situation]:
        """Copies of the situations of the working UAVs, which have to decide now; empty between decisions."""
        return [] if self.over else [handed(situation) for situation in self._situations()]

    @property
    def present(self) -> Snapshot:
        """Snapshot of the present scan before its decision, with ground truth; RuntimeError if the mission is over."""
        self._check_not_over()
        return self._sense().snapshot

    def fly(self) -> Iterator[Snapshot]:
        """Fly the rest of the mission with its planner, and yield a snapshot per scan.

        The mission is closed at the end, and also if the iteration is given up before.
        """
        with self:
            while not self.over:
                yield self.step()

    def step(self, plans: Sequence[Plan | Array] | Array | None = None) -> Snapshot:
        """Decide at the present scan and go on to the next one; return the snapshot of the scan of the decision.

        Args:
            plans: One plan or one velocity (2,) m/s, east and north, for each situation of `team`; like `team` empty
                between decisions. If not given, the planner plans. A velocity above the UAV's speed limit is shortened
                to the limit and recorded as a fault.

        Raises:
            InputError: If plans are missing or cannot be used; the mission is unchanged, and the step can be repeated.
            RuntimeError: If the mission is over.
        """
        self._check_not_over()
        sensed = self._sense()
        made, sent = self._decide(plans)
        snapshot = replace(
            sensed.snapshot,
            plans=made,
            plan_bytes=sent,
            plan_rounds=0 if made is None else self._rounds,
            faults=tuple(self.faults[sensed.faults :]),
        )
        self._commands = self._next_commands(made)
        self._k, self._sensed, self._team = self._k + 1, None, None
        if self.over:
            self.close()
        return snapshot

    def close(self) -> None:
        """End the mission and free its world."""
        self._k = len(self._times)
        self._world.close()

    def __enter__(self) -> "Mission":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _check_not_over(self) -> None:
        if self.over:
            raise RuntimeError("the mission is over, or was closed")

    def _next_commands(self, plans: list[Plan] | None) -> Array:
        """Commands (n, 2) m/s from now on: the first controls of the plans due now, or the commands so far.

        Plans are due `network.plan_delay` after their decision. UAVs that have broken down hover.
        """
        if plans is not None:
            self._coming[self._k + self._delay] = plans
        due = self._coming.pop(self._k, None)
        commands = np.zeros_like(self._commands)
        for i in self._working:
            commands[i] = self._commands[i] if due is None else due[i].controls[0]
        return commands

    def _move(self) -> None:
        """Fly from the previous scan to the present one."""
        rates = self.scenario.rates
        with self.clock.measure("physics"):
            steps = rates.physics // rates.sensing
            winds = [None] * steps if self._air is None else list(self._air.steps(steps))
            self._world.advance(self._commands, winds)

    def _break_down(self, time: float) -> None:
        for i in self._working:
            if not self.scenario.works(i, time):
                self.faults.append(Fault(self.scenario.uavs[i].fails_at or 0.0, i, BREAKDOWN))
        self._working = [i for i in self._working if self.scenario.works(i, time)]

    def _sense(self) -> "_Sensed":
        """Fly to the present scan, sense and track, unless this has already been done."""
        if self._sensed is None:
            if self._k:
                self._move()
            self._sensed = self._scan(self._k, self.time)
        return self._sensed

    def _scan(self, k: int, time: float) -> "_Sensed":
        known = len(self.faults)
        self._break_down(time)
        people, headings = self.people.at(time)
        with self.clock.measure("physics"):
            self._world.place_people(people, headings)
        bodies = self._world.poses()
        cameras = [camera_pose(uav, body) for uav, body in zip(self.scenario.uavs, bodies, strict=True)]
        takes = [i in self._working and self.scenario.has_frame(i, k) for i in range(len(cameras))]
        looks = [
            (self._sensors.look if takes[i] else self._sensors.rest)(i, time, pose, people)
            for i, pose in enumerate(cameras)
        ]
        network, places = self.scenario.network, np.array([body.position for body in bodies])
        links = Links(open_links(network, time, places), lost_messages(network, len(bodies), self._radio))
        self.frames = [look.image for look in looks]
        self.faults += [fault for look in looks for fault in look.faults]
        with self.clock.measure("tracking"):
            tracks, sent = self._knowledge.track(time, looks, links, self._working)
        snapshot = Snapshot(
            time=time,
            people=people,
            headings=headings,
            poses=bodies,
            cameras=cameras,
            commands=self._commands,
            scans=[look.scan for look in looks],
            pixels=[look.pixels for look in looks],
            tracks=tracks,
            plans=None,
            ospa=self._errors(tracks, people[~np.isnan(people[:, 0])]),
            visible=np.array([look.visible for look in looks]),
            matched=np.array([look.matched for look in looks]),
            contacts=self._world.take_contacts(),
            bytes_sent=sent,
            plan_bytes=np.zeros(len(bodies), dtype=np.int64),
            plan_rounds=0,
        )
        return _Sensed(snapshot, links, known)

    def _errors(self, tracks: list[tuple[Track, ...]], present: Array) -> Array:
        """OSPA and its parts (n, 3) m of each UAV's reported tracks, given people (P, 2) m; NaN after a breakdown."""
        errors = np.full((len(tracks), 3), np.nan)
        for i in self._working:
            errors[i] = ospa(reported_positions(tracks[i]), present)
        return errors

    def _decide(self, given: Sequence[Plan | Array] | Array | None) -> tuple[list[Plan] | None, Indices]:
        """Plans of a decision and the bytes (n,) that each UAV sends; a UAV that has broken down has an empty plan.

        The plans are None if no decision is due at this scan, and if all UAVs have broken down.
        """
        count = len(self.scenario.uavs)
        if not self._decides():
            if given is not None:
                usable_plans(given, [])  # an error unless empty
            return None, np.zeros(count, dtype=np.int64)
        with self.clock.planning():
            team = self._situations()
            if given is not None:
                made, faults = usable_plans(given, team)
            elif self.planner is not None:
                made, faults = checked_plans(self.planner, team, self._knowledge.plans.own, self.rng)
            else:
                raise InputError(f"plans: none are given, and the mission has no planner; expected {len(team)} plans")
        self.faults += faults
        plans = dict(zip(self._working, made, strict=True))
        return [plans.get(i, Plan(np.zeros((0, 2)))) for i in range(count)], self._knowledge.plans.end(plans)

    def _decides(self) -> bool:
        self._sense()
        return bool(self._working) and self.scenario.decides(self._k)

    def _situations(self) -> list[Situation]:
        """One situation per working UAV if a decision is due at this scan; otherwise none."""
        if self._team is None:
            sensed, due = self._sense(), self._decides()
            if due and self._reset:  # here, because the caller may ask the planner; first, because a reset may fail
                reset(self.planner, int(stream(self.seed, "memory", repeat=self.repeat).integers(2**63)))
                self._reset = False
            bodies = list(zip(sensed.snapshot.poses, self._world.velocities()[:, :2], strict=True))
            self._team = self._knowledge.situations(self._k, bodies, sensed.links, self._working) if due else []
        return self._team


def _places(people: Trajectories, time: float) -> Array:
    """True positions (M, 2) m of people at a time [s]; after the mission's end they stay as they are at the end."""
    return people.at(min(time, float(people.times[-1])))[0]


class _Sensed(NamedTuple):
    """A scan before its decision."""

    snapshot: Snapshot
    links: Links
    faults: int  # number of faults before this scan
