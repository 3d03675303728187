"""The map of a mission, drawn from above with north up."""

import math
from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from sim.facts.metrics.holding import ELLIPSE, HOLDS
from sim.facts.words import name_track, number_snapshot
from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import true_view_of
from sim.views.drawing import palette
from sim.views.drawing.intents import Intents
from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle
from sim.views.drawing.marks import draw_broken_mark, draw_cross, draw_person_mark, draw_quadrotor
from sim.views.drawing.palette import BELIEVED, INK, PANEL, mix, track_colour, uav_colour, uav_dashes
from sim.views.drawing.strokes import SHIFT, cut_dashes, draw_disc, draw_line, draw_lines, to_fixed_point
from sim.world.contacts import Contact, describe_body
from tracking.geometry.camera import Camera, Pose, meet_plane
from tracking.geometry.visibility import Forest, at_target_height
from tracking.numerics.arrays import Array, Image, Indices
from tracking.track import Track, beliefs_of

MARGIN = 4.0  # m shown beyond the area
TRAIL = 3.0  # s, length of trails
ALERT = 1.0  # s, time for which a contact is marked
_SPACIOUS = 2.0  # pixels per m; marks on maps with less are smaller
_FEW = 12  # people; more are a crowd

_CIRCLE = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 48, endpoint=False)])


def outline_ellipse(mean: Array, covariance: Array) -> Array:
    """Points (..., 48, 2) m on the 95 % ellipses of planar Gaussians.

    mean (..., 2) m, covariance (..., 2, 2) m².
    """
    half, axes = find_half_axes(covariance)
    return np.asarray(mean[..., None, :] + (_CIRCLE * half[..., None, :]) @ np.swapaxes(axes, -1, -2))


def find_half_axes(covariance: Array) -> tuple[Array, Array]:
    """Half axes (..., 2) m of 95 % ellipses, ascending, and their directions, the columns of (..., 2, 2)."""
    variances, axes = np.linalg.eigh(covariance)
    return ELLIPSE * np.sqrt(np.maximum(variances, 0.0)), axes


def measure_map(scenario: Scenario) -> tuple[float, float]:
    """Width and height of the map [m] with its margin."""
    return scenario.area.width + 2 * MARGIN, scenario.area.height + 2 * MARGIN


class _Past(NamedTuple):
    """What is drawn of an earlier scan."""

    people: Array  # (M, 2) m
    means: dict[int, Array]  # (2,) m, of the shown tracks by their ids
    contacts: tuple[Contact, ...]


