"""One camera's frame, enlarged, with what was detected, what is believed and what is true drawn over it."""

import cv2
import numpy as np

from sim.drawing.labels import Labels, track_name
from sim.drawing.lettering import Image, TextStyle, write
from sim.drawing.map_view import ellipse, looks_down
from sim.drawing.marks import cross, detection
from sim.drawing.palette import DETECTION, INK, PANEL, track_colour
from sim.drawing.strokes import SHIFT, disc, fixed, outlined, stroke
from sim.replay.frames.sightings import PERSON_RADIUS, Sight, Sighting, hidden_outlines, silhouette
from tracking.geometry.visibility import TARGET_HEIGHT, at_target_height
from tracking.numerics.arrays import Array

_LENGTHS = [base * 10.0**power for power in range(-1, 4) for base in (1, 2, 5)]  # m, of scale bars
_RIMS = {False: ((INK, 9), (PANEL, 5)), True: ((PANEL, 17), (INK, 13))}  # colours and reaches in pixels


def annotated(frame: Image, sight: Sight, size: int) -> Image:
    """The frame (P, P, 3) RGB as a larger square, with everything drawn.

    Its edge is the largest multiple of P within `size` pixels, so that each pixel of the camera is a square; a frame
    of more than `size` pixels is shrunk.
    """
    pixels = frame.shape[0]
    side = max(size // pixels * pixels, min(size, pixels))
    how = cv2.INTER_NEAREST if side >= pixels else cv2.INTER_AREA
    image = np.asarray(cv2.resize(frame, (side, side), interpolation=how), dtype=np.uint8)
    _View(image, sight).draw()
    return image


class _View:
    """Draws over the frame of one camera: marks first, then their names, clear of all marks."""

    def __init__(self, image: Image, sight: Sight) -> None:
        self._image, self._sight = image, sight
        self._scale = image.shape[0] / sight.camera.pixels
        self._labels = Labels(image)
        outlines = hidden_outlines(sight.camera, sight.pose, sight.forest)
        self._outlines = [[self._scale * part for part in tree] for tree in outlines]

    def draw(self) -> None:
        draw_rim(self._image, [part for tree in self._outlines for part in tree])
        people = [sighting for sighting in self._sight.people if sighting.inside or sighting.pixels]
        for tree in sorted({tree for sighting in people for tree in sighting.hidden_by}):
            draw_rim(self._image, self._outlines[tree], hiding=True)
        for sighting in people:
            outline = self._person(sighting)
            draw_truth(self._image, outline)
            self._labels.reserve(outline.mean(axis=0), float(np.ptp(outline, axis=0).max()) / 2)
        self._draw_measurements()
        self._draw_tracks()
        self._draw_scale()
        for sighting in people:
            self._name_person(sighting)
        self._name_tracks()
        self._name_trees()

    def _pixels(self, ground: Array) -> Array:
        """Pixels (N, 2) of points (N, 2) m at the height that stands for a person; NaN behind the camera."""
        return np.asarray(self._scale * self._sight.camera.project(self._sight.pose, at_target_height(ground))[0])

    def _person(self, sighting: Sighting) -> Array:
        body = np.array([*sighting.place, PERSON_RADIUS, 0.0, 2 * TARGET_HEIGHT])
        return np.asarray(self._scale * silhouette(self._sight.camera, self._sight.pose, body))

    def _draw_measurements(self) -> None:
        scan, detections = self._sight.snapshot.scans[self._sight.uav], self._sight.snapshot.pixels[self._sight.uav]
        for k, (z, R) in enumerate(zip(scan.measurements, scan.covariances, strict=True)):
            at, ring = self._pixels(z[None])[0], self._pixels(ellipse(z, R))
            if not np.all(np.isfinite(ring)):
                continue
            if len(detections):
                found = self._scale * detections[k]
                outlined(self._image, np.array([found, at]), DETECTION, INK)
                detection(self._image, found, max(5.0 * self._scale, 10.0))
            draw_measurement(self._image, at, ring)
            self._labels.reserve(at, 8.0)

    def _draw_tracks(self) -> None:
        for track in self._sight.snapshot.tracks[self._sight.uav]:
            mean, covariance = track.belief.mean[:2], track.belief.covariance[:2, :2]
            at, ring = self._pixels(mean[None])[0], self._pixels(ellipse(mean, covariance))
            if np.all(np.isfinite(ring)):
                draw_track(self._image, at, ring, track.id)
                self._labels.reserve(at, 10.0)

    def _name_person(self, sighting: Sighting) -> None:
        why = f": {sighting.status}" if sighting.status != "in view" else ""
        at = np.clip(self._person(sighting).mean(axis=0), 0, self._image.shape[0])
        self._labels.put(f"truth: person {sighting.person}{why}", at, TextStyle(13, INK, True, PANEL))

    def _name_tracks(self) -> None:
        for track in self._sight.snapshot.tracks[self._sight.uav]:
            at = self._pixels(track.belief.mean[None, :2])[0]
            if np.all(np.isfinite(at) & (at >= 0) & (at <= self._image.shape[0])):
                style = TextStyle(13, track_colour(track.id), True, PANEL)
                self._labels.put(f"track {track_name(track)}", at, style)

    def _name_trees(self) -> None:
        for tree, parts in enumerate(self._outlines):
            for part in parts[-1:]:  # the canopy, or the trunk where only that is in view
                shown = np.clip(part, 0, self._image.shape[0])
                middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
                self._labels.put(f"tree {tree}", middle, TextStyle(12, PANEL, False, INK))

    def _draw_scale(self) -> None:
        """A bar of a round length on the ground, and north, in the lower corners."""
        camera, pose, n = self._sight.camera, self._sight.pose, self._sight.camera.pixels
        corners = np.array([[0.04 * n, 0.96 * n], [0.34 * n, 0.96 * n], [0.96 * n, 0.96 * n]])
        if not looks_down(camera, pose, corners):
            return
        left, right, last = camera.ground_points(pose, corners)
        room = float(np.hypot(*(right - left)))
        length = max((m for m in _LENGTHS if m <= room), default=_LENGTHS[0])
        ends = np.array([left, left + length / room * (right - left)])
        self._draw_bar(self._scale * camera.project(pose, np.column_stack([ends, np.zeros(2)]))[0], f"{length:g} m")
        north = np.array([[*last, 0.0], [last[0], last[1] + 0.1, 0.0]])
        foot, tip = self._scale * camera.project(pose, north)[0]
        self._draw_north(foot, (tip - foot) / np.hypot(*(tip - foot)))

    def _draw_bar(self, ends: Array, text: str) -> None:
        ticks = [ends[k] + np.array([(0.0, -6.0), (0.0, 1.0)]) for k in (0, 1)]
        self._draw_lines(ends, *ticks)
        middle = ends.mean(axis=0)
        write(self._image, text, (middle[0], middle[1] - 14), TextStyle(13, PANEL, True, INK), align=0.5)
        self._labels.reserve(middle, float(np.hypot(*(ends[1] - ends[0]))) / 2)

    def _draw_north(self, foot: Array, ahead: Array) -> None:
        """An arrow of 26 pixels above a pixel (2,), along the image's unit vector `ahead` (2,)."""
        middle, side = foot - 26.0, np.array([-ahead[1], ahead[0]])
        tip, tail = middle + 13 * ahead, middle - 13 * ahead
        head = np.array([tip - 7 * ahead + 5 * side, tip, tip - 7 * ahead - 5 * side])
        self._draw_lines(np.array([tail, tip]), head)
        x, y = tip + 12 * ahead
        write(self._image, "N", (float(x), float(y)), TextStyle(13, PANEL, True, INK), align=0.5)
        self._labels.reserve(middle, 26.0)

    def _draw_lines(self, *lines: Array) -> None:
        for colour, thickness in ((INK, 5), (PANEL, 2)):
            for line in lines:
                stroke(self._image, line, colour, thickness=thickness)


def draw_measurement(image: Image, at: Array, ring: Array) -> None:
    """The mark of a measurement at a pixel (2,) with its 95 % ellipse, pixels (N, 2), in dashes."""
    for k in range(0, len(ring), 6):
        outlined(image, ring[k : k + 4], DETECTION, INK)
    disc(image, at, 4.0, INK)
    disc(image, at, 2.5, DETECTION)


def draw_track(image: Image, at: Array, ring: Array, track: int) -> None:
    """The mark of a track at a pixel (2,) with its 95 % ellipse, pixels (N, 2)."""
    outlined(image, ring, track_colour(track), PANEL, closed=True)
    cross(image, at, track_colour(track))


def draw_truth(image: Image, outline: Array) -> None:
    """The mark of a true person: their outline, pixels (N, 2)."""
    outlined(image, outline, INK, PANEL, closed=True)


def draw_rim(image: Image, outlines: list[Array], *, hiding: bool = False) -> None:
    """The mark of ground that trees hide: a rim round the union of outlines, pixels (N, 2), that covers none of it.

    hiding: a broader rim, of a tree that hides a person.
    """
    inside = np.zeros(image.shape[:2], dtype=np.uint8)
    for outline in outlines:
        cv2.fillPoly(inside, [fixed(outline)], 255, cv2.LINE_AA, SHIFT)
    for colour, reach in _RIMS[hiding]:
        grown = cv2.dilate(inside, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
        rim = grown > inside
        weight = (grown[rim] - inside[rim])[:, None] / np.float32(255)
        image[rim] = image[rim] * (1 - weight) + np.array(colour, dtype=np.float32) * weight + 0.5
