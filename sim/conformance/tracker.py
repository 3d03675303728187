"""Conformance of a tracker to `tracking.fusion.member.Member`, checked on scripted scans of two UAVs."""

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cached_property, partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from tracking.errors import InputError
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.fusion.checked_tracker import CheckedTracker, checked_message, track_beliefs, track_ids
from tracking.fusion.consensus import fuse
from tracking.fusion.member import TRACKERS
from tracking.fusion.message import Message
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.parameters import TrackerParameters
from tracking.plugins.array_checks import check_positive_definite
from tracking.plugins.findings import Finding, Unfit, Untried, find_change, finding
from tracking.plugins.plugin_error import PluginError, plugin_call
from tracking.track import Scan, Track, beliefs_of

_SCANS, _STEP = 25, 0.2  # and s between them
_UAVS = 2
_HERE, _AWAY = Pose.level(0.0, 0.0, 25.0), Pose.level(80.0, 0.0, 25.0)
_PEOPLE = np.array([(-6.0, 2.0, 0.8, 0.3), (5.0, 4.0, -0.6, 0.6), (3.0, -6.0, 0.0, 0.9)])  # known at the start
_STRANGER = np.array([[-2.0, -7.0, 0.3, 0.6]])  # unknown at the start
_CLUTTER = np.array([[10.0, 10.0]])
_TURN = 0.45  # rad/s, left turn of all people, so that a track that walks straight or stands loses them in the end
_FAR = 3.0  # m, distance from all people beyond which a track is false
_SAME = 1e-3  # SI units, largest difference between means and between covariances on which UAVs agree
_PAST = Scan(0, 0.0, _HERE, np.zeros((0, 2)), np.zeros((0, 2, 2)))  # a scan of a time that has passed


def check(tracker: str) -> list[Finding]:
    """Findings of all checks of a tracker, which conforms if none has `passed` False.

    tracker: a name or an import string. InputError if there is no such tracker, or it cannot be made.
    """
    subject = _Subject(tracker)
    return [finding(name, partial(ask, subject)) for name, ask in _CHECKS.items()]


def _people(k: int) -> Array:
    """Positions (4, 2) m of the people at a scan; the unknown person is the last."""
    states, angle = np.concatenate([_PEOPLE, _STRANGER]), _TURN * _STEP * k
    velocities = states[:, 2:]
    aside = velocities[:, ::-1] * (-1.0, 1.0)
    return states[:, :2] + (math.sin(angle) * velocities + (1.0 - math.cos(angle)) * aside) / _TURN


def _scan(k: int, uav: int) -> Scan | None:
    """The script: scan k of a UAV; UAV 0 looks elsewhere for a while. None if the camera takes no frame."""
    if (uav == 1 and k % 2) or (uav == 0 and k == 15):
        return None
    away = uav == 0 and 10 <= k < 13
    missed = [0] if k == 7 else []  # in view, but not detected
    rng = np.random.default_rng([k, uav])
    seen = np.delete(_people(k), missed, axis=0) + rng.normal(scale=0.2, size=(4 - len(missed), 2))
    alarms = _CLUTTER if k == 9 else _CLUTTER[:0]
    z = np.concatenate([seen, alarms])[: 0 if away else None]
    return Scan(uav, _STEP * k, _AWAY if away else _HERE, z, np.tile(0.05 * np.eye(2), (len(z), 1, 1)))


