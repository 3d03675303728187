"""The 3-D world for the Rerun viewer: forest, people, UAVs with their cameras, intents and tracks."""

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import rerun as rr

from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.facts.words import name_track, number_snapshot
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.views.drawing import palette
from sim.views.drawing.intents import Intents
from sim.views.drawing.map_view import outline_ellipse
from sim.views.drawing.palette import ALARM, CANOPY, FAINT, INK, PANEL, TRUNK, Colour, lighten, track_colour, uav_colour
from tracking.geometry.person import PERSON_HEIGHT, TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.track import Track, beliefs_of

_ARM = 0.6  # m, arm of the drawn quadrotor, enlarged to be visible from afar
_TURN = np.linspace(0.0, 2 * math.pi, 25)
_SEE_THROUGH = 150  # opacity of canopies, of 255


class Disagreement(NamedTuple):
    """Distance between the means of one track at two UAVs."""

    track: int  # number
    metres: float
    one: Array  # (2,) m
    other: Array


def log_ground(stream: rr.RecordingStream, flight: Flight) -> None:
    """Log all static entities: the area, the trees and the camera models."""
    recording, scenario = flight.recording, flight.scenario
    half = np.array([scenario.area.width, scenario.area.height]) / 2
    corners = half * [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log(
        "world/area",
        rr.Mesh3D(
            vertex_positions=_lift(corners, 0.0),
            triangle_indices=[(0, 1, 2), (0, 2, 3)],
            vertex_normals=[(0, 0, 1)] * 4,
            albedo_factor=INK,
        ),
        static=True,
    )
    edge = np.vstack([corners, corners[:1]])
    stream.log("world/area/edge", rr.LineStrips3D([_lift(edge, 0.0)], colors=[FAINT], radii=0.1), static=True)
    if len(recording.trees):
        _log_trees(stream, recording.forest)
    for i, uav in enumerate(scenario.uavs):
        camera, colour = uav.true_camera, uav_colour(i)
        lens = rr.Pinhole(
            focal_length=(camera.optics.fx, camera.optics.fy),
            principal_point=(camera.optics.cx, camera.optics.cy),
            width=camera.size[0],
            height=camera.size[1],
            camera_xyz=rr.ViewCoordinates.RUB,
            image_plane_distance=uav.altitude / 3,
            color=colour,
        )
        stream.log(f"world/camera/{i}", lens, static=True)
        for path in (f"world/camera/{i}", f"world/uav/{i}"):
            stream.log(path, rr.TransformAxes3D(axis_length=0.0), static=True)  # otherwise the viewer draws axes
        stream.log(f"world/uav/{i}", rr.LineStrips3D(_outline_quadrotor(), colors=[colour], radii=0.06), static=True)


def _log_trees(stream: rr.RecordingStream, forest: Forest) -> None:
    trunks, canopies = np.split(forest.cylinders, 2)
    shades = [(*CANOPY, round(_SEE_THROUGH * tree.cover)) for tree in forest.trees]
    for name, cylinders, colours in (("canopies", canopies, shades), ("trunks", trunks, [TRUNK])):
        x, y, radius, low, high, _ = cylinders.T
        shown = rr.Cylinders3D(
            lengths=high - low,
            radii=radius,
            centers=np.column_stack([x, y, (low + high) / 2]),
            colors=colours,
            fill_mode="solid",
            labels=[f"tree {t}" for t in range(len(forest.trees))],
            show_labels=False,
        )
        stream.log(f"world/forest/{name}", shown, static=True)


class Scene:
    """Logs the world scan by scan."""

    def __init__(self, stream: rr.RecordingStream, flight: Flight) -> None:
        self._stream = stream
        self._recording = flight.recording
        self._holds = flight.people.hold_states
        self._intents = Intents(flight.scenario)

    def log(self, k: int) -> None:
        """Log scan k: ground truth, intents and tracks."""
        snapshot = number_snapshot(self._recording, k)
        for i in range(len(snapshot.poses)) if k == 0 else ():
            self._log_name(i, f"UAV {i}", uav_colour(i))
        self._log_people(snapshot, [HOLDS[hold] for hold in self._holds[k]])
        for name, poses in (("uav", snapshot.poses), ("camera", snapshot.cameras)):
            for i, pose in enumerate(poses):
                place = rr.Transform3D(translation=pose.position, quaternion=rr.Quaternion(xyzw=pose.quaternion))
                self._stream.log(f"world/{name}/{i}", place)
        for i in find_broken(self._recording, k):
            self._log_breakdown(i)
        for i in snapshot.working:
            self._log_tracks(i, snapshot.tracks[i], named=i == snapshot.working[0])  # once, because UAVs normally agree
        self._log_disagreements(find_disagreements(self._recording, k))
        self._log_intents(snapshot)

    def _log_people(self, snapshot: Snapshot, holds: Sequence[str]) -> None:
        here = np.flatnonzero(~np.isnan(snapshot.people[:, 0])).tolist()
        people = rr.Capsules3D(
            lengths=[PERSON_HEIGHT - 0.6] * len(here),
            radii=[0.3] * len(here),
            translations=_lift(snapshot.people[here], 0.3),
            colors=[palette.UNHELD_COLOURS.get(holds[m], PANEL) for m in here],
            fill_mode="solid",
            labels=[f"person {m}" for m in here],
            show_labels=False,
        )
        unheld = [m for m in here if holds[m] in palette.UNHELD_COLOURS]
        names = rr.Points3D(
            _lift(snapshot.people[unheld], PERSON_HEIGHT),
            radii=0.1,
            colors=[lighten(palette.UNHELD_COLOURS[holds[m]]) for m in unheld],
            labels=[f"person {m} {holds[m]}" for m in unheld],
            show_labels=True,
        )
        self._stream.log("world/people", people)
        self._stream.log("world/people/lost", names)

    def _log_breakdown(self, uav: int) -> None:
        """Clear the entities that a UAV no longer has after its breakdown."""
        for name in ("tracks", "intents"):
            self._stream.log(f"world/{name}/{uav}", rr.Clear(recursive=True))
        self._log_name(uav, f"UAV {uav}, broken down", ALARM)

    def _log_name(self, uav: int, text: str, colour: Colour) -> None:
        name = rr.Points3D([(0, 0, 0)], radii=0.2, colors=[lighten(colour)], labels=[text], show_labels=True)
        self._stream.log(f"world/uav/{uav}/name", name)

    def _log_tracks(self, uav: int, tracks: Sequence[Track], *, named: bool) -> None:
        """Log 95 % ellipses of one UAV's tracks at the mid-height of people, with numbers if `named`."""
        colours = [lighten(track_colour(track.id)) for track in tracks]
        rings = [outline_ellipse(t.belief.mean[:2], t.belief.covariance[:2, :2]) for t in tracks]
        lines = rr.LineStrips3D(
            [_lift(np.vstack([ring, ring[:1]]), TARGET_HEIGHT) for ring in rings],
            colors=colours,
            radii=0.08,
            labels=[f"track {name_track(track)}" for track in tracks],
            show_labels=False,
        )
        marks = rr.Points3D(
            _lift(beliefs_of(tracks).means[:, :2], TARGET_HEIGHT),
            radii=0.15,
            colors=colours,
            labels=[*map(name_track, tracks)],
            show_labels=named,
        )
        self._stream.log(f"world/tracks/{uav}/ellipses", lines)
        self._stream.log(f"world/tracks/{uav}/means", marks)

    def _log_disagreements(self, found: Sequence[Disagreement]) -> None:
        lines = rr.LineStrips3D(
            [_lift(np.array([pair.one, pair.other]), TARGET_HEIGHT) for pair in found],
            colors=[ALARM],
            radii=0.05,
            labels=[f"track {pair.track}: {pair.metres:.2f} m apart" for pair in found],
            show_labels=False,
        )
        self._stream.log("world/agreement", lines)

    def _log_intents(self, snapshot: Snapshot) -> None:
        """Log the rest of each plan, beginning at the UAV's position."""
        self._intents.follow(snapshot)
        for i, intent in self._intents.paths(snapshot).items():
            path = _lift(intent, snapshot.poses[i].position[2])
            line = rr.LineStrips3D([path], colors=[uav_colour(i)], radii=0.08)
            self._stream.log(f"world/intents/{i}", line)
            end = rr.Points3D(path[-1:], radii=0.35, colors=[uav_colour(i)])
            self._stream.log(f"world/intents/{i}/end", end)


def find_broken(recording: Recording, k: int) -> list[int]:
    """UAVs that broke down between scan k - 1 and scan k; at the first scan, UAVs that never worked."""
    return [int(i) for i in np.flatnonzero((k == 0 or recording.working[k - 1]) & ~recording.working[k])]


def find_disagreements(recording: Recording, k: int) -> list[Disagreement]:
    """For each track that several UAVs have after scan k, the two UAVs whose positions differ most."""
    held = defaultdict(list)
    for i in range(recording.uav_count):
        for track in recording.tracks_at(k, i):
            held[recording.track_numbers[track.id]].append(track.belief.mean[:2])
    return [
        max(
            (Disagreement(number, math.dist(a, b), a, b) for a, b in combinations(means, 2)),
            key=lambda pair: pair.metres,
        )
        for number, means in held.items()
        if len(means) > 1
    ]


def _lift(points: Array, height: float) -> Array:
    """Points (N, 2) m at a height (N, 3) m."""
    return np.column_stack([points, np.full(len(points), height)])


def _outline_quadrotor() -> list[Array]:
    hubs = _ARM * np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) / math.sqrt(2)
    ring = 0.6 * _ARM * np.column_stack([np.cos(_TURN), np.sin(_TURN)])
    return [_lift(hubs[[0, 2]], 0.0), _lift(hubs[[1, 3]], 0.0), *(_lift(hub + ring, 0.05) for hub in hubs)]
