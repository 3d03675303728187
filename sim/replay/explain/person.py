"""Facts about one person at one scan of a recording, and the person's visibility on the plans of UAVs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from planning.prediction.response import mean_velocities, response
from sim.evaluation.score import velocities
from sim.mission.tracker_setup import planned_motion
from sim.recording.recording import Recording
from sim.replay.explain.observation import Observer, PersonObservation
from sim.replay.flight import Flight
from sim.replay.recorded_fleet import known_forest, motion_at, vehicles_at
from sim.sensing.cameras import view_of
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import squared_distance

OUTSIDE, HIDDEN, IN_VIEW = 0, 1, 2  # states of a place in a camera
_SLACK = 1e-6  # s


@dataclass(frozen=True, eq=False)
class PlannedVisibility:
    """Visibility on the rest of one UAV's plan from a scan on, at S instants with the interval of scans."""

    made: float  # s, time of the plan's decision
    times: Array  # (S,) s
    path: Array  # (S, 2) m, path of the UAV
    person: Indices  # (S,), state of the true person: `OUTSIDE`, `HIDDEN`, `IN_VIEW`; -1 after the mission
    track: Indices | None  # (S,), state of the track as planners predict it; None without a track


def planned_visibility(
    recording: Recording, k: int, uav: int, person: int, belief: Gaussian | None
) -> PlannedVisibility | None:
    """Visibility of a person, and of a track with `belief`, on the plan of a UAV from scan k on.

    None if there is no plan or nothing of it is left.
    """
    scenario, now = recording.setting, float(recording.times[k])
    rate = scenario.rates.sensing
    plan = sum(scenario.due(time) <= now + _SLACK for time in recording.plan_times.tolist()) - 1
    if plan < 0 or not recording.working[k, uav]:
        return None
    at, corners, poses = _flight(recording, plan, uav)
    times = now + np.arange(1, int((at[-1] - now + _SLACK) * rate) + 1) / rate
    if len(times) == 0:
        return None
    path = np.column_stack([np.interp(times, at, corners[:, axis]) for axis in (0, 1)])
    views = [Pose(np.append(place, poses.position[2]), poses.quaternion) for place in path]
    known = recording.people[k + 1 : k + 1 + len(times), person]
    ahead = np.full(len(times), -1)
    ahead[: len(known)] = _states(recording, uav, views, known)
    track = None
    if belief is not None:
        scan = replace(planned_motion(scenario, motion_at(recording, k, uav)), dt=1 / rate, scans=1)
        nominal = scan.positions_ahead(belief.mean[None], belief.covariance[None], len(times))
        track = _states(recording, uav, views, nominal[:, 0])
    return PlannedVisibility(float(recording.plan_times[plan]), times, path, ahead, track)


def _flight(recording: Recording, plan: int, uav: int) -> tuple[Array, Array, Pose]:
    """Times (H + 1,) s and corners (H + 1, 2) m of a plan's path, and the camera's pose at its beginning.

    The path begins at the UAV's position when the plan was due. UAV and camera move as planners assume.
    """
    setting = recording.setting
    step, begun = 1 / setting.rates.planning, setting.due(float(recording.plan_times[plan]))
    controls = recording.plans[plan, uav]
    controls = controls[~np.isnan(controls[:, 0])]
    vehicle = vehicles_at(recording, int(np.argmin(np.abs(recording.times - begun))))[uav]
    flown = mean_velocities(response([vehicle], step), controls[None, None])[0, 0]
    corners = vehicle.position[:2] + np.vstack([np.zeros(2), step * np.cumsum(flown, axis=0)])
    camera = Pose(vehicle.position, vehicle.attitude)
    return begun + step * np.arange(len(corners), dtype=float), corners, camera


def _states(recording: Recording, uav: int, views: list[Pose], places: Array) -> Indices:
    """States (S,) of places (S, 2) m in the camera at S or more poses; `OUTSIDE` for NaN."""
    setting, trees = recording.setting, known_forest(recording)
    camera = view_of(setting.uavs[uav], setting)
    found = np.full(len(places), OUTSIDE)
    for s, (pose, place) in enumerate(zip(views, places, strict=False)):
        point = at_target_height(place[None])
        if np.isfinite(place).all() and camera.sees(pose, point)[0]:
            found[s] = IN_VIEW if trees.visible(pose.position, point)[0, 0] else HIDDEN
    return found