class _Watched:
    """A tracker with its arguments compared before and after each call, and with its tracks checked."""

    def __init__(self, name: str, uav: int, states: Array) -> None:
        parameters = TrackerParameters(NearlyConstantVelocity(_STEP, 0.5))
        initial = [Track(i, Gaussian(state, 0.25 * np.eye(4))) for i, state in enumerate(states.copy())]
        self.given = (uav, Camera(math.radians(60), 128), Forest(()), parameters, initial)
        before = deepcopy(self.given)
        self._made = TRACKERS.make(name, *self.given)
        self.touched = find_change(before, self.given, "arguments")
        self.failed = ""  # the check that its tracks failed
        self._last = "tracks"  # the method called last
        self.seconds = 0.0

    @property
    def tracks(self) -> Any:  # noqa: ANN401 - a plug-in may return anything
        tracks = None
        with plugin_call(self._made, self._last):
            tracks = self._made.tracks
            for self.failed, look in _LOOKS.items():
                look(tracks)
        self.failed = ""
        return tracks

    def step(self, scan: Scan) -> None:
        self._call("the scan", "step", scan)

    def coast(self, time: float) -> None:
        self._call("the time", "coast", time)

    def message(self, degree: int) -> Message:
        start = perf_counter()
        sent = self._made.message(degree)
        self.seconds += perf_counter() - start
        with plugin_call(self._made, "message"):
            return checked_message(sent)

    def accept(self, message: Message) -> None:
        self._call("the message", "accept", message)

    def _call(self, name: str, method: str, given: object) -> None:
        self._last, before, start = method, deepcopy(given), perf_counter()
        getattr(self._made, method)(given)
        self.seconds += perf_counter() - start
        self.touched = self.touched or find_change(before, given, name)


_LOOKS: dict[str, Callable[[Sequence[Any]], object]] = {
    "ids": track_ids,
    "finite": track_beliefs,
    "positive definite": lambda tracks: check_positive_definite("covariances of tracks", track_beliefs(tracks)[1]),
}


class _Flight:
    """The script, flown by a tracker on each of two linked UAVs; initial (M, 4): states of known people."""

    def __init__(self, name: str, initial: Array = _PEOPLE) -> None:
        self.watched = [_Watched(name, uav, initial) for uav in range(_UAVS)]
        self.tracks: list[list[tuple[Track, ...]]] = []  # tracks after each scan, by scan and UAV
        self.seconds: list[float] = []
        self.defects: dict[str, str] = {}
        try:
            self._fly([CheckedTracker(name, made, uav, 3.0) for uav, made in enumerate(self.watched)])
        except InputError as error:
            failed = "".join(made.failed for made in self.watched)
            self.defects = {failed or "scans": str(error).partition("' ")[2]}

    def _fly(self, fleet: list[CheckedTracker]) -> None:
        self.tracks.append([deepcopy(member.tracks) for member in fleet])
        for k in range(_SCANS):
            for uav, member in enumerate(fleet):
                scan = _scan(k, uav)
                member.coast(_STEP * k) if scan is None else member.step(scan)
            fuse(fleet, ~np.eye(_UAVS, dtype=np.bool_), 5)
            self.tracks.append([deepcopy(member.tracks) for member in fleet])
            self.seconds.append(sum(made.seconds for made in self.watched) / _UAVS - sum(self.seconds))

    def ids(self, k: int) -> list[list[int]]:
        """Ids of each UAV's tracks after scan k; k = -1 is the start."""
        return [[track.id for track in tracks] for tracks in self.tracks[k + 1]]

    def people(self) -> tuple[int, int, str]:
        """Numbers of people with a track in the end and of false tracks, and the people's mean error in words."""
        places = beliefs_of(self.tracks[-1][0])[0][:, :2]
        gaps = length(places[:, None] - _people(_SCANS - 1))
        nearest = gaps.min(axis=0, initial=_FAR)
        held = nearest[nearest < _FAR]
        text = f", {held.mean():.2f} m off in the mean" if len(held) else ""
        return len(held), int(np.sum((gaps >= _FAR).all(axis=1))), text

    def numbers(self) -> bytes:
        rows = [t for fleet in self.tracks for tracks in fleet for t in tracks]
        beliefs = b"".join(t.belief.mean.tobytes() + t.belief.covariance.tobytes() for t in rows)
        return str([(t.id, t.existence) for t in rows]).encode() + beliefs


class _Subject:
    """A tracker under test, with its first flight."""

    def __init__(self, name: str) -> None:
        self.name, self.first = name, _Flight(name)

    @cached_property
    def repeated(self) -> _Flight:
        return _Flight(self.name)

    def flown(self) -> _Flight:
        if self.first.defects:
            raise Untried("it does not fly all scans")
        return self.first


