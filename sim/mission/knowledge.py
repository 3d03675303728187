"""Knowledge of each UAV: its tracks, its intensity of undetected people, and what it knows about its teammates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planning.planner import Exchange, Situation, Vehicle
from sim.mission.radio import RadioLinks
from sim.mission.teammates import make_teammates
from sim.mission.tracker_fleet import TrackerFleet
from sim.mission.tracker_setup import make_planned_motion
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.world.quadrotor import COMMAND_LAG
from tracking.geometry.camera import Look, Pose
from tracking.geometry.quaternions import level_attitude, pitch
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.trigonometry import arctan2
from tracking.track import Scan, Track
from tracking.undetected import UndetectedIntensity


class BodyState(NamedTuple):
    """Motion of a UAV's body at one scan."""

    pose: Pose
    velocity: Array  # (2,) m/s, east and north


def vehicle_of(scenario: Scenario, i: int, body: BodyState) -> Vehicle:
    """UAV i as planners know it; all parts are copies.

    Note: planners assume the attitude of the camera in level flight at the present heading. For a body-fixed camera
    without mounting angle the heading is ignored and taken as east, with north up.
    """
    return _move_vehicle(_make_vehicle(scenario, i), scenario.uavs[i], body)


def _make_vehicle(scenario: Scenario, i: int) -> Vehicle:
    """UAV i, wherever it is."""
    lag = COMMAND_LAG if scenario.dynamics == "quadrotor" else 0.0
    camera, noise = scenario.believed_camera(i), scenario.noise_model(i)
    return Vehicle(i, np.zeros(3), camera, noise, scenario.uavs[i].max_speed, lag=lag)


def _move_vehicle(vehicle: Vehicle, uav: Uav, body: BodyState) -> Vehicle:
    """The vehicle of a UAV where its body is."""
    heading = 0.0
    if uav.mount == "body" and uav.tilt_deg:
        rotation = body.pose.rotation
        heading = arctan2(rotation[1, 0], rotation[0, 0])
    attitude = pitch(np.array(level_attitude(heading)), math.radians(uav.tilt_deg))
    position, velocity = body.pose.position.copy(), np.array(body.velocity)
    return replace(vehicle, position=position, attitude=attitude, velocity=velocity)


class Knowledge:
    """Knowledge of each UAV of a fleet. The initial tracks are the only ground truth in it."""

    def __init__(
        self,
        scenario: Scenario,
        forest: Forest,
        initial: Sequence[Track],
        *,
        exchange: Exchange,
        rng: np.random.Generator,
    ) -> None:
        """Set up trackers; `exchange` says how plans are sent, and `rng` decides which of them are lost.

        forest: the map of trees that UAVs believe.
        """
        self._scenario = scenario
        self._forest = forest
        # Planners get their own copy of the map, so that a planner that changes it does not change sensing.
        self._known_forest = replace(forest, trees=tuple(map(replace, forest.trees)))
        self._vehicles = [_make_vehicle(scenario, i) for i in range(len(scenario.uavs))]
        self._cameras = [vehicle.camera for vehicle in self._vehicles]
        self.trackers = TrackerFleet(scenario, forest, initial)
        self._area = (scenario.area.width, scenario.area.height)
        settings = scenario.believed_tracking
        people = settings.undetected if settings.initial_tracks == "none" else 0.0
        self._undetected = [
            UndetectedIntensity(self._area, people, settings.detection_probability, settings.max_speed)
            for _ in self._cameras
        ]
        self.teammates = make_teammates(scenario.network, exchange, rng, self.trackers.relay)
        self._scans: Mapping[int, Scan] = {}  # of the last instant, by UAV
        # Views of frames at decisions, received later, that the intensity of undetected people does not yet contain.
        self._late_views: list[list[Look]] = [[] for _ in self._cameras]

    def track(
        self, time: float, scans: Mapping[int, Scan], links: RadioLinks, working: Sequence[int]
    ) -> tuple[list[tuple[Track, ...]], Indices]:
        """Update and fuse the tracks of the working UAVs; return the tracks and the bytes (n,) that each UAV sends.

        scans: by UAV, of those that took a frame.
        """
        self._scans = scans
        sent = self.trackers.step(time, scans, links, working)
        for views, received in zip(self._late_views, self.trackers.relay.received, strict=True):
            for item in received:
                if isinstance(item.content, Scan) and self._scenario.decides(item.k):
                    views.append(Look(self._cameras[item.uav], item.content.pose))
        return [self.trackers[i].tracks if i in working else () for i in range(len(self._cameras))], sent

    def begin_decision(
        self, k: int, bodies: Sequence[BodyState], links: RadioLinks, working: Sequence[int]
    ) -> list[Situation]:
        """Go on to the decision of scan k; return the situation of each working UAV.

        bodies: the state of each UAV, as it believes it to be.
        """
        time = k / self._scenario.rates.sensing
        fleet = list(map(_move_vehicle, self._vehicles, self._scenario.uavs, bodies))
        self.teammates.update(time, fleet, links, working, self._scenario.rates.plan_step)
        takes_time = self._scenario.network.takes_time
        heard = {i: links.find_heard(i, takes_time=takes_time) for i in working}
        looks = {j: Look(self._cameras[j], scan.pose) for j, scan in self._scans.items()}
        # The search map takes cameras to hang as planned, although fixed ones lean and poses err.
        level = {j: Look(self._cameras[j], Pose(fleet[j].position, fleet[j].attitude)) for j in looks}
        for i in working:
            known = [look for j, look in level.items() if heard[i][j]] + self._late_views[i]
            self._late_views[i] = []
            self._undetected[i].step(time, known, self.trackers[i].tracks, self._forest)
        return [
            Situation(
                time=time,
                own=fleet[i],
                tracks=self.trackers[i].tracks,
                forest=self._known_forest,
                area=self._area,
                motion=make_planned_motion(self._scenario, getattr(self.trackers[i], "motion", None)),
                undetected=self._undetected[i].belief,
                looks=tuple(look for j, look in looks.items() if heard[i][j]),
                radio_range=self._scenario.network.range,
                **self.teammates.tell(i),
            )
            for i in working
        ]
