"""One camera's frame, enlarged, with detections, tracks and ground truth drawn over it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import cv2
import numpy as np

from sim.facts.sightings import Sighting
from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle, write
from sim.views.drawing.marks import draw_cross, draw_detection
from sim.views.drawing.strokes import SHIFT, draw_disc, draw_line, draw_outline, to_fixed_point
from sim.views.frames.frame_facts import FrameFacts, outline_cylinder, outline_hidden_ground
from sim.views.palette import DETECTION, INK, PANEL, TRUNK, Colour, track_colour
from sim.views.scene import looks_down, outline_ellipse
from tracking.geometry.person import PERSON_HEIGHT, PERSON_RADIUS
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Image

Mark = Callable[[Image, Array], None]
_LENGTHS = [base * 10.0**power for power in range(-1, 4) for base in (1, 2, 5)]  # m, possible lengths of scale bars
_RIMS = {False: ((INK, 9), (PANEL, 5)), True: ((PANEL, 17), (INK, 13))}  # colours and reaches in pixels


def annotate(frame: Image, sight: FrameFacts, size: int) -> tuple[Image, set[str]]:
    """The frame (H, W, 3) RGB, enlarged, with all marks, and the names of the marks that it shows.

    Its longer edge P becomes the largest multiple of P up to `size` pixels, so that each pixel of the camera becomes a
    square. It is `size` itself where that is much larger, or less than P.
    """
    pixels = max(frame.shape[:2])
    squares = size // pixels * pixels
    side = squares if squares > 0.8 * size else size
    how = cv2.INTER_NEAREST if side == squares else cv2.INTER_LINEAR if side > pixels else cv2.INTER_AREA
    height, width = (round(edge * side / pixels) for edge in frame.shape[:2])
    image = np.asarray(cv2.resize(frame, (width, height), interpolation=how), dtype=np.uint8)
    view = _Overlay(image, sight)
    view.draw()
    return image, view.shown


class _Scale(NamedTuple):
    """Lines (N, 2), and words at pixels (2,), of the scale bar and the north arrow."""

    lines: list[Array]
    words: dict[str, Array]


class _Overlay:
    """Drawing over the frame of one camera: marks first, then their names, clear of all marks."""

    def __init__(self, image: Image, sight: FrameFacts) -> None:
        self._image = image
        self._sight = sight
        self._scale = max(image.shape) / max(sight.camera.size)
        self._size = np.array(image.shape[1::-1])
        self._labels = Labels(image)
        self.shown: set[str] = set()  # names of the marks that lie in the image
        outlines = outline_hidden_ground(sight.camera, sight.pose, sight.forest)
        self._outlines = [[self._scale * part for part in tree] for tree in outlines]

    @contextmanager
    def _drawing(self, mark: str) -> Iterator[None]:
        before = self._image.copy()
        yield
        if not np.array_equal(self._image, before):
            self.shown.add(mark)

    def draw(self) -> None:
        people = [sighting for sighting in self._sight.people if sighting.in_image]
        hiding = sorted({tree for sighting in people for tree in sighting.hidden_by})
        others = self._image.copy()
        _draw_rim(others, [part for tree, parts in enumerate(self._outlines) if tree not in hiding for part in parts])
        self.shown |= {_RIM} if np.any(others != self._image) else set()
        _draw_rim(self._image, [part for tree in self._outlines for part in tree])
        with self._drawing(_HIDING_RIM):
            for tree in hiding:
                _draw_rim(self._image, self._outlines[tree], hiding=True)
        with self._drawing(_MAPPED):
            self._draw_mapped()
        with self._drawing(_TRUTH):
            for sighting in people:
                outline = self._person(sighting)
                _draw_truth(self._image, outline)
                self._labels.reserve(outline.mean(axis=0), float(np.ptp(outline, axis=0).max()) / 2)
        self._draw_measurements()
        with self._drawing(TRACK):
            self._draw_tracks()
        scale = self._place_scale()
        for sighting in people:
            self._name_person(sighting)
        self._name_tracks()
        self._name_trees(hiding)
        self._draw_scale(scale)  # on top, because in a crowd names may be placed here

    def _pixels(self, ground: Array) -> Array:
        """Pixels (N, 2) of points (N, 2) m at `TARGET_HEIGHT` as the UAV believes; NaN behind the camera."""
        return np.asarray(
            self._scale * self._sight.believed_camera.project(self._sight.believed, at_target_height(ground))[0]
        )

    def _person(self, sighting: Sighting) -> Array:
        body = np.array([*sighting.place, PERSON_RADIUS, 0.0, PERSON_HEIGHT])
        return np.asarray(self._scale * outline_cylinder(self._sight.camera, self._sight.pose, body))

    def _draw_measurements(self) -> None:
        marks = self._sight.detections
        rings = [self._pixels(np.vstack([m.place, outline_ellipse(m.place, m.covariance)])) for m in marks]
        finite = [k for k, ring in enumerate(rings) if np.all(np.isfinite(ring))]
        with self._drawing(_DETECTION):
            for k in finite:
                if (pixel := marks[k].pixel) is not None:
                    found = self._scale * pixel
                    draw_outline(self._image, np.array([found, rings[k][0]]), DETECTION, INK)
                    draw_detection(self._image, found, max(5.0 * self._scale, 10.0))
        with self._drawing(_MEASUREMENT):
            for k in finite:
                _draw_measurement(self._image, rings[k][0], rings[k][1:])
                self._labels.reserve(rings[k][0], 8.0)

    def _draw_mapped(self) -> None:
        sight = self._sight
        for tree in sight.mapped.trees if sight.mapped else ():
            crown = np.array([tree.x, tree.y, tree.canopy_radius, tree.canopy_base, tree.canopy_top])
            outline = self._scale * outline_cylinder(sight.believed_camera, sight.believed, crown)
            if len(outline):
                _draw_mapped_crown(self._image, outline)

    def _draw_tracks(self) -> None:
        for track in self._sight.tracks:
            at = self._pixels(track.mean[None])[0]
            ring = self._pixels(outline_ellipse(track.mean, track.covariance))
            if np.all(np.isfinite(ring)):
                _draw_track(self._image, at, ring, track.colour)
                self._labels.reserve(at, 10.0)

    def _name_person(self, sighting: Sighting) -> None:
        why = "" if sighting.status in ("seen", "in view") else f": {sighting.status}"
        at = np.clip(self._person(sighting).mean(axis=0), 0, self._size)
        self._labels.put(f"truth: person {sighting.person}{why}", at, TextStyle(13, INK, True, PANEL))

    def _name_tracks(self) -> None:
        for track in self._sight.tracks:
            at = self._pixels(track.mean[None])[0]
            if np.all(np.isfinite(at) & (at >= 0) & (at <= self._size)):
                self._labels.put(f"track {track.name}", at, TextStyle(13, track.colour, True, PANEL))

    def _name_trees(self, hiding: Sequence[int]) -> None:
        for tree in hiding:
            for part in self._outlines[tree][-1:]:  # the canopy, or the trunk if only the trunk is in view
                shown = np.clip(part, 0, self._size)
                middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
                self._labels.put(f"tree {tree}", middle, TextStyle(12, PANEL, False, INK))

    def _place_scale(self) -> _Scale:
        """The scale bar, of a round length on the ground, and the north arrow in the lower corners; reserves both."""
        camera, pose = self._sight.camera, self._sight.pose
        corners = np.array([(0.04, 0.96), (0.34, 0.96), (0.96, 0.96)]) * camera.size
        if not looks_down(camera, pose, corners):
            return _Scale([], {})
        left, right, last = camera.ground_points(pose, corners)
        room = float(np.hypot(*(right - left)))
        length = max((m for m in _LENGTHS if m <= room), default=_LENGTHS[0])
        ground = np.array([left, left + length / room * (right - left), last, last + np.array([0.0, 0.1])])
        *ends, foot, ahead = self._scale * camera.project(pose, np.column_stack([ground, np.zeros(4)]))[0]
        bar = np.array(ends)
        ticks = [end + np.array([(0.0, -6.0), (0.0, 1.0)]) for end in bar]
        self._labels.reserve(bar.mean(axis=0), float(np.hypot(*(bar[1] - bar[0]))) / 2)
        arrow, letter = _make_arrow(foot - 26.0, (ahead - foot) / np.hypot(*(ahead - foot)))
        self._labels.reserve(foot - 26.0, 26.0)
        self._labels.reserve(letter, 9.0)
        return _Scale([bar, *ticks, *arrow], {f"{length:g} m": bar.mean(axis=0) - (0.0, 14.0), "N": letter})

    def _draw_scale(self, scale: _Scale) -> None:
        for colour, thickness in ((INK, 5), (PANEL, 2)):
            for line in scale.lines:
                draw_line(self._image, line, colour, thickness=thickness)
        for text, (x, y) in scale.words.items():
            write(self._image, text, (float(x), float(y)), TextStyle(13, PANEL, True, INK), align=0.5)


def _make_arrow(middle: Array, ahead: Array) -> tuple[list[Array], Array]:
    """Lines (N, 2) of an arrow with 26 pixels along a unit vector (2,), and the place (2,) beyond its tip."""
    side = np.array([-ahead[1], ahead[0]])
    tip, tail = middle + 13 * ahead, middle - 13 * ahead
    head = np.array([tip - 7 * ahead + 5 * side, tip, tip - 7 * ahead - 5 * side])
    return [np.array([tail, tip]), head], tip + 12 * ahead


def _draw_measurement(image: Image, at: Array, ring: Array) -> None:
    """Draw the mark of a measurement at a pixel (2,) with its 95 % ellipse, pixels (N, 2), in dashes."""
    for k in range(0, len(ring), 6):
        draw_outline(image, ring[k : k + 4], DETECTION, INK)
    draw_disc(image, at, 4.0, INK)
    draw_disc(image, at, 2.5, DETECTION)


def _draw_mapped_crown(image: Image, outline: Array) -> None:
    """Draw the mark of a crown that the UAV has mapped: its outline, pixels (N, 2), in dashes."""
    ring = np.vstack([outline, outline[:1]])
    far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
    for start in np.arange(0.0, far[-1], 14.0):
        at = np.linspace(start, min(start + 8.0, far[-1]), 3)
        dash = np.column_stack([np.interp(at, far, ring[:, axis]) for axis in range(2)])
        draw_outline(image, dash, TRUNK, PANEL)


def _draw_track(image: Image, at: Array, ring: Array, colour: Colour) -> None:
    """Draw the mark of a track at a pixel (2,) with its 95 % ellipse, pixels (N, 2)."""
    draw_outline(image, ring, colour, PANEL, closed=True)
    draw_cross(image, at, colour)


def _draw_truth(image: Image, outline: Array) -> None:
    """Draw the mark of a true person: the outline, pixels (N, 2)."""
    draw_outline(image, outline, INK, PANEL, closed=True)


def _draw_rim(image: Image, outlines: list[Array], *, hiding: bool = False) -> None:
    """Draw the mark of hidden ground: a rim outside of the union of outlines, pixels (N, 2).

    hiding: True for the broader rim of a tree that hides a person.
    """
    inside = np.zeros(image.shape[:2], dtype=np.uint8)
    for outline in outlines:
        cv2.fillPoly(inside, [to_fixed_point(outline)], 255, cv2.LINE_AA, SHIFT)
    for colour, reach in _RIMS[hiding]:
        grown = cv2.dilate(inside, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
        rim = grown > inside
        weight = (grown[rim] - inside[rim])[:, None] / np.float32(255)
        image[rim] = image[rim] * (1 - weight) + np.array(colour, dtype=np.float32) * weight + 0.5


_SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
_DETECTION, _MEASUREMENT, TRACK = "detection", "measurement, 95 % ellipse", "track, 95 % ellipse"
_TRUTH, _RIM, _HIDING_RIM = "truth: person", "rim of what trees hide", "tree that hides a person"
_MAPPED = "crown on the UAV's map"
_MARKS: dict[str, Mark] = {
    _DETECTION: lambda image, at: draw_detection(image, at, 10.0),
    _MEASUREMENT: lambda image, at: _draw_measurement(image, at, outline_ellipse(at, np.diag([50.0, 20.0]))),
    TRACK: lambda image, at: _draw_track(image, at, outline_ellipse(at, np.diag([50.0, 25.0])), track_colour(0)),
    _TRUTH: lambda image, at: _draw_truth(image, outline_ellipse(at, np.diag([20.0, 20.0]))),
    _MAPPED: lambda image, at: _draw_mapped_crown(image, outline_ellipse(at, np.diag([20.0, 20.0]))),
    _RIM: lambda image, at: _draw_rim(image, [at + 9.0 * _SQUARE]),
    _HIDING_RIM: lambda image, at: _draw_rim(image, [at + 7.0 * _SQUARE], hiding=True),
}


def find_marks(names: Iterable[str]) -> list[tuple[str, Mark]]:
    """The marks with these names, each with the function that draws it in a legend at a pixel (2,)."""
    return [(name, mark) for name, mark in _MARKS.items() if name in names]
