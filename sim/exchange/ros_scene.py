"""The scene of a mission as markers of ROS 2: forest, people, UAVs with their views, intents and tracks."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from sim.exchange.ros_bag import RosMessage as Message
from sim.facts.words import name_track
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.views.drawing import palette
from sim.views.drawing.intents import Intents
from sim.views.drawing.map_view import find_half_axes
from sim.views.drawing.palette import Colour, lighten, track_colour, uav_colour
from tracking.geometry.camera import Pose
from tracking.geometry.person import PERSON_HEIGHT, PERSON_SIZE, TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.track import Track

WORLD = "map"  # the frame of REP 105, with x to the east, y to the north and z up
LEVEL = (0.0, 0.0, 0.0, 1.0)  # quaternion xyzw
_CYLINDER, _LINE_STRIP, _LINE_LIST, _TEXT = 3, 4, 5, 9  # types of markers
_DELETE_ALL: Message = {"action": 3}
_SEE_THROUGH = 0.6  # opacity of opaque canopies
_LETTERS = 1.5  # m, height of names


class _Ink(NamedTuple):
    """Namespace, number and look of a marker."""

    namespace: str
    number: int
    colour: Colour
    opacity: float = 1.0


def stamp(time: float) -> tuple[int, int]:
    """Seconds and nanoseconds of a time [s]."""
    return divmod(round(time * 1e9), 10**9)


def head(time: float, frame: str = WORLD) -> tuple[tuple[int, int], str]:
    """The header of a message at a time [s] in a frame."""
    return stamp(time), frame


def draw_forest(recording: Recording) -> Message:
    """The edge of the area, trunks and canopies."""
    area, trees = recording.setting.area, recording.forest.trees
    x, y = area.width / 2, area.height / 2
    corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0)]
    found = [_draw_line(0.0, _Ink("area", 0, palette.FAINT), corners)]
    cylinders = recording.forest.cylinders.tolist()
    opacities = [1.0] * len(trees) + [_SEE_THROUGH * tree.cover for tree in trees]
    for n, ((x, y, radius, low, high, _), opacity) in enumerate(zip(cylinders, opacities, strict=True)):
        name, colour = ("canopies", palette.CANOPY) if n >= len(trees) else ("trunks", palette.TRUNK)
        ink = _Ink(name, n % len(trees), colour, opacity)
        found.append(_draw_cylinder(0.0, ink, (x, y, (low + high) / 2), (2 * radius, 2 * radius, high - low)))
    return {"markers": found}


def draw_people(snapshot: Snapshot, holds: Sequence[str]) -> Message:
    """The people present, with names of those whom no UAV holds; holds: each one's name in `HOLDS`."""
    found = [_DELETE_ALL]
    for m in np.flatnonzero(~np.isnan(snapshot.people[:, 0])).tolist():
        x, y = snapshot.people[m].tolist()
        ink = _Ink("people", m, palette.UNHELD_COLOURS.get(holds[m], palette.PANEL))
        found.append(_draw_cylinder(snapshot.time, ink, (x, y, TARGET_HEIGHT), PERSON_SIZE))
        if holds[m] in palette.UNHELD_COLOURS:
            name = ink._replace(namespace="names", colour=lighten(ink.colour))
            found.append(_write(snapshot.time, name, (x, y, PERSON_HEIGHT + _LETTERS), f"person {m} {holds[m]}"))
    return {"markers": found}