class MapView:
    """Draws snapshots, in order of time, on a map; its trees are drawn once."""

    def __init__(self, scenario: Scenario, forest: Forest, size: tuple[int, int]) -> None:
        self._area = (scenario.area.width, scenario.area.height)
        self._views = [true_view_of(uav, scenario) for uav in scenario.uavs]
        self._size = size
        width, height = measure_map(scenario)
        self.scale = min(size[0] / width, size[1] / height)
        self._mark = float(np.clip(self.scale / _SPACIOUS, 0.5, 1.0))
        self._scenario = scenario
        self._rate = scenario.rates.sensing
        self._alert = round(ALERT * self._rate)
        self._past: deque[_Past] = deque(maxlen=round(TRAIL * self._rate))
        self._intents = Intents(scenario)
        # s, length of the past on which a picture depends by trails, plans in flight and last frames of slow cameras
        self._reach = max(TRAIL, scenario.network.plan_delay + scenario.rates.plan_step)
        self._last: dict[int, Snapshot] = {}  # the snapshot of each camera's last frame
        self._ground = self._draw_ground(forest)

    def follow(self, snapshot: Snapshot) -> None:
        """Process one snapshot, for trails and intents, without drawing it."""
        self._intents.follow(snapshot)
        means = {track.id: track.belief.mean[:2] for track in self.shown_tracks(snapshot)}
        self._past.append(_Past(snapshot.people, means, snapshot.contacts))
        self._last |= {i: snapshot for i in snapshot.working if snapshot.frames[i]}

    def draw(self, image: Image, snapshot: Snapshot, holds: Indices | None = None) -> Labels:
        """Draw one snapshot into an RGB image of the map's size; return its labels for further names.

        holds (M,): states of people, as indices into `HOLDS`; with None no person is marked as lost.
        """
        holds = np.zeros(len(snapshot.people), dtype=np.int64) if holds is None else holds
        self.follow(snapshot)
        image[:] = self._ground
        views = [find_footprint(self._scenario, i, pose) for i, pose in enumerate(snapshot.cameras)]
        for i in snapshot.working:
            if (corners := views[i]) is not None:
                self._draw_view(image, self.pixels(corners), i)
        for i, pose in enumerate(snapshot.believed or ()):
            if i in snapshot.working and (corners := find_footprint(self._scenario, i, pose)) is not None:
                draw_lines(image, cut_dashes(self.pixels(corners), BELIEVED), uav_colour(i))
        self._draw_trails(image, snapshot)
        self._draw_intents(image, snapshot)
        labels = Labels(image, veil=False)
        uavs = self.pixels(np.array([pose.position[:2] for pose in snapshot.poses]))
        working = set(snapshot.working)
        for i, at in enumerate(uavs):
            if i in working:
                draw_quadrotor(image, at, uav_colour(i), self._mark)
            else:
                draw_broken_mark(image, at)
        labels.reserve(uavs, 8.0 * self._mark)
        tracks = self.shown_tracks(snapshot)
        means, covariances = beliefs_of(tracks)
        rings, crosses = self.pixels(outline_ellipse(means[:, :2], covariances[:, :2, :2])), self.pixels(means[:, :2])
        for track, ring, at in zip(tracks, rings, crosses, strict=True):
            draw_line(image, ring, track_colour(track.id), thickness=2, closed=True)
            draw_cross(image, at, track_colour(track.id), self._mark)
        labels.reserve(crosses, 6.0 * self._mark)
        labels.reserve(self.pixels(snapshot.people[~np.isnan(snapshot.people[:, 0])]), 9.0 * self._mark)
        self._draw_contacts(image, snapshot, labels)
        self._put_names(snapshot, holds, views, labels)
        self._draw_people(image, snapshot, holds)
        return labels

    def draw_recorded(self, recording: Recording, k: int, holds: Indices) -> tuple[Image, Labels]:
        """The map (H, W, 3) of a recording at scan k, with trails and intents, and its labels for further names.

        holds (M,): states of people at the scan, as indices into `HOLDS`.
        """
        for earlier in range(max(0, k - round(self._reach * self._rate)), k):
            self.follow(number_snapshot(recording, earlier))
        image = np.empty_like(self._ground)
        return image, self.draw(image, number_snapshot(recording, k), holds)

    @staticmethod
    def shown_tracks(snapshot: Snapshot) -> tuple[Track, ...]:
        """The tracks that are drawn: those of the first working UAV."""
        return snapshot.tracks[snapshot.working[0]] if snapshot.working else ()

    def pixels(self, points: Array) -> Array:
        """Pixels (..., 2) of the map at points (..., 2) m."""
        centre = np.array(self._size) / 2
        return centre + self.scale * np.asarray(points, dtype=float) * [1.0, -1.0]

    def _draw_ground(self, forest: Forest) -> Image:
        image = np.full((self._size[1], self._size[0], 3), PANEL, dtype=np.uint8)
        half = np.array(self._area) / 2
        for axis in (0, 1):
            for tick in np.arange(-(half[axis] // 10) * 10, half[axis] + 1e-9, 10.0):
                ends = np.array([-half, half])
                ends[:, axis] = tick
                draw_line(image, self.pixels(ends), mix(palette.LINE, PANEL, 0.5))
        canopies = image.copy()
        for tree in forest.trees:
            colour = mix(palette.CANOPY, PANEL, tree.cover)
            draw_disc(canopies, self.pixels(np.array([tree.x, tree.y])), tree.canopy_radius * self.scale, colour)
        cv2.addWeighted(canopies, 0.6, image, 0.4, 0, dst=image)
        for tree in forest.trees:
            place = self.pixels(np.array([tree.x, tree.y]))
            draw_disc(image, place, tree.canopy_radius * self.scale, palette.CANOPY_EDGE, 1)
            draw_disc(image, place, max(tree.trunk_radius * self.scale, 2.2 * self._mark), palette.TRUNK)
        draw_line(image, self.pixels(half * [(-1, -1), (1, -1), (1, 1), (-1, 1)]), palette.FAINT, closed=True)
        return image

    def _draw_view(self, image: Image, outline: Array, uav: int) -> None:
        colour, dashes = uav_colour(uav), uav_dashes(uav)
        low = np.clip(np.floor(outline.min(axis=0)) - 1, 0, self._size).astype(int)
        high = np.clip(np.ceil(outline.max(axis=0)) + 2, 0, self._size).astype(int)
        part = image[low[1] : high[1], low[0] : high[0]]
        if part.size:
            tinted = part.copy()
            cv2.fillPoly(tinted, [to_fixed_point(outline - low)], colour, cv2.LINE_AA, SHIFT)
            cv2.addWeighted(tinted, 0.14, part, 0.86, 0, dst=part)
        if dashes:
            draw_lines(image, cut_dashes(outline, dashes), colour, thickness=2)
        else:
            draw_line(image, outline, colour, thickness=2, closed=True)

    def _draw_trails(self, image: Image, snapshot: Snapshot) -> None:
        past = self.pixels(np.array([old.people for old in self._past]))
        trails = [trail[~np.isnan(trail[:, 0])] for trail in past.transpose(1, 0, 2)]
        draw_lines(image, trails, mix(INK, PANEL, 0.45))
        for track in self.shown_tracks(snapshot):
            means = np.array([old.means[track.id] for old in self._past if track.id in old.means])
            draw_line(image, self.pixels(means), mix(track_colour(track.id), PANEL, 0.7))

    def _draw_intents(self, image: Image, snapshot: Snapshot) -> None:
        """Draw dots along the rest of each plan, beginning at the UAV's position."""
        for i, intent in self._intents.paths(snapshot).items():
            path = self.pixels(intent)
            for dot in _points_along(path, 7.0)[2:]:
                draw_disc(image, dot, 2.0, uav_colour(i))
            draw_disc(image, path[-1], 4.0, uav_colour(i), 2)

    def _draw_people(self, image: Image, snapshot: Snapshot, holds: Indices) -> None:
        views = self._people_views(snapshot)
        for place, heading, view, hold in zip(snapshot.people, snapshot.headings, views, holds, strict=True):
            if not np.isnan(place[0]):
                draw_person_mark(image, self.pixels(place), heading, view=view, hold=HOLDS[hold], size=self._mark)

    def _people_views(self, snapshot: Snapshot) -> list[str]:
        """States of people in the last frames of the cameras, in the form that `draw_person_mark` takes."""
        seen, inside = np.zeros((2, len(snapshot.people)), dtype=np.bool_)
        for i in snapshot.working:
            last = self._last.get(i, snapshot)
            points = at_target_height(np.nan_to_num(last.people))
            seen |= last.visible[i] > 0
            inside |= self._views[i].sees(last.cameras[i], points) & ~np.isnan(last.people[:, 0])
        return ["seen" if s else "hidden" if h else "out of view" for s, h in zip(seen, inside, strict=True)]

    def _draw_contacts(self, image: Image, snapshot: Snapshot, labels: Labels) -> None:
        """Draw a ring around each UAV that has just touched a body, and name the body."""
        latest = {c.uav: c for old in list(self._past)[-self._alert :] for c in old.contacts}
        for uav, contact in latest.items():
            centre = self.pixels(snapshot.poses[uav].position[:2])
            draw_disc(image, centre, 15.0, palette.ALARM, 3)
            text = f"touched {describe_body(contact.kind, contact.other)}"
            labels.put(text, centre, TextStyle(13, palette.ALARM, True, PANEL))

    def _put_names(self, snapshot: Snapshot, holds: Indices, views: Sequence[Array | None], labels: Labels) -> None:
        """Name UAVs, tracks and lost people, clear of all marks; views: corners of each camera's field of view.

        In a crowd UAVs come first, then lost people, and people and tracks have names only where there is room.
        """
        crowd = len(snapshot.people) > _FEW or len(snapshot.poses) > len(palette.UAV_COLOURS)
        steps = [
            partial(self._name_uavs, snapshot, views, labels),
            partial(self._name_lost, snapshot, holds, labels, needed=not crowd),
            partial(self._name_tracks, snapshot, labels, needed=not crowd),
        ]
        for step in steps if crowd else reversed(steps):
            step()

    def _name_tracks(self, snapshot: Snapshot, labels: Labels, *, needed: bool) -> None:
        for track in self.shown_tracks(snapshot):
            at, style = self.pixels(track.belief.mean[:2]), TextStyle(13, track_colour(track.id), True, PANEL)
            labels.put(name_track(track), at, style, gap=11.0 * self._mark, needed=needed)

    def _name_lost(self, snapshot: Snapshot, holds: Indices, labels: Labels, *, needed: bool) -> None:
        style = TextStyle(13, palette.LOST, True, PANEL)
        for m in np.flatnonzero(holds == HOLDS.index("lost")).tolist():
            at = self.pixels(snapshot.people[m])
            labels.put(f"person {m}", at, style, gap=14.0 * self._mark, needed=needed)

    def _name_uavs(self, snapshot: Snapshot, views: Sequence[Array | None], labels: Labels) -> None:
        outlines = {i: self.pixels(corners) for i in snapshot.working if (corners := views[i]) is not None}
        shown = {i: np.concatenate([c.min(axis=0), c.max(axis=0)]) for i, c in outlines.items()}
        for i, pose in enumerate(snapshot.cameras):
            at, style = self.pixels(pose.position[:2]), TextStyle(13, mix(uav_colour(i), INK, 0.7), True, PANEL)
            if i not in snapshot.working:
                labels.put(f"UAV {i}: broken down", at, TextStyle(13, INK, True, PANEL), gap=18.0)
            elif i in shown:
                others = np.reshape([shown[j] for j in shown if j != i], (-1, 4))
                labels.put_outside(f"UAV {i}", shown[i], style, others=others)
            else:
                labels.put(f"UAV {i}", at, style)


def find_footprint(scenario: Scenario, uav: int, pose: Pose) -> Array | None:
    """Outline (N, 2) m of a camera's field of view on the ground; None if it has no bounds nearby."""
    camera = scenario.uavs[uav].true_camera
    if scenario.sensing.field_of_view == "unlimited":
        return None
    rays = camera.rays(pose, camera.outline)
    return meet_plane(pose, rays) if _point_down(rays) else None


def looks_down(camera: Camera, pose: Pose, pixels: Array | None = None) -> bool:
    """True if the rays through pixels (N, 2), by default the image's outline, meet the ground nearby."""
    return _point_down(camera.rays(pose, camera.outline if pixels is None else pixels))


def _point_down(rays: Array) -> bool:
    return bool(np.all(rays[:, 2] < -0.1))


def _points_along(path: Array, gap: float) -> Array:
    """Points (N, 2) every `gap` pixels along a polyline."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    stops = np.arange(0.0, lengths[-1], gap)
    return np.column_stack([np.interp(stops, lengths, path[:, axis]) for axis in (0, 1)])
