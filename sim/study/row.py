"""Result of one trial of a study."""

from typing import Literal

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from tracking.numerics.arrays import Array


class Row(Struct, frozen=True, kw_only=True, eq=False):
    """One trial: where in the study it stands, what reproduces it, and its results."""

    study: str
    scenario: str  # name, or .toml file
    factors: tuple[tuple[str, str], ...]  # what varies by cell, as shown: (("lambda", "45"), ("R", "5"))
    planner: str  # as --planner takes it
    seed: int
    repeat: int = 0  # of the chance on the seed's map
    version: str  # of the package
    status: Literal["done", "failed"]
    error: str = ""
    metrics: dict[str, float]  # flat names, as in docs/how-to/studies.md; NaN: undefined
    ospa: NDArray[np.float32]  # (T,) m at each scan, mean over the UAVs that work; NaN if none does
    times: Array  # (T,) s
    recording: str = ""  # SHA-256 of its file, wherever it was flown; empty if it failed
    machine: str = ""  # that flew it: processor and BLAS
    settings: dict[str, str]  # overrides: `understory run SCENARIO --set key=value ... --planner ... --seed ...`
