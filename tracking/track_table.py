"""Confirmed tracks of one UAV as a table with a row for each."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from tracking.numerics.arrays import Array, Flags, Indices


@dataclass(frozen=True, eq=False)
class TrackTable:
    """Columns of T tracks; `table[rows]` has some of them, `table + other` those of both."""

    ids: Indices  # (T,)
    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    existence: Array  # (T,) probabilities
    weights: Array  # (T,) of beliefs in the fleet's average
    times: Array  # (T, 3) s: last detection by the fleet, last scan with the person in view, and last sure detection
    misses: Indices  # (T,), bit k is set if the k-th last scan that counts was a miss
    sightings: Array  # (T, 3) position [m] and time [s] of the fleet's last sure detection of each

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, rows: Indices | Flags) -> TrackTable:
        return TrackTable(*(column[rows] for column in _COLUMNS(self)))

    def __add__(self, other: TrackTable) -> TrackTable:
        return TrackTable(*map(np.concatenate, zip(_COLUMNS(self), _COLUMNS(other), strict=True)))


_COLUMNS = attrgetter(*TrackTable.__dataclass_fields__)
