"""The map of a mission, drawn from above with north up."""

from collections.abc import Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import ArrayLike

from sim.scenario.scenario import Scenario
from sim.views import palette
from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle
from sim.views.drawing.marks import draw_broken_mark, draw_cross, draw_detection, draw_person_mark, draw_quadrotor
from sim.views.drawing.strokes import SHIFT, cut_dashes, draw_disc, draw_line, draw_lines, to_fixed_point
from sim.views.palette import BELIEVED, INK, PANEL, UNSEEN, UNSEEN_SHARE, mix
from sim.views.scene import (
    PersonMark,
    Scene,
    TrackMark,
    UavMark,
    list_unseen_ground,
    mark_trees,
    measure_map,
    outline_ellipse,
    outline_mistaken_crowns,
)
from tracking.geometry.visibility import NO_TREES, Forest
from tracking.numerics.arrays import Array, Image

_SPACIOUS = 2.0  # pixels per m; marks on maps with less are smaller


class MapView:
    """Draws scenes on a map; its trees are drawn once."""

    def __init__(
        self, scenario: Scenario, forest: Forest, size: tuple[int, int], believed: Forest | None = None
    ) -> None:
        """`believed`: the map that UAVs believe, whose crowns are outlined in dashes where they differ."""
        self._area = (scenario.area.width, scenario.area.height)
        self._size = size
        width, height = measure_map(scenario)
        self.scale = min(size[0] / width, size[1] / height)
        self._mark = float(np.clip(self.scale / _SPACIOUS, 0.5, 1.0))
        self._ground = self._draw_ground(forest)
        self._draw_crowns(self._ground, outline_mistaken_crowns(forest, believed), palette.CANOPY_EDGE)

    def draw(self, scene: Scene, image: Image | None = None) -> tuple[Image, Labels]:
        """The map (H, W, 3) RGB of a scene, in `image` if it is given, and its labels for further names."""
        image = np.empty_like(self._ground) if image is None else image
        image[:] = self._ground
        if scene.mapped is not None:
            self._draw_believed(image, scene.mapped)
        self._draw_views(image, scene)
        for trail in scene.trails:
            draw_line(image, self.pixels(trail.places), trail.colour)
        for uav in scene.uavs:
            self._draw_intent(image, uav)
        labels = Labels(image, veil=False)
        uavs = self._places(scene.uavs)
        for uav, at in zip(scene.uavs, uavs, strict=True):
            if uav.works:
                draw_quadrotor(image, at, uav.colour, self._mark)
            else:
                draw_broken_mark(image, at)
        labels.reserve(uavs, 8.0 * self._mark)
        self._draw_tracks(image, scene.tracks, labels)
        labels.reserve(self._places(scene.people), 9.0 * self._mark)
        self._draw_contacts(image, scene, labels)
        self._put_names(scene, labels)
        for person in scene.people:
            draw_person_mark(image, self.pixels(person.place), person.heading, person.look, self._mark)
        for mark in scene.detections:
            draw_detection(image, self.pixels(mark.place), reach=4.0)
        return image, labels

    def pixels(self, points: ArrayLike) -> Array:
        """Pixels (..., 2) of the map at points (..., 2) m."""
        centre = np.array(self._size) / 2
        return centre + self.scale * np.asarray(points, dtype=float) * [1.0, -1.0]

    def _places(self, marks: Sequence[UavMark] | Sequence[PersonMark]) -> Array:
        """Pixels (N, 2) of marks."""
        return self.pixels(np.array([mark.place for mark in marks]).reshape(-1, 2))

    def _draw_ground(self, forest: Forest) -> Image:
        image = np.full((self._size[1], self._size[0], 3), PANEL, dtype=np.uint8)
        half = np.array(self._area) / 2
        for axis in (0, 1):
            for tick in np.arange(-(half[axis] // 10) * 10, half[axis] + 1e-9, 10.0):
                ends = np.array([-half, half])
                ends[:, axis] = tick
                draw_line(image, self.pixels(ends), mix(palette.LINE, PANEL, 0.5))
        shade, trees = image.copy(), mark_trees(forest)
        for tree in (tree for tree in trees if tree.is_crown):
            colour = mix(tree.colour, PANEL, tree.solid.cover)
            draw_disc(shade, self.pixels(tree.solid[1:3]), tree.solid.radius * self.scale, colour)
        cv2.addWeighted(shade, 0.6, image, 0.4, 0, dst=image)
        for tree in trees:
            place, radius = self.pixels(tree.solid[1:3]), tree.solid.radius * self.scale
            if tree.is_crown:
                draw_disc(image, place, radius, palette.CANOPY_EDGE, 1)
            else:
                draw_disc(image, place, max(radius, 2.2 * self._mark), tree.colour)
        draw_line(image, self.pixels(half * [(-1, -1), (1, -1), (1, 1), (-1, 1)]), palette.FAINT, closed=True)
        return image

    def _draw_crowns(self, image: Image, rings: Sequence[Array], colour: palette.Colour) -> None:
        for ring in rings:
            draw_lines(image, cut_dashes(self.pixels(ring), BELIEVED), colour)

    def _draw_believed(self, image: Image, believed: Forest) -> None:
        """Outline the crowns that a UAV has mapped, and shade the ground that it has not seen."""
        for strip in list_unseen_ground(believed):
            (left, low), (right, high) = np.rint(self.pixels(strip.reshape(2, 2))).astype(int)
            part = image[high:low, left:right]
            part[:] = cv2.addWeighted(np.full_like(part, UNSEEN), UNSEEN_SHARE, part, 1.0 - UNSEEN_SHARE, 0)
        self._draw_crowns(image, outline_mistaken_crowns(NO_TREES, believed), palette.TRUNK)

    def _draw_views(self, image: Image, scene: Scene) -> None:
        for uav in scene.uavs:
            if uav.view is not None:
                self._draw_view(image, self.pixels(uav.view), uav)
        for uav in scene.uavs if scene.poses_err else ():
            if uav.believed_view is not None:
                draw_lines(image, cut_dashes(self.pixels(uav.believed_view), BELIEVED), uav.colour)

    def _draw_view(self, image: Image, outline: Array, uav: UavMark) -> None:
        colour, dashes = uav.colour, uav.dashes
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

    def _draw_contacts(self, image: Image, scene: Scene, labels: Labels) -> None:
        """Draw a ring around each UAV that has just touched a body, and name the body."""
        for uav in scene.uavs:
            if uav.touched:
                centre = self.pixels(uav.place)
                draw_disc(image, centre, 15.0, palette.ALARM, 3)
                labels.put(f"touched {uav.touched}", centre, TextStyle(13, palette.ALARM, True, PANEL))

    def _draw_intent(self, image: Image, uav: UavMark) -> None:
        """Draw dots along the intent, and a ring at its end."""
        if uav.intent is None:
            return
        path = self.pixels(uav.intent)
        for dot in _points_along(path, 7.0)[2:]:
            draw_disc(image, dot, 2.0, uav.colour)
        draw_disc(image, path[-1], 4.0, uav.colour, 2)

    def _draw_tracks(self, image: Image, tracks: Sequence[TrackMark], labels: Labels) -> None:
        means = np.array([track.mean for track in tracks]).reshape(-1, 2)
        covariances = np.array([track.covariance for track in tracks]).reshape(-1, 2, 2)
        crosses = self.pixels(means)
        rings = self.pixels(outline_ellipse(means, covariances))
        for track, ring, at in zip(tracks, rings, crosses, strict=True):
            draw_line(image, ring, track.colour, thickness=2, closed=True)
            draw_cross(image, at, track.colour, self._mark)
        labels.reserve(crosses, 6.0 * self._mark)

    def _put_names(self, scene: Scene, labels: Labels) -> None:
        """Name UAVs, tracks and people who have a name, clear of all marks.

        In a crowd UAVs come first, then people, and people and tracks have names only where there is room.
        """
        steps = [
            partial(self._name_uavs, scene, labels),
            partial(self._name_people, scene, labels),
            partial(self._name_tracks, scene, labels),
        ]
        for step in steps if scene.crowd else reversed(steps):
            step()

    def _name_tracks(self, scene: Scene, labels: Labels) -> None:
        for track in scene.tracks:
            style = TextStyle(13, track.colour, True, PANEL)
            labels.put(track.name, self.pixels(track.mean), style, gap=11.0 * self._mark, needed=not scene.crowd)

    def _name_people(self, scene: Scene, labels: Labels) -> None:
        for person in scene.people:
            if person.named:
                at = self.pixels(person.place)
                style = TextStyle(13, person.named, True, PANEL)
                labels.put(person.name, at, style, gap=14.0 * self._mark, needed=not scene.crowd)

    def _name_uavs(self, scene: Scene, labels: Labels) -> None:
        outlines = {uav.number: self.pixels(uav.view) for uav in scene.uavs if uav.view is not None}
        shown = {i: np.concatenate([c.min(axis=0), c.max(axis=0)]) for i, c in outlines.items()}
        for uav, at in zip(scene.uavs, self._places(scene.uavs), strict=True):
            style = TextStyle(13, mix(uav.colour, INK, 0.7), True, PANEL)
            if not uav.works:
                labels.put(uav.name, at, TextStyle(13, INK, True, PANEL), gap=18.0)
            elif uav.number in shown:
                others = np.reshape([shown[j] for j in shown if j != uav.number], (-1, 4))
                labels.put_outside(uav.name, shown[uav.number], style, others=others)
            else:
                labels.put(uav.name, at, style)


def _points_along(path: Array, gap: float) -> Array:
    """Points (N, 2) every `gap` pixels along a polyline."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    stops = np.arange(0.0, lengths[-1], gap)
    return np.column_stack([np.interp(stops, lengths, path[:, axis]) for axis in (0, 1)])
