"""Trajectories of people: positions and headings at any time."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.trigonometry import arctan2_each

SAMPLES_PER_SECOND = 60
EXACT = 1e-6  # steps; a time that is nearer than this to a sample counts as the sample's


class PeoplePoses(NamedTuple):
    """Positions and headings of M people; NaN for those who are absent."""

    positions: Array  # (M, 2) m
    headings: Array  # (M,) rad from east


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Positions of M people at K uniformly spaced times, with linear interpolation in between."""

    times: Array  # (K,) s, K >= 2
    positions: Array  # (K, M, 2) m; NaN while a person is absent

    def at(self, time: float) -> PeoplePoses:
        """Positions and headings of all people at a time [s]."""
        first, second = self.times[:2].tolist()
        step = (time - first) / (second - first)
        between = abs(step - round(step)) > EXACT
        k = math.floor(step) if between else round(step)
        if not 0 <= k < len(self.times) - between:
            return PeoplePoses(np.full(self.positions.shape[1:], np.nan), np.full(self.positions.shape[1], np.nan))
        here = self.positions[k]
        headings = self._headings[k]
        if not between:
            return PeoplePoses(here.copy(), headings.copy())
        positions = here + (step - k) * (self.positions[k + 1] - here)
        return PeoplePoses(positions, np.where(np.isnan(positions[:, 0]), np.nan, headings))

    @cached_property
    def _headings(self) -> Array:
        """Direction (K, M) of the step after each sample; a standing person keeps the last direction."""
        steps = np.diff(self.positions, axis=0)
        headings = arctan2_each(steps[..., 1], steps[..., 0])
        headings[length(steps) < 1e-4] = np.nan
        headings = np.vstack([headings, np.full((1, headings.shape[1]), np.nan)])
        _keep_last(headings)
        headings[np.isnan(headings)] = 0.0
        return np.where(np.isnan(self.positions[..., 0]), np.nan, headings)


@compiled
def _keep_last(headings: Array) -> None:
    """Replace NaN in each column of headings (K, M) by the last number above it, if there is one, in place."""
    for k in range(1, len(headings)):
        for m in range(headings.shape[1]):
            if math.isnan(headings[k, m]):
                headings[k, m] = headings[k - 1, m]