def _defects(kind: str, subject: _Subject) -> str:
    if kind in subject.first.defects:
        raise Unfit(subject.first.defects[kind])
    subject.flown()
    flown = f"{_SCANS} of two UAVs: detections, misses, clutter, a look elsewhere, no frame"
    return {"scans": flown, "ids": "all different", "finite": "all numbers are"}.get(kind, "all covariances are")


def _known(subject: _Subject) -> str:
    if not subject.first.tracks:
        raise Untried("it does not fly all scans")
    if subject.first.ids(-1)[0] != [0, 1, 2]:
        raise Unfit(f"of initial tracks 0, 1, 2 it has {subject.first.ids(-1)[0]}")
    return "initial tracks are held before the first scan"


def _people_found(subject: _Subject) -> str:
    held, false, off = subject.flown().people()
    seen = f"{held} of 4 people, one of whom was unknown at the start, have a track at the end{off}"
    seen += f"; {false} false tracks"
    if 2 * held < len(_PEOPLE) or false > len(_PEOPLE):
        raise Unfit(seen)
    return seen


def _unknown_start(subject: _Subject) -> str:
    subject.flown()
    try:
        flight = _Flight(subject.name, _PEOPLE[:0])
    except InputError as error:
        raise Unfit(str(error)) from None
    for defect in flight.defects.values():
        raise Unfit(defect)
    _agree(flight)
    held, false, off = flight.people()
    seen = f"{held} of 4 have a track at the end{off} where none is known at the start; {false} false tracks"
    if false > len(_PEOPLE):
        raise Unfit(seen)
    return seen


def _agreement(subject: _Subject) -> str:
    _agree(subject.flown())
    return "two UAVs that hear one another have the same ids and beliefs"


def _agree(flight: _Flight) -> None:
    """Raise `Unfit` if the UAVs differ in ids or beliefs."""
    for k in range(_SCANS):
        own, other = flight.ids(k)
        if own != other:
            raise Unfit(f"at {_STEP * k:.1f} s UAV 0 has ids {own}, UAV 1, which hears it, {other}")
        pairs = zip(*(beliefs_of(tracks) for tracks in flight.tracks[k + 1]), strict=True)
        for what, (one, two) in zip(("means", "covariances"), pairs, strict=True):
            gap = np.abs(one - two).max(initial=0.0)
            if gap > _SAME:
                raise Unfit(
                    f"at {_STEP * k:.1f} s {what} of UAV 0 and UAV 1, which hear one another, differ by {gap:.2g}"
                )


def _repeatable(subject: _Subject) -> str:
    if subject.flown().numbers() != subject.repeated.numbers():
        raise Unfit("other instances have other tracks after the same scans")
    return "equal bit for bit, on other instances"


def _inputs(subject: _Subject) -> str:
    for made in subject.flown().watched:
        if made.touched:
            raise Unfit(made.touched)
    return "arguments, scans and messages are as they were"


def _times(subject: _Subject) -> str:
    subject.flown()
    for uav, what in enumerate(("a scan", "a time to coast to")):
        late, scan = subject.repeated.watched[uav], replace(_PAST, uav=uav)
        try:
            with plugin_call():
                late.coast(scan.time) if uav else late.step(scan)
        except PluginError:
            continue
        raise Unfit(f"takes {what} of {scan.time:.1f} s after {_STEP * (_SCANS - 1):.1f} s")
    return "a scan and a time to coast to before the last scan are refused"


def _time(subject: _Subject) -> str:
    took = subject.flown().seconds[1:]
    late = "; longer than the time between scans" if median(took) > _STEP else ""
    return f"{1e3 * median(took):.3g} ms a scan of 4 people, at most {1e3 * max(took):.3g} ms{late}"


_CHECKS: dict[str, Callable[[_Subject], str]] = {
    "known tracks": _known,
    **{kind: partial(_defects, kind) for kind in ("scans", *_LOOKS)},
    "people": _people_found,
    "unknown start": _unknown_start,
    "neighbours agree": _agreement,
    "same scans, same tracks": _repeatable,
    "inputs untouched": _inputs,
    "times that go back": _times,
    "time": _time,
}
