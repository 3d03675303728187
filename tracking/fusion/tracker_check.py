"""Conformance of a tracker to `tracking.fusion.member.Member`, checked on scripted scans of two UAVs."""

import math
from collections.abc import Callable
from copy import deepcopy
from statistics import mean
from time import perf_counter

import numpy as np

from tracking.errors import InputError, spell
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.checked_tracker import CheckedTracker
from tracking.fusion.consensus import fuse
from tracking.fusion.member import TRACKERS
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length, squared_distance
from tracking.parameters import TrackerParameters
from tracking.plugins.findings import (
    Finding,
    Untried,
    check_nees,
    describe_time,
    find_change,
    judge_plugin,
    require,
    try_checks,
)
from tracking.track import Scan, Track, beliefs_of

_SCANS, _STEP = 25, 0.2  # and s between them
_HERE, _AWAY = Pose.level(0.0, 0.0, 25.0), Pose.level(80.0, 0.0, 25.0)
_KNOWN = np.array([(-6.0, 2.0, 0.8, 0.3), (5.0, 4.0, -0.6, 0.6), (3.0, -6.0, 0.0, 0.9)])  # people known at the start
_PEOPLE = np.concatenate([_KNOWN, [(-2.0, -7.0, 0.3, 0.6)]])  # the last is unknown at the start
_CLUTTER = np.array([[10.0, 10.0]])
_TURN = 0.45  # rad/s, left turn of all people, so that a track that walks straight or stands loses them in the end
_FAR = 3.0  # m, distance from all people beyond which a track is false
_SAME = 1e-3  # SI units, largest difference between means and between covariances on which UAVs agree


def check_tracker(tracker: str) -> list[Finding]:
    """Findings of all checks of a tracker, which conforms if none has `passed` False.

    tracker: a name or an import string. InputError if there is no such tracker, or it cannot be made.
    """
    return try_checks(_Flight(tracker), _CHECKS)


def _positions(k: int) -> Array:
    """Positions (4, 2) m of the people at a scan."""
    velocities, angle = _PEOPLE[:, 2:], _TURN * _STEP * k
    aside = velocities[:, ::-1] * (-1.0, 1.0)
    return _PEOPLE[:, :2] + (math.sin(angle) * velocities + (1.0 - math.cos(angle)) * aside) / _TURN


def _scan(k: int, uav: int) -> Scan | None:
    """The script: scan k of a UAV; UAV 0 looks elsewhere for a while. None if the camera takes no frame."""
    if (uav == 1 and k % 2) or (uav == 0 and k == 15):
        return None
    away = uav == 0 and 10 <= k < 13
    missed = [0] if k == 7 else []  # in view, but not detected
    rng = np.random.default_rng([k, uav])
    seen = np.delete(_positions(k), missed, axis=0) + rng.normal(scale=0.2, size=(4 - len(missed), 2))
    alarms = _CLUTTER if k == 9 else _CLUTTER[:0]
    z = np.concatenate([seen, alarms])[: 0 if away else None]
    return Scan(uav, _STEP * k, _AWAY if away else _HERE, z, np.tile(0.05 * np.eye(2), (len(z), 1, 1)))


class _Watched(CheckedTracker):
    """A tracker whose calls are timed, and whose arguments are compared before and after each call."""

    def __init__(self, name: str, uav: int, states: Array) -> None:
        parameters = TrackerParameters(NearlyConstantVelocity(_STEP, 0.5))
        initial = [Track(i, Gaussian(state, 0.25 * np.eye(4))) for i, state in enumerate(states.copy())]
        given = (uav, Camera(math.radians(60), 128), Forest(()), parameters, initial)
        before, self.seconds = deepcopy(given), 0.0
        made = TRACKERS.make(name, *given)
        self.changed = find_change(before, given, "arguments")
        super().__init__(name, made, uav, parameters.max_speed)

    def _call(self, what: str, method: str, given: object) -> None:
        before, start = deepcopy(given), perf_counter()
        super()._call(what, method, given)
        self.seconds += perf_counter() - start
        self.changed = self.changed or find_change(before, given, f"what {method} is given")


