"""Scenes of a mission as markers of ROS 2: forest, people, UAVs with their views, intents and tracks."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from sim.exchange.ros_bag import RosMessage, count_nanoseconds
from sim.mission.recording import Recording
from sim.views.palette import DETECTION, FAINT, PANEL, TRUNK, Colour, lighten
from sim.views.scene import Scene, UavMark, find_half_axes, list_unseen_ground, mark_trees
from tracking.geometry.person import PERSON_HEIGHT, PERSON_SIZE, TARGET_HEIGHT
from tracking.geometry.quaternions import level_attitude
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

Place = tuple[float, float, float]  # m
WORLD = "map"  # the frame of REP 105, with x to the east, y to the north and z up
LEVEL = level_attitude(0.0)
_BOX, _CYLINDER, _LINE_STRIP, _LINE_LIST, _TEXT = 1, 3, 4, 5, 9  # types of markers
_DELETE_ALL = 3  # action of a marker
_SEE_THROUGH = 0.6  # opacity of opaque canopies
_LETTERS = 1.5  # m, height of names


class _Ink(NamedTuple):
    """Namespace, number and look of a marker."""

    namespace: str
    number: int
    colour: Colour
    opacity: float = 1.0


def stamp(time: float) -> tuple[int, int]:
    """Seconds and nanoseconds of the stamp of a mission's time [s]."""
    return divmod(count_nanoseconds(time), 10**9)


def head(time: float, frame: str = WORLD) -> tuple[tuple[int, int], str]:
    """The header of a message at a time [s] of the mission in a frame."""
    return stamp(time), frame


def draw_forest(recording: Recording) -> RosMessage:
    """The edge of the area, trunks and canopies."""
    area = recording.setting.area
    x, y = area.width / 2, area.height / 2
    corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0)]
    found = [_draw_line(0.0, _Ink("area", 0, FAINT), corners)]
    for tree, is_crown, colour, s in mark_trees(recording.forest):
        kind, opacity = ("canopies", _SEE_THROUGH * s.cover) if is_crown else ("trunks", 1.0)
        size = (2 * s.radius, 2 * s.radius, s.top - s.bottom)
        found.append(_draw_cylinder(0.0, _Ink(kind, tree, colour, opacity), (s.x, s.y, (s.bottom + s.top) / 2), size))
    return {"markers": found}


def draw_map(time: float, uav: UavMark, believed: Forest) -> RosMessage:
    """The crowns that a UAV has mapped, and the ground that it has not seen."""
    found = [_clear(time)]
    for n, (x, y, radius, low, high, _) in enumerate(believed.canopies.tolist()):
        ink = _Ink("mapped", n, uav.colour, _SEE_THROUGH / 2)
        found.append(_draw_cylinder(time, ink, (x, y, (low + high) / 2), (2 * radius, 2 * radius, high - low)))
    for n, (west, south, east, north) in enumerate(list_unseen_ground(believed).tolist()):
        size, ink = (east - west, north - south, 0.02), _Ink("unseen", n, TRUNK, _SEE_THROUGH / 2)
        middle = ((west + east) / 2, (south + north) / 2, 0.0)
        found.append({**_begin(time, ink, _BOX), "pose": (middle, LEVEL), "scale": size})
    return {"markers": found}


def draw_people(scene: Scene) -> RosMessage:
    """The people present, with names of those whom no UAV holds."""
    found = [_clear(scene.time)]
    for person in scene.people:
        (x, y), trouble = person.place.tolist(), person.look.trouble
        ink = _Ink("people", person.number, trouble or PANEL)
        found.append(_draw_cylinder(scene.time, ink, (x, y, TARGET_HEIGHT), PERSON_SIZE))
        if person.named:
            name = ink._replace(namespace="names", colour=lighten(ink.colour))
            found.append(_write(scene.time, name, (x, y, PERSON_HEIGHT + _LETTERS), person.title))
    return {"markers": found}


