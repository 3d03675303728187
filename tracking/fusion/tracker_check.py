"""Conformance of a tracker to `tracking.fusion.member.Member`, checked on scripted scans of two UAVs."""

import math
import timeit
from copy import deepcopy

import numpy as np

from tracking.errors import spell
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.consensus import fuse
from tracking.fusion.member import TRACKERS, check_message, make_tracker
from tracking.geometry.camera import Camera, Pose
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length, squared_distance
from tracking.parameters import TrackerParameters
from tracking.plugins.findings import (
    Finding,
    check_nees,
    describe_time,
    find_change,
    require,
    require_untouched,
    try_checks,
)
from tracking.testing.stage import make_scan
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
    return try_checks(_Script(tracker), _CHECKS)


def _place_people(k: int) -> Array:
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
    seen = np.delete(_place_people(k), missed, axis=0) + rng.normal(scale=0.2, size=(4 - len(missed), 2))
    alarms = _CLUTTER if k == 9 else _CLUTTER[:0]
    z = np.concatenate([seen, alarms])[: 0 if away else None]
    return make_scan(uav, _STEP * k, _AWAY if away else _HERE, z)


def _make_arguments(uav: int, known: Array) -> tuple[int, Camera, TrackerParameters, list[Track]]:
    """What a tracker is made with, given states (M, 4) of the people that are known at the start."""
    parameters = TrackerParameters(NearlyConstantVelocity(_STEP, 0.5))
    initial = [Track(i, Gaussian(state, 0.25 * np.eye(4))) for i, state in enumerate(known.copy())]
    return uav, Camera(math.radians(60), 128), parameters, initial


class _Script:
    """The script, flown by a tracker on each of two linked UAVs."""

    def __init__(self, name: str, known: Array = _KNOWN) -> None:
        self.name = name
        self.members = [make_tracker(name, *_make_arguments(uav, known)) for uav in range(2)]
        self.tracks: list[list[tuple[Track, ...]]] = []  # after each scan, by scan and UAV

    def step(self) -> None:
        """Fly to the next scan."""
        k = len(self.tracks)
        for uav, member in enumerate(self.members):
            scan = _scan(k, uav)
            member.coast(_STEP * k) if scan is None else member.step(scan)
        fuse(self.members, ~np.eye(2, dtype=np.bool_), 5)
        self.tracks.append([member.tracks for member in self.members])

    def finish(self) -> "_Script":
        """The flight after all scans; InputError if the tracker fails."""
        while len(self.tracks) < _SCANS:
            self.step()
        return self

    def count_people(self) -> tuple[int, str]:
        """Number of people with a track at the end, and this in words; ValueError if too many tracks are false."""
        means, _ = beliefs_of(self.tracks[-1][0])
        near = length(means[:, None, :2] - _place_people(_SCANS - 1)) < _FAR
        held, false = int(near.any(axis=0).sum()), int((~near.any(axis=1)).sum())
        seen = f"{held} of 4 people have a track at the end; {false} false tracks"
        require(false <= len(_KNOWN), seen)
        return held, seen


def _check_scans(flight: _Script) -> str:
    flight.finish()
    return f"{_SCANS} of two UAVs: detections, misses, clutter, a look elsewhere, no frame"


def _check_known(flight: _Script) -> str:
    ids = [track.id for track in _Script(flight.name).members[0].tracks]
    require(ids == [0, 1, 2], f"of initial tracks 0, 1, 2 it has {ids}")
    return "initial tracks are held before the first scan"


def _check_people(flight: _Script) -> str:
    held, seen = flight.count_people()
    require(2 * held >= len(_KNOWN), seen)
    return f"{seen}; one was unknown at the start"


def _check_agreement(flight: _Script) -> str:
    for k, (one, other) in enumerate(flight.tracks):
        ids = [[track.id for track in tracks] for tracks in (one, other)]
        now = f"at {_STEP * k:.1f} s"
        require(ids[0] == ids[1], f"{now} UAV 0 has ids {ids[0]}, UAV 1, which hears it, {ids[1]}")
        pairs = zip(("means", "covariances"), beliefs_of(one), beliefs_of(other), strict=True)
        for what, own, heard in pairs:
            gap = np.abs(own - heard).max(initial=0.0)
            require(gap <= _SAME, f"{now} {what} of two UAVs that hear one another differ by {spell(gap, 2)}")
    return "two UAVs that hear one another have the same ids and beliefs"


def _check_unknown_start(flight: _Script) -> str:
    other = _Script(flight.name, _KNOWN[:0]).finish()
    _check_agreement(other)
    return other.count_people()[1]


def _check_covariances(flight: _Script) -> str:
    squares: list[float] = []
    for k, (tracks, _) in enumerate(flight.tracks):
        means, covariances = beliefs_of(tracks)
        errors = means[:, None, :2] - _place_people(k)
        nearest = length(errors).argmin(axis=1)
        error = errors[np.arange(len(means)), nearest]
        near = length(error) < _FAR
        squares += squared_distance(error[near], covariances[near, :2, :2]).tolist()
    return check_nees(squares)


def _check_repeatable(flight: _Script) -> str:
    again = _Script(flight.name).finish()
    require(not find_change(flight.tracks, again.tracks, ""), "other instances have other tracks after the same scans")
    return "equal bit for bit, on other instances"


def _check_inputs(flight: _Script) -> str:
    """Check with one UAV, without the copies that trackers get in a mission."""
    given = _make_arguments(0, _KNOWN)
    made = TRACKERS.make(flight.name, *given)
    require_untouched(_make_arguments(0, _KNOWN), given, "arguments")
    for k in range(_SCANS):
        scan = _scan(k, 0)
        if scan is None:
            made.coast(_STEP * k)
        else:
            made.step(scan)
            require_untouched(_scan(k, 0), scan, "what step is given")
        message = check_message(made.message(0))
        before = deepcopy(message)
        made.accept(message)
        require_untouched(before, message, "what accept is given")
    return "arguments, scans and messages are as they were"


def _check_time(flight: _Script) -> str:
    seconds = timeit.repeat(_Script(flight.name).step, repeat=_SCANS, number=1)
    return describe_time(seconds[1:], "a scan of two UAVs and 4 people")  # the first may prepare something


_CHECKS = {
    "scans": _check_scans,
    "known tracks": _check_known,
    "people": _check_people,
    "unknown start": _check_unknown_start,
    "covariances": _check_covariances,
    "neighbours agree": _check_agreement,
    "same scans, same tracks": _check_repeatable,
    "inputs untouched": _check_inputs,
    "time": _check_time,
}
