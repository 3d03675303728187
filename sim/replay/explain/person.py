"""Facts about one person at one scan of a recording, and the person's visibility on the plans of UAVs."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.prediction.response import mean_velocities, response
from sim.evaluation.score import velocities
from sim.mission.tracker_setup import planned_motion
from sim.recording.recording import Recording
from sim.replay.explain.observation import Observer, PersonObservation
from sim.replay.flight import Flight
from sim.replay.recorded_fleet import known_forest, vehicles_at
from sim.replay.tracking_replay import replay_tracking
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
        scan = replace(planned_motion(scenario, replay_tracking(recording).motion(k, uav)), dt=1 / rate, scans=1)
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
    """A track that stands for a person, or was the last to do so, in the state that one UAV has after a scan."""

    number: int  # displayed number, by first appearance
    holds: tuple[int, ...]  # UAVs for which it stands for the person now
    elsewhere: dict[int, int]  # other people for whom it stands now, by UAV
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
    # The tracks that stand for the person, that of most UAVs first. If none does, the last that did, if there is one.
    holders: tuple[HoldingTrack, ...]
    observations: tuple[PersonObservation, ...]
    planned: tuple[PlannedVisibility | None, ...]
    flight: Flight
    note: str  # on facts about the tracker that are unknown; empty if there are none

    @staticmethod
    def of(observer: Observer, k: int, person: int) -> "PersonFacts":
        """The facts about a person at scan k."""
        recording, uavs = observer.recording, range(observer.recording.poses.shape[1])
        holders = _holders(observer.flight, k, person)
        beliefs = [_belief(recording, k, i, _track_of(holders, i)) for i in uavs]
        return PersonFacts(
            k=k,
            person=person,
            place=recording.people[k, person],
            velocity=velocities(recording)[k, person],
            holders=holders,
            observations=tuple(observer.observe(k, i, person) for i in uavs),
            planned=tuple(planned_visibility(recording, k, i, person, beliefs[i]) for i in uavs),
            flight=observer.flight,
            note=observer.replay.note,
        )

    def track_of(self, uav: int) -> HoldingTrack | None:
        """The track by which a UAV holds the person or, if it has none, the first of `holders`.

        None if that one stands for another person on this UAV, as ids differ between UAVs that do not hear each other.
        """
        return _track_of(self.holders, uav)


def _track_of(holders: Sequence[HoldingTrack], uav: int) -> HoldingTrack | None:
    own = next((holder for holder in holders if uav in holder.holds), holders[0] if holders else None)
    return None if own is None or uav in own.elsewhere else own


def _belief(recording: Recording, k: int, uav: int, holder: HoldingTrack | None) -> Gaussian | None:
    """The belief of a track that a UAV has after scan k; that of another UAV if it does not have the track."""
    if holder is None:
        return None
    found = track_at(recording, k, [uav], list(recording.track_numbers)[holder.number])
    return found[1] if found else holder.belief


def _holders(flight: Flight, k: int, person: int) -> tuple[HoldingTrack, ...]:
    """The tracks by which UAVs hold the person, that of most UAVs first; if none does, the last that held them."""
    held = flight.history.tracks[: k + 1, :, person]
    scans = np.flatnonzero((held >= 0).any(axis=1))
    if len(scans) == 0:
        return ()
    last = int(scans[-1])
    ids, counts = np.unique(held[last][held[last] >= 0], return_counts=True)
    ids = ids[np.argsort(-counts, kind="stable")]
    return tuple(_holder(flight, k, person, int(id_), last) for id_ in (ids if last == k else ids[:1]))


def _holder(flight: Flight, k: int, person: int, id_: int, last: int) -> HoldingTrack:
    """Facts at scan k about the track that stood for the person at scan `last`."""
    recording, standing = flight.recording, flight.history.tracks[k] == id_
    holds = np.flatnonzero(standing[:, person]).tolist()
    first = int(np.searchsorted(recording.track_offsets, np.argmax(recording.track_ids == id_), side="right")) - 1
    found = track_at(recording, k, [*holds, *np.flatnonzero(recording.working[k]).tolist()], id_)
    return HoldingTrack(
        number=recording.track_numbers[id_],
        holds=tuple(holds),
        elsewhere={uav: other for uav, other in np.argwhere(standing).tolist() if other != person},
        since=float(recording.times[first // recording.poses.shape[1]]),
        belief=found[1] if found else None,
        existence=found[2] if found else math.nan,
        until=float(recording.times[last]),
    )


def track_at(recording: Recording, k: int, uavs: Iterable[int], id_: int) -> tuple[int, Gaussian, float] | None:
    """The first of the UAVs that has a track after scan k, its belief and existence (NaN if unknown)."""
    for i in uavs:
        for track, existence in zip(recording.tracks_at(k, i), recording.existence_at(k, i).tolist(), strict=True):
            if track.id == id_:
                return i, track.belief, existence
    return None
