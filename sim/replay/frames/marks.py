"""Marks in annotated frames: detections, measurements, tracks, true people, and what trees hide."""

from __future__ import annotations

import cv2
import numpy as np

from sim.drawing.lettering import Image
from sim.drawing.marks import cross
from sim.drawing.palette import DETECTION, INK, PANEL, track_colour
from sim.drawing.strokes import disc, outlined
from tracking.numerics.arrays import Array

_RIMS = {False: ((INK, 9), (PANEL, 5)), True: ((PANEL, 17), (INK, 13))}  # colours and reaches in pixels


def draw_detection(image: Image, at: Array, reach: float) -> None:
    """The mark of what the detector found at a pixel (2,), as in the film: a ring of radius `reach` pixels."""
    disc(image, at, reach, INK, 4)
    disc(image, at, reach, DETECTION, 2)


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
        cv2.fillPoly(inside, [np.round((outline - 0.5) * 16).astype(np.int32)], 255, cv2.LINE_AA, 4)
    for colour, reach in _RIMS[hiding]:
        grown = cv2.dilate(inside, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
        rim = grown > inside
        weight = (grown[rim] - inside[rim])[:, None] / np.float32(255)
        image[rim] = image[rim] * (1 - weight) + np.array(colour, dtype=np.float32) * weight + 0.5
