"""Unseen ground: the trees that may stand where a UAV has not looked yet, given how much of what it saw is open."""

import math

import numpy as np

from tracking.geometry.line_of_sight import Raster
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import log

# Gap fraction before any ground has been seen, which counts as much as so much seen ground [m²]: between those of the
# default forest (0.76) and of the densest one in our studies (0.61).
PRIOR_GAP, PRIOR_AREA = 0.7, 500.0
_LEAST_GAP = 0.01  # of a grove wall to wall


def find_gap_fraction(ground: Raster) -> float:
    """Gap fraction to expect of unseen ground: that of seen ground, which is 1 if open, 0 under crowns, NaN unseen."""
    seen = ground.values[~np.isnan(ground.values)]
    area = ground.cell[0] * ground.cell[1]
    gaps = area * float(np.cumsum([0.0, *seen])[-1])
    return max((PRIOR_GAP * PRIOR_AREA + gaps) / (PRIOR_AREA + area * len(seen)), _LEAST_GAP)


def expect_unseen_trees(ground: Raster, radius: float) -> Raster:
    """Number per m² of trees with crowns of one radius [m] in each cell of ground as of `find_gap_fraction`.

    They are a Poisson process on unseen ground, but not so near open ground that their crowns would cover it. Their
    number λ per m² has λ π r² = -log g, so that far from seen ground they leave a vertical line of sight free with the
    probability g, the gap fraction. `Forest.unknown` takes the result. Cells of one to two metres are fine enough.
    Source: [Hall88] for Boolean models.
    """
    density = -log(find_gap_fraction(ground)) / (math.pi * radius * radius)
    near = average_within(ground._replace(values=np.where(ground.values == 1.0, 1.0, 0.0)), radius)
    stand = np.isnan(ground.values) & (near.values == 0.0)
    return ground._replace(values=np.where(stand, density, 0.0))


def average_within(raster: Raster, radius: float) -> Raster:
    """Mean of a raster within a radius [m] of the middle of each cell; outside the raster values are 0."""
    (width, height), far = raster.cell, radius * (1.0 + 1e-9)
    x, y = (np.arange(-int(far / side), int(far / side) + 1) for side in (width, height))
    rows, columns = np.nonzero(np.square(height * y[:, None]) + np.square(width * x) <= far * far)
    return raster._replace(values=_average(raster.values, y[rows], x[columns]))


@compiled
def _average(values: Array, rows: Indices, columns: Indices) -> Array:
    """Means (R, C) of the values at offsets `rows` (N,) and `columns` (N,) from each cell."""
    out = np.zeros(values.shape)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            for n in range(len(rows)):
                row, column = i + rows[n], j + columns[n]
                if 0 <= row < values.shape[0] and 0 <= column < values.shape[1]:
                    out[i, j] += values[row, column]
            out[i, j] /= len(rows)
    return out