class UavScene:
    """Markers of UAVs where they believe to be, from snapshots in order of time."""

    def __init__(self, recording: Recording) -> None:
        self._intents = Intents(recording.setting)
        self._cameras = [uav.true_camera for uav in recording.setting.uavs]

    def draw(self, snapshot: Snapshot) -> Iterator[Message]:
        """For each UAV its name, view, intent, detections and tracks; of a broken one only its name."""
        self._intents.follow(snapshot)
        paths = self._intents.paths(snapshot)
        for i, pose in enumerate(snapshot.believed or snapshot.cameras):  # which are where their bodies are
            works, (x, y, z) = i in snapshot.working, pose.position.tolist()
            ink, time = _Ink("uav", i, uav_colour(i) if works else palette.ALARM), snapshot.time
            found = [_DELETE_ALL, _draw_cylinder(time, ink, (x, y, z), (1.2, 1.2, 0.3))]
            named = ink._replace(namespace="names", colour=lighten(ink.colour))
            text = f"UAV {i}" if works else f"UAV {i}, broken down"
            found.append(_write(time, named, (x, y, z + _LETTERS), text))
            if works:
                found += self._draw_view(time, i, pose, ink)
                if i in paths:
                    path = [(*place, z) for place in (paths[i] + pose.position[:2] - paths[i][0]).tolist()]
                    found.append(_draw_line(time, ink._replace(namespace="intent"), path))
                scan, yellow = snapshot.scans[i], _Ink("detections", 0, palette.DETECTION, 0.6)
                for n, (z, R) in enumerate(zip(scan.measurements, scan.covariances, strict=True)):
                    found.append(_draw_ellipse(time, yellow._replace(number=n), z, R))
                for track in snapshot.tracks[i]:
                    found += _draw_track(time, track)
            yield {"markers": found}

    def _draw_view(self, time: float, uav: int, pose: Pose, ink: _Ink) -> Iterator[Message]:
        """The edges of a camera's view down to the ground, if none is above the horizon."""
        corners = self._cameras[uav].footprint(pose)
        if self._cameras[uav].focal and np.isfinite(corners).all():
            ground, eye = [(x, y, 0.0) for x, y in corners.tolist()], tuple(pose.position.tolist())
            edges = zip(ground, [*ground[1:], ground[0]], strict=True)
            sides = ((eye, corner) for corner in ground[:: len(ground) // 4])
            lines = [end for pair in (*edges, *sides) for end in pair]
            yield _draw_line(time, ink._replace(namespace="view", opacity=0.5), lines, kind=_LINE_LIST)


def _draw_track(time: float, track: Track) -> Iterator[Message]:
    """A track's number and ellipse."""
    ink, belief = _Ink("tracks", track.id, lighten(track_colour(track.id)), 0.6), track.belief
    yield _draw_ellipse(time, ink, belief.mean[:2], belief.covariance[:2, :2])
    above = (*belief.mean[:2].tolist(), PERSON_HEIGHT)
    yield _write(time, ink._replace(namespace="numbers", opacity=1.0), above, name_track(track))


def _draw_ellipse(time: float, ink: _Ink, mean: Array, covariance: Array) -> Message:
    """The 95 % ellipse of a Gaussian, flat at the mid-height of people; mean (2,) m, covariance (2, 2) m²."""
    half, axes = find_half_axes(covariance)
    turn, size = math.atan2(axes[1, 0], axes[0, 0]) / 2, (2 * half).tolist()
    quaternion = (0.0, 0.0, math.sin(turn), math.cos(turn))
    return _draw_cylinder(time, ink, (*mean.tolist(), TARGET_HEIGHT), (*size, 0.05), quaternion)


def _draw_cylinder(
    time: float, ink: _Ink, place: Sequence[float], size: Sequence[float], turn: Sequence[float] = LEVEL
) -> Message:
    """An upright cylinder in the middle of a place; size: both diameters, and height [m]."""
    return {**_begin(time, ink, _CYLINDER), "pose": (place, turn), "scale": size}


def _draw_line(time: float, ink: _Ink, points: Sequence[Sequence[float]], *, kind: int = _LINE_STRIP) -> Message:
    return {**_begin(time, ink, kind), "scale": (0.1, 0.0, 0.0), "points": points}


def _write(time: float, ink: _Ink, place: Sequence[float], text: str) -> Message:
    return {**_begin(time, ink, _TEXT), "pose": (place, LEVEL), "scale": (0.0, 0.0, _LETTERS), "text": text}


def _begin(time: float, ink: _Ink, kind: int) -> dict[str, Any]:
    return {
        "header": head(time),
        "ns": ink.namespace,
        "id": ink.number,
        "type": kind,
        "pose": ((0.0, 0.0, 0.0), LEVEL),
        "color": (*(part / 255 for part in ink.colour), ink.opacity),
    }
