"""The mission loop: sense, track, communicate, plan, fly."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from planning.contract import exchange_of, with_truth
from planning.loading import load_planner, planner_errors
from planning.planner import Plan, Planner, Situation
from sim.mission.plan_check import checked_plans
from sim.mission.plan_exchange import Links, PlanExchange, lost_messages, open_links
from sim.mission.snapshot import Snapshot
from sim.mission.tracker_setup import initial_tracks, planned_motion, tracker_parameters
from sim.mission.trial import Trial
from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_pose, vehicle_of
from sim.sensing.fault import Fault
from sim.sensing.sensors import Observation, Sensors
from sim.sensing.stopwatch import Stopwatch
from sim.world.forest import grow
from sim.world.trajectories import Trajectories, read
from sim.world.walkers import walk
from sim.world.wind import Air
from sim.world.world import World
from tracking.fusion.consensus import fuse
from tracking.fusion.member import tracker
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest
from tracking.metrics.ospa import ospa
from tracking.numerics.arrays import Array, Indices
from tracking.track import Track
from tracking.undetected import UndetectedIntensity


class Mission:
    """A mission that is ready to fly. The seed gives forest and people, seed and repeat all other chance."""

    def __init__(self, scenario: Scenario, planner: Planner, seed: int, repeat: int = 0) -> None:
        """Grow the forest, let the people walk and build the world; ValueError where the scenario cannot be built."""
        self.scenario = scenario
        self.clock = Stopwatch()
        self.faults: list[Fault] = []
        self.frames: list[NDArray[np.uint8] | None] = []  # of the last scan, one per UAV; None without rendering
        self.forest, self.people = forest_and_people(scenario, seed)
        # An oracle is given the truth here, since situations hold none.
        self._planner, self.sees_truth = with_truth(planner, lambda time: self.people.at(time)[0])
        chance = partial(stream, seed, repeat=repeat)
        self._chance = chance("planner")
        self._world = World(scenario, self.forest, self.people.positions.shape[1], seed, repeat=repeat)
        self._sensors = Sensors(scenario, self._world, self.forest, rng=chance("sensors"), clock=self.clock)
        # Planners get their own copies of map and motion model, so that changes have no effect on sensing.
        self._known_forest = Forest(tuple(map(replace, self.forest.trees)), self.forest.occlusion)
        self._known_motion = planned_motion(scenario)
        first, second = (self.people.at(time)[0] for time in (0.0, 1 / scenario.rates.sensing))
        name, cameras = scenario.tracking.tracker, self._sensors.cameras
        self._trackers = [  # each with parameters and tracks of its own, as one from outside may change them
            tracker(name, i, c, self.forest, tracker_parameters(scenario), initial_tracks(scenario, first, second))
            for i, c in enumerate(cameras)
        ]
        size, settings = (scenario.area.width, scenario.area.height), scenario.tracking
        people = settings.unseen if settings.initial_tracks == "none" else 0.0
        self._undetected = [
            UndetectedIntensity(size, people, settings.detection_probability, settings.max_speed) for _ in cameras
        ]
        with planner_errors(type(planner).__qualname__, "say what it sends"):
            exchange = exchange_of(self._planner)
        self._rounds, self._intents = exchange.rounds, PlanExchange(scenario.network, exchange, chance("intents"))
        self._first = round(scenario.first_decision * scenario.rates.sensing)  # scan
        self._delay = round(scenario.network.plan_delay * scenario.rates.sensing)  # scans
        self._coming: deque[tuple[int, list[Plan]]] = deque()  # plans that are not flown yet, by scan
        self._working = list(range(len(scenario.uavs)))  # UAVs that have not broken down, at the last scan
        self._radio = chance("network")
        self._air = None if scenario.wind.calm else Air(scenario.wind, scenario.rates.physics, chance("wind"))

    @staticmethod
    def of(trial: Trial) -> "Mission":
        """The mission of a trial, its planner loaded."""
        return Mission(trial.scenario, load_planner(trial.planner), trial.seed, trial.repeat)

    def fly(self) -> Iterator[Snapshot]:
        """The whole mission, one snapshot per scan. Ends early, cleanly, when no further scan is asked for."""
        rates = self.scenario.rates
        times = self.scenario.scan_times
        commands = np.zeros((len(self._trackers), 2))
        with self._world:
            for k, time in enumerate(times):
                known = len(self.faults)
                snapshot = replace(self._scan(k, time, commands), faults=tuple(self.faults[known:]))
                commands = self._commands(k, commands, snapshot.plans)
                yield snapshot
                if k + 1 < len(times):
                    with self.clock.measure("physics"):
                        steps = rates.physics // rates.sensing
                        for wind in [None] * steps if self._air is None else self._air.steps(steps):
                            self._world.step(commands, wind)

    def _commands(self, k: int, before: Array, plans: list[Plan] | None) -> Array:
        """Commands (n, 2) m/s from now on: the first of the plans due now, else as before.

        Plans are due `network.plan_delay` after their decision. UAVs that broke down hover.
        """
        if plans is not None:
            self._coming.append((k + self._delay, plans))
        due = self._coming.popleft()[1] if self._coming and self._coming[0][0] == k else None
        commands = np.zeros_like(before)
        for i in self._working:
            commands[i] = before[i] if due is None else due[i].controls[0]
        return commands

    def _break_down(self, time: float) -> None:
        for i in self._working:
            if not self.scenario.works(i, time):
                self.faults.append(Fault(self.scenario.uavs[i].fails_at or 0.0, i, "broke down, hovers from now on"))
        self._working = [i for i in self._working if self.scenario.works(i, time)]

    def _scan(self, k: int, time: float, commands: Array) -> Snapshot:
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
        self.frames = [look.image for look in looks]
        self.faults += [fault for look in looks for fault in look.faults]
        network = self.scenario.network
        up = open_links(network, time, np.array([body.position for body in bodies]))
        links = Links(up, lost_messages(network, len(bodies), self._radio))
        with self.clock.measure("tracking"):
            sent = self._track(time, looks, links)
        tracks = [tracker.tracks if i in self._working else () for i, tracker in enumerate(self._trackers)]
        present = people[~np.isnan(people[:, 0])]
        plans, sent_plans = self._plan(k, time, bodies, links)
        return Snapshot(
            time=time,
            people=people,
            headings=headings,
            poses=bodies,
            cameras=cameras,
            commands=commands,
            scans=[look.scan for look in looks],
            pixels=[look.pixels for look in looks],
            tracks=tracks,
            plans=plans,
            ospa=self._errors(tracks, present),
            visible=np.array([look.visible for look in looks]),
            matched=np.array([look.matched for look in looks]),
            contacts=self._world.take_contacts(),
            bytes_sent=sent,
            plan_bytes=sent_plans,
            plan_rounds=0 if plans is None else self._rounds,
        )

    def _errors(self, tracks: list[tuple[Track, ...]], present: Array) -> Array:
        """OSPA and its parts (n, 3) m of each UAV's tracks against people (P, 2) m; NaN for UAVs that broke down."""
        errors = np.full((len(tracks), 3), np.nan)
        for i in self._working:
            errors[i] = ospa(np.array([t.belief.mean[:2] for t in tracks[i]]), present)
        return errors

    def _track(self, time: float, looks: list[Observation], links: Links) -> Indices:
        """Update each tracker with its observation, fuse, and count the bytes that each UAV sends (n,)."""
        working, lost = self._working, links.lost
        for i in working:
            if looks[i].taken:
                self._trackers[i].step(looks[i].scan)
            else:
                self._trackers[i].coast(time)
        if lost is not None:
            lost = lost[:, working][:, :, working]
        sent = np.zeros(len(looks), dtype=np.int64)
        if working:
            members = [self._trackers[i] for i in working]
            sent[working] = fuse(members, links.up[np.ix_(working, working)], self.scenario.network.rounds, lost)
        return sent

    def _plan(self, k: int, time: float, bodies: list[Pose], links: Links) -> tuple[list[Plan] | None, Indices]:
        """Plans of a decision and the bytes (n,) that each UAV sends; a UAV that broke down has an empty plan.

        None between decisions, before the first, and if all UAVs have broken down.
        """
        rates = self.scenario.rates
        if k % (rates.sensing // rates.planning) or k < self._first or not self._working:
            return None, np.zeros(len(bodies), dtype=np.int64)
        with self.clock.measure("planning"):
            team = self._team(k, time, bodies, links)
            made, faults = checked_plans(self._planner, team, self._intents.own, self._chance)
        self.faults += faults
        plans = dict(zip(self._working, made, strict=True))
        return [plans.get(i, Plan(np.zeros((0, 2)))) for i in range(len(bodies))], self._intents.end(plans)

    def _team(self, k: int, time: float, bodies: list[Pose], links: Links) -> list[Situation]:
        """One situation per working UAV: itself, its own tracks, and its knowledge of the others."""
        fleet = [vehicle_of(i, body, self.scenario) for i, body in enumerate(bodies)]
        self._intents.begin(fleet, links, self._working, 1 / self.scenario.rates.planning)
        area = (self.scenario.area.width, self.scenario.area.height)
        for i in self._working:
            known = [v for v in fleet if v.id == i or (links.contact[i, v.id] and v.id in self._working)]
            looks = [
                (self._sensors.cameras[v.id], Pose(v.position, v.attitude))
                for v in known
                if self.scenario.has_frame(v.id, k)
            ]
            self._undetected[i].step(time, looks, self._trackers[i].tracks, self.forest)
        return [
            self._intents.informed(
                Situation(
                    time=time,
                    own=fleet[i],
                    neighbours=(),
                    tracks=self._trackers[i].tracks,
                    forest=self._known_forest,
                    area=area,
                    motion=self._known_motion,
                    unseen=self._undetected[i].belief,
                )
            )
            for i in self._working
        ]


def forest_and_people(scenario: Scenario, seed: int) -> tuple[Forest, Trajectories]:
    """The trees of a scenario and seed, and its people, walking or from the scenario's file.

    Walkers go round trunks; recorded people do not, so trunks keep off their paths. People are present for two scans at
    least, which a velocity needs.
    """
    people, duration = scenario.people, max(scenario.duration, 1 / scenario.rates.sensing)
    file = people.trajectory_file
    recorded = None if file is None else read(file, scenario.area, duration=duration)
    paths = np.zeros((0, 2)) if recorded is None else recorded.positions[~np.isnan(recorded.positions[..., 0])]
    grown = grow(scenario.trees, scenario.area, stream(seed, "forest"), paths)
    forest = Forest(grown.trees, scenario.sensing.occlusion)
    if recorded is not None:
        return forest, recorded
    return forest, walk(people, scenario.area, forest, duration=duration, rng=stream(seed, "walkers"))
