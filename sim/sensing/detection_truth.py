"""Detections against what the renderer really showed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from tracking.numerics.compiled import Array

GATE = 3.0  # pixels from a detection to the nearest pixel of the person it may stand for


def visible_pixels(people: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Pixels (M,) that each of `count` people has in a segmentation (P, P)."""
    return np.bincount(people[people >= 0], minlength=count).astype(np.int64)


def matched_people(pixels: Array, people: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """Which of `count` people (M,) the detections (N, 2) at pixels (u, v) found, each detection at most one."""
    return np.asarray(matched_detections(pixels, people, count) >= 0, dtype=np.bool_)


def matched_detections(pixels: Array, people: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Which of the detections (N, 2) at pixels (u, v) found each of `count` people (M,); -1 for none.

    people (P, P): whose each pixel of the image is, -1 for nobody's. A detector may place whom the edge cuts
    outside the image; what counts then is the nearest place inside.
    """
    found = np.full(count, -1)
    rows, columns = np.nonzero(people >= 0)
    if len(rows) == 0 or len(pixels) == 0:
        return found
    inside = np.clip(pixels, 0.0, people.shape[::-1])
    gap = np.sqrt(np.square(inside[:, :1] - (columns + 0.5)) + np.square(inside[:, 1:] - (rows + 0.5)))
    owners = people[rows, columns]
    nearest = np.full((len(pixels), count), np.inf)
    for person in np.unique(owners):
        nearest[:, person] = gap[:, owners == person].min(axis=1)
    far = GATE * (len(pixels) + 1)  # dearer than all pairs within the gate: as many pairs as there can be
    detections, persons = linear_sum_assignment(np.where(nearest <= GATE, nearest, far))
    close = nearest[detections, persons] <= GATE
    found[persons[close]] = detections[close]
    return found