@dataclass(frozen=True, eq=False)
class HoldingTrack:
    """The present or last track that stands for a person, in the state that one UAV has after a scan."""

    number: int  # displayed number, by first appearance
    holds: tuple[int, ...]  # UAVs for which it stands for the person now
    others: tuple[tuple[int, tuple[int, ...]], ...]  # other tracks that stand for the person now, with their UAVs
    since: float  # s, time of its first scan
    belief: Gaussian | None  # None if the track has ended
    existence: float  # existence probability; NaN if it is not estimated
    until: float  # s, time of the last scan at which it stood for the person

    @property
    def axes(self) -> Array:
        """Standard deviations (2,) m of the position along its principal axes, the larger first."""
        assert self.belief is not None
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.belief.covariance[:2, :2])[::-1]))

    def error(self, place: Array) -> tuple[float, float]:
        """Distance [m] of the track's position from a place (2,) m, and the NEES of this error."""
        assert self.belief is not None
        off = self.belief.mean[:2] - place
        return float(np.hypot(*off)), float(squared_distance(off, self.belief.covariance[:2, :2]))


@dataclass(frozen=True, eq=False)
class PersonFacts:
    """Facts about one person at one scan, given n UAVs."""

    k: int
    person: int
    place: Array  # (2,) m, NaN if absent
    velocity: Array  # (2,) m/s, NaN if unknown
    holder: HoldingTrack | None  # None if no track has stood for the person yet
    observations: tuple[PersonObservation, ...]
    planned: tuple[PlannedVisibility | None, ...]
    flight: Flight
    note: str  # on facts about the tracker that the recording lacks; empty if there are none

    @staticmethod
    def of(observer: Observer, k: int, person: int) -> "PersonFacts":
        """The facts about a person at scan k."""
        recording, uavs = observer.recording, range(observer.recording.poses.shape[1])
        holder = _holder(observer.flight, k, person)
        belief = holder.belief if holder else None
        return PersonFacts(
            k=k,
            person=person,
            place=recording.people[k, person],
            velocity=velocities(recording)[k, person],
            holder=holder,
            observations=tuple(observer.observe(k, i, person) for i in uavs),
            planned=tuple(planned_visibility(recording, k, i, person, belief) for i in uavs),
            flight=observer.flight,
            note=observer.note,
        )


def _holder(flight: Flight, k: int, person: int) -> HoldingTrack | None:
    """The track by which most UAVs hold the person; if none does, the last track that held them."""
    recording, held = flight.recording, flight.history.tracks[: k + 1, :, person]
    scans = np.flatnonzero((held >= 0).any(axis=1))
    if len(scans) == 0:
        return None
    ids, counts = np.unique(held[scans[-1]][held[scans[-1]] >= 0], return_counts=True)
    id_ = int(ids[np.argmax(counts)])
    holds = np.flatnonzero(held[k] == id_).tolist()
    rest = sorted({t for t in held[k].tolist() if t >= 0} - {id_})
    numbers = recording.track_numbers
    first = int(np.searchsorted(recording.track_offsets, np.argmax(recording.track_ids == id_), side="right")) - 1
    found = track_at(recording, k, [*holds, *np.flatnonzero(recording.working[k]).tolist()], id_)
    return HoldingTrack(
        number=numbers[id_],
        holds=tuple(holds),
        others=tuple((numbers[t], tuple(np.flatnonzero(held[k] == t).tolist())) for t in rest),
        since=float(recording.times[first // recording.poses.shape[1]]),
        belief=found[1] if found else None,
        existence=found[2] if found else math.nan,
        until=float(recording.times[scans[-1]]),
    )


def track_at(recording: Recording, k: int, uavs: Iterable[int], id_: int) -> tuple[int, Gaussian, float] | None:
    """The first of the UAVs that has a track after scan k, its belief and existence (NaN if unknown)."""
    for i in uavs:
        for track, existence in zip(recording.tracks_at(k, i), recording.existence_at(k, i).tolist(), strict=True):
            if track.id == id_:
                return i, track.belief, existence
    return None