def draw_uav(time: float, uav: UavMark) -> RosMessage:
    """A UAV where it believes to be: its name, view, intent, detections and tracks; if it is broken, only its name."""
    x, y, z = uav.believed.position.tolist()  # cameras are where their bodies are
    ink = _Ink("uav", uav.number, uav.trouble or uav.colour)
    found = [_clear(time), _draw_cylinder(time, ink, (x, y, z), (1.2, 1.2, 0.3))]
    named = ink._replace(namespace="names", colour=lighten(ink.colour))
    found.append(_write(time, named, (x, y, z + _LETTERS), uav.name))
    if not uav.works:
        return {"markers": found}
    if uav.believed_view is not None:
        lines = _list_edges((x, y, z), [(x, y, 0.0) for x, y in uav.believed_view.tolist()])
        found.append(_draw_line(time, ink._replace(namespace="view", opacity=0.5), lines, kind=_LINE_LIST))
    if uav.intent is not None:
        path = [(*place, z) for place in (uav.intent + uav.believed.position[:2] - uav.place).tolist()]
        found.append(_draw_line(time, ink._replace(namespace="intent"), path))
    for n, mark in enumerate(uav.detections):
        found.append(_draw_ellipse(time, _Ink("detections", n, DETECTION, 0.6), mark.place, mark.covariance))
    for track in uav.tracks:
        ink = _Ink("tracks", track.number, lighten(track.colour), 0.6)
        found.append(_draw_ellipse(time, ink, track.mean, track.covariance))
        above = (*track.mean.tolist(), PERSON_HEIGHT)
        found.append(_write(time, ink._replace(namespace="numbers", opacity=1.0), above, track.name))
    return {"markers": found}


def _list_edges(eye: Place, ground: Sequence[Place]) -> list[Place]:
    """Both ends of each edge of a pyramid of view, whose outline on the ground begins at a corner."""
    edges = zip(ground, [*ground[1:], ground[0]], strict=True)
    sides = ((eye, corner) for corner in ground[:: len(ground) // 4])
    return [end for pair in (*edges, *sides) for end in pair]


def _draw_ellipse(time: float, ink: _Ink, mean: Array, covariance: Array) -> RosMessage:
    """The 95 % ellipse of a Gaussian, flat at the mid-height of people; mean (2,) m, covariance (2, 2) m²."""
    half, axes = find_half_axes(covariance)
    turn, size = level_attitude(math.atan2(axes[1, 0], axes[0, 0])), (2 * half).tolist()
    return _draw_cylinder(time, ink, (*mean.tolist(), TARGET_HEIGHT), (*size, 0.05), turn)


def _draw_cylinder(
    time: float, ink: _Ink, place: Sequence[float], size: Sequence[float], turn: Sequence[float] = LEVEL
) -> RosMessage:
    """An upright cylinder in the middle of a place; size: both diameters, and height [m]."""
    return {**_begin(time, ink, _CYLINDER), "pose": (place, turn), "scale": size}


def _draw_line(time: float, ink: _Ink, points: Sequence[Sequence[float]], *, kind: int = _LINE_STRIP) -> RosMessage:
    return {**_begin(time, ink, kind), "scale": (0.1, 0.0, 0.0), "points": points}


def _write(time: float, ink: _Ink, place: Sequence[float], text: str) -> RosMessage:
    return {**_begin(time, ink, _TEXT), "pose": (place, LEVEL), "scale": (0.0, 0.0, _LETTERS), "text": text}


def _clear(time: float) -> RosMessage:
    """A marker that deletes those of the previous scan."""
    return {"header": head(time), "action": _DELETE_ALL}


def _begin(time: float, ink: _Ink, kind: int) -> dict[str, Any]:
    return {
        "header": head(time),
        "ns": ink.namespace,
        "id": ink.number,
        "type": kind,
        "pose": ((0.0, 0.0, 0.0), LEVEL),
        "color": (*(part / 255 for part in ink.colour), ink.opacity),
    }
