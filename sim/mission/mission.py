"""The mission loop: sense, track, communicate, plan, fly."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from planning.planner import Plan, Planner, Situation
from planning.planner_loading import give_truth, read_exchange, reset_planner
from sim.mission.fault import BREAKDOWN, Fault
from sim.mission.forest_beliefs import make_forest_beliefs
from sim.mission.knowledge import BodyState, Knowledge
from sim.mission.plan_check import ask_planner, check_plans, copy_situation
from sim.mission.radio import draw_links
from sim.mission.snapshot import FlownPlans, Snapshot
from sim.mission.stopwatch import Stopwatch
from sim.mission.tracker_setup import make_initial_tracks
from sim.mission.world_setup import Air, draw_starts, make_forest_and_people
from sim.scenario.quantities import parse_seed_and_repeat
from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from sim.sensing.navigation import make_navigation_errors
from sim.sensing.sensor_mode import Shot
from sim.sensing.sensors import Sensors
from sim.world.trajectories import Trajectories
from sim.world.world import World
from tracking.errors import InputError
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array


class Mission:
    """A mission, scan by scan. The seed decides forest and people; seed and repeat decide all other randomness.

    `fly` flies it with its planner. `step` flies it from scan to scan, with your own plans or with the planner's:

        mission = Mission(scenario, seed=3)
        while not mission.over:
            snapshot = mission.step([Plan(...) for situation in mission.team])
    """

    def __init__(self, scenario: Scenario, planner: Planner | None = None, seed: int = 0, repeat: int = 0) -> None:
        """Build the world, reset a stateful planner and take the first scan; ValueError if that is impossible."""
        seed, repeat = parse_seed_and_repeat(seed, repeat)
        self.seed = seed
        self.repeat = repeat
        self.scenario = scenario = draw_starts(scenario, seed)
        self.clock = Stopwatch()
        self.faults: list[Fault] = []
        self.images: list[NDArray[np.uint8] | None] = []  # of the present scan, one per UAV; None: not rendered
        self.present: Snapshot  # of the present scan before its decision, with ground truth; stays when it is over
        self.forest, self.people = make_forest_and_people(scenario, seed)
        self.beliefs = make_forest_beliefs(scenario, self.forest, seed)
        # An oracle gets access to the true positions here.
        self.planner, self.sees_truth = give_truth(planner, partial(_find_places, self.people))
        exchange = read_exchange(self.planner)
        chance = partial(stream, seed, repeat=repeat)
        self.rng = chance("planner")  # the planner's only source of chance, apart from the seed of its reset
        reset_planner(self.planner, int(chance("memory").integers(2**63)))
        starts = [self.people.at(time).positions for time in (0.0, 1 / scenario.rates.sensing)]
        self._knowledge = Knowledge(
            scenario, make_initial_tracks(scenario, *starts), exchange=exchange, rng=chance("intents")
        )
        self._rounds = exchange.rounds
        self._decisions: list[FlownPlans] = []  # whose plans are flown, or will be, in order of time
        self._flown: FlownPlans | None = None
        self._working = list(range(len(scenario.uavs)))  # UAVs that had not broken down at the present scan
        self.situations: list[Situation] = []  # of the working UAVs, if a decision is due; `team` has copies to change
        self._radio = chance("network")
        self._air = None if scenario.wind.is_calm else Air(scenario.wind, scenario.rates.physics, chance("wind"))
        self._errors = make_navigation_errors(scenario, chance)
        self._times = scenario.scan_times
        self._k = 0  # the present scan
        self._altitude_errors: Array | None = None  # m, by which control errs
        self._commands = np.zeros((len(scenario.uavs), 2))  # m/s, flown at present
        self._world = World(scenario, self.forest, self.people.positions.shape[1], seed, repeat=repeat)
        try:
            self._sensors = Sensors(scenario, self._world, self.forest, chance("sensors"))
            self._sense_and_track()
        except BaseException:
            self.close()
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
        return [copy_situation(situation) for situation in self.situations]

    def fly(self) -> Iterator[Snapshot]:
        """Fly the rest of the mission with its planner, and yield a snapshot per scan before flying on.

        The mission is closed at the end, and also if the iteration is given up before.
        """
        with self:
            while not self.over:
                yield self._decide(None)
                self._fly_on()

    def step(self, plans: Sequence[Plan | Array] | Array | None = None) -> Snapshot:
        """Decide at the present scan, and fly to the next one; return the snapshot of the scan of the decision.

        Args:
            plans: One plan or one velocity (2,) m/s, east and north, for each situation of `team`; like `team` empty
                between decisions. If not given, the planner plans. A velocity above the UAV's speed limit is shortened
                to the limit and recorded as a fault.

        Raises:
            InputError: If plans are missing or cannot be used; the mission is unchanged, and the step can be repeated.
            RuntimeError: If the mission is over.
        """
        if self.over:
            raise RuntimeError("the mission is over, or was closed")
        snapshot = self._decide(plans)
        self._fly_on()
        return snapshot

    def close(self) -> None:
        """End the mission and free its world."""
        self._k = len(self._times)
        self.situations = []
        self._world.close()

    def __enter__(self) -> "Mission":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _sense_and_track(self) -> None:
        """Take the present scan: sense, communicate and track, and find out what each UAV knows if it has to decide."""
        k = self._k
        time = self.time
        faults = self._break_down(time)
        people, headings = self.people.at(time)
        with self.clock.measure("physics"):
            self._world.place_people(people, headings)
        bodies = self._world.poses()
        cameras = [uav.camera_pose(body) for uav, body in zip(self.scenario.uavs, bodies, strict=True)]
        takes = [i in self._working and self.scenario.has_frame(i, k) for i in range(len(cameras))]
        stamped, believed = bodies, cameras
        if any(self._errors):
            stamped = self._stamp(bodies)
            turns = zip(self.scenario.uavs, cameras, stamped, self._errors, strict=True)
            believed = self._mislead([uav.camera_pose(stamp) if e else pose for uav, pose, stamp, e in turns])
            heights = [own.position[2] - true.position[2] for own, true in zip(believed, cameras, strict=True)]
            self._altitude_errors = np.array(heights)
        shots = [
            Shot(i, k, time, pose, people, believed[i] if self._errors[i] else None) for i, pose in enumerate(cameras)
        ]
        with self.clock.measure("rendering"):
            exposed = [self._sensors.expose(shot) for shot in shots if takes[shot.uav]]
        with self.clock.measure("detection"):
            frames = [shot.frame(self._sensors.cameras[shot.uav]) for shot in exposed if shot.rendered]
            faults += [
                Fault(time, i, f"mapper: {error}", error.trace) for i, error in self.beliefs.observe(time, frames)
            ]
            forests = [self.beliefs.believed(shot.uav) for shot in shots]
            taken = iter(self._sensors.read_all([replace(shot, forest=forests[shot.uav]) for shot in exposed]))
        readings = [
            next(taken) if takes[shot.uav] else self._sensors.rest(replace(shot, forest=forests[shot.uav]))
            for shot in shots
        ]
        for i, reading in enumerate(readings):
            faults += [Fault(time, i, f"detector: {error}", error.trace) for error in reading.errors]
        places = np.array([body.position for body in bodies])
        links = draw_links(self.scenario.network, time, places, self._radio)
        with self.clock.measure("tracking"):
            scans = {i: reading.scan for i, reading in enumerate(readings) if takes[i]}
            tracks, sent = self._knowledge.track(time, scans, links, self._working)
            map_bytes = self.beliefs.share(time, links, self._working, self._knowledge.trackers.relay)
        if self._working and self.scenario.decides(k):
            with self.clock.measure("tracking"):
                velocities = zip(self._world.velocities()[:, :2], self._errors, strict=True)
                known = [v + errors.velocity if errors else v for v, errors in velocities]
                states = list(map(BodyState, self._mislead(stamped), known))
                self.situations = self._knowledge.begin_decision(k, states, forests, links, self._working)
        else:
            self.situations = []
        self.faults += faults
        self.images = [reading.image for reading in readings]
        self.present = Snapshot(
            time=time,
            people=people,
            headings=headings,
            poses=bodies,
            cameras=cameras,
            believed=believed if any(self._errors) else None,
            working=self._working,
            frames_taken=np.array(takes),
            commands=self._commands,
            scans=[reading.scan for reading in readings],
            pixels=[reading.pixels for reading in readings],
            tracks=tracks,
            plans=None,
            visible=np.array([reading.visible for reading in readings]),
            matched=np.array([reading.matched for reading in readings]),
            contacts=self._world.take_contacts(),
            bytes_sent=sent,
            map_bytes=map_bytes,
            plan_bytes=np.zeros(len(bodies), dtype=np.int64),
            plan_rounds=0,
            faults=tuple(faults),
        )

    def _stamp(self, bodies: Sequence[Pose]) -> list[Pose]:
        """The poses of the bodies that the UAVs' clocks take for those of the present scan."""
        moving = zip(bodies, self._world.velocities(), self._world.spins(), self._errors, strict=True)
        return [e.stamp(self.time, body, v, spin) if e else body for body, v, spin, e in moving]

    def _mislead(self, poses: Sequence[Pose]) -> list[Pose]:
        """What each UAV believes of a pose of its body or its camera."""
        return [e.mislead(pose) if e else pose for pose, e in zip(poses, self._errors, strict=True)]

    def _break_down(self, time: float) -> list[Fault]:
        """Faults of the UAVs that have broken down since the previous scan; they work no longer."""
        failed = [i for i in self._working if not self.scenario.works(i, time)]
        self._working = [i for i in self._working if i not in failed]
        return [Fault(self.scenario.uavs[i].fails_at or 0.0, i, BREAKDOWN) for i in failed]

    def _decide(self, given: Sequence[Plan | Array] | Array | None) -> Snapshot:
        """Take the decision that is due at the present scan, if any, and return the scan's complete snapshot.

        A UAV that has broken down has an empty plan.
        """
        team = self.situations
        if not team:
            if given is not None:
                check_plans(given, team)  # an error unless empty
            self._command(None)
            return self.present.decide(flown=self._flown)
        with self.clock.planning():
            if given is not None:
                made, faults = check_plans(given, team)
            elif self.planner is not None:
                made, faults = ask_planner(self.planner, team, self._knowledge.teammates.own, self.rng)
            else:
                raise InputError(f"plans: none are given, and the mission has no planner; expected {len(team)} plans")
        plans = dict(zip(self._working, made, strict=True))
        sent = self._knowledge.teammates.send(plans)
        every = [plans.get(i, Plan(np.zeros((0, 2)))) for i in range(len(self.scenario.uavs))]
        self.faults += faults
        self._command(every)
        return self.present.decide(
            plans=every,
            flown=self._flown,
            plan_bytes=sent,
            plan_rounds=self._rounds,
            faults=(*self.present.faults, *faults),
        )

    def _command(self, plans: list[Plan] | None) -> None:
        """Command the first controls (n, 2) m/s of the plans due now; without any, keep the commands so far.

        Plans are due `network.plan_delay` after their decision. UAVs that have broken down hover.
        """
        if plans is not None:
            self._decisions.append(FlownPlans(self.time, plans))
        (n,) = self.scenario.find_flown([decision.made for decision in self._decisions], [self.time])
        due = None
        if n >= 0 and self._decisions[n] is not self._flown:
            self._flown = self._decisions[n]
            self._decisions = self._decisions[n:]
            due = self._flown.plans
        commands = np.zeros_like(self._commands)
        for i in self._working:
            commands[i] = self._commands[i] if due is None else due[i].controls[0]
        self._commands = commands

    def _fly_on(self) -> None:
        """Fly to the next scan and take it; close the mission after the last one, and if an error ends it."""
        self._k += 1
        if self.over:
            self.close()
            return
        rates = self.scenario.rates
        try:
            with self.clock.measure("physics"):
                steps = rates.physics // rates.sensing
                flown = self._commands.copy()
                for i, errors in enumerate(self._errors):
                    if errors:
                        flown[i] -= errors.velocity  # control follows the believed velocities
                winds = None if self._air is None else self._air.steps(steps)
                self._world.advance(flown, steps, winds, self._altitude_errors)
            for errors in filter(None, self._errors):
                errors.advance(1.0 / rates.sensing)
            self._sense_and_track()
        except BaseException:
            self.close()
            raise


def _find_places(people: Trajectories, time: float) -> Array:
    """True positions (M, 2) m of people at a time [s]; after the mission's end they stay as they are at the end."""
    return people.at(min(time, float(people.times[-1]))).positions