class _Flight:
    """The script, flown by a tracker on each of two linked UAVs; initial (M, 4): states of known people."""

    def __init__(self, name: str, initial: Array = _KNOWN) -> None:
        self.name = name
        self.members = [_Watched(name, uav, initial) for uav in range(2)]
        self.begun = [member.tracks for member in self.members]
        self.tracks: list[list[tuple[Track, ...]]] = []  # after each scan, by scan and UAV
        self.seconds: list[float] = []
        self.error = ""
        try:
            for k in range(_SCANS):
                self._fly(k)
        except InputError as error:
            self.error = str(error).partition("' ")[2]

    def _fly(self, k: int) -> None:
        for uav, member in enumerate(self.members):
            scan = _scan(k, uav)
            member.coast(_STEP * k) if scan is None else member.step(scan)
        fuse(self.members, ~np.eye(2, dtype=np.bool_), 5)
        self.tracks.append([member.tracks for member in self.members])
        self.seconds.append(sum(member.seconds for member in self.members) / 2 - sum(self.seconds))

    def check_people(self) -> tuple[int, str]:
        """Number of people with a track in the end, and this in words; `Unfit` if too many tracks are false."""
        means, _ = beliefs_of(self.tracks[-1][0])
        gaps = length(means[:, None, :2] - _positions(_SCANS - 1))
        held, false = int(np.sum((gaps < _FAR).any(axis=0))), int(np.sum((gaps >= _FAR).all(axis=1)))
        seen = f"{held} of 4 people have a track at the end; {false} false tracks"
        require(false <= len(_KNOWN), seen)
        return held, seen

    def check_agreement(self) -> None:
        """Raise `Unfit` if the UAVs differ in ids or beliefs."""
        for k, (one, other) in enumerate(self.tracks):
            ids = [[track.id for track in tracks] for tracks in (one, other)]
            now = f"at {_STEP * k:.1f} s"
            require(ids[0] == ids[1], f"{now} UAV 0 has ids {ids[0]}, UAV 1, which hears it, {ids[1]}")
            pairs = zip(("means", "covariances"), beliefs_of(one), beliefs_of(other), strict=True)
            for what, own, heard in pairs:
                gap = np.abs(own - heard).max(initial=0.0)
                require(gap <= _SAME, f"{now} {what} of two UAVs that hear one another differ by {spell(gap, 2)}")


def _check_scans(flight: _Flight) -> str:
    require(not flight.error, flight.error)
    return f"{_SCANS} of two UAVs: detections, misses, clutter, a look elsewhere, no frame"


def _check_known(flight: _Flight) -> str:
    ids = [track.id for track in flight.begun[0]]
    require(ids == [0, 1, 2], f"of initial tracks 0, 1, 2 it has {ids}")
    return "initial tracks are held before the first scan"


def _check_people(flight: _Flight) -> str:
    held, seen = flight.check_people()
    require(2 * held >= len(_KNOWN), seen)
    return f"{seen}; one was unknown at the start"


def _check_unknown_start(flight: _Flight) -> str:
    with judge_plugin():
        other = _Flight(flight.name, _KNOWN[:0])
    _check_scans(other)
    other.check_agreement()
    return other.check_people()[1]


def _check_covariances(flight: _Flight) -> str:
    squares: list[float] = []
    for k, (tracks, _) in enumerate(flight.tracks):
        means, covariances = beliefs_of(tracks)
        errors = means[:, None, :2] - _positions(k)
        nearest = length(errors).argmin(axis=1)
        error = errors[np.arange(len(means)), nearest]
        near = length(error) < _FAR
        squares += squared_distance(error[near], covariances[near, :2, :2]).tolist()
    if not squares:
        raise Untried("it has no track of a person")
    return check_nees(mean(squares))


def _check_agreement(flight: _Flight) -> str:
    flight.check_agreement()
    return "two UAVs that hear one another have the same ids and beliefs"


def _check_repeatable(flight: _Flight) -> str:
    changed = find_change(flight.tracks, _Flight(flight.name).tracks, "tracks")
    require(not changed, "other instances have other tracks after the same scans")
    return "equal bit for bit, on other instances"


def _check_inputs(flight: _Flight) -> str:
    for member in flight.members:
        require(not member.changed, member.changed)
    return "arguments, scans and messages are as they were"


_CHECKS: dict[str, Callable[[_Flight], str]] = {
    "scans": _check_scans,
    "known tracks": _check_known,
    "people": _check_people,
    "unknown start": _check_unknown_start,
    "covariances": _check_covariances,
    "neighbours agree": _check_agreement,
    "same scans, same tracks": _check_repeatable,
    "inputs untouched": _check_inputs,
    "time": lambda flight: describe_time(flight.seconds[1:], "a scan of 4 people"),
}
