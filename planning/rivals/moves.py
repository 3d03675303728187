"""Sequences of a few controls, and the places that they reach."""

from functools import cache
from typing import NamedTuple

import numpy as np

from planning.optimizers.grid_search import GridSearch
from tracking.numerics.arrays import Array, Indices


class Moves(NamedTuple):
    """Places in reach by sequences of a few controls; sequences that lead to one place at one time share it."""

    controls: Array  # (A, 2): shares of the top speed
    places: Array  # (M, 2): displacements from the start, in steps at top speed; by ascending step
    steps: Indices  # (M,): the step after which the UAV is there, from 0
    onward: Indices  # (M + 1, A): index of the place to which a control leads; last, from the start; -1: too far ahead


@cache
def make_moves(horizon: int, directions: int) -> Moves:
    """Moves of `horizon` steps; in each the UAV hovers, or flies at top speed in one of `directions` directions."""
    controls = GridSearch(directions).controls(1.0)
    places: list[Array] = []
    steps: list[int] = []
    onward: dict[int, list[int]] = {}
    before = {-1: np.zeros(2)}
    for step in range(horizon):
        now: dict[tuple[int, ...], int] = {}
        for place, way in before.items():
            onward[place] = []
            for reached in way + controls:
                key = tuple(np.round(1e6 * reached).astype(int).tolist())
                if key not in now:
                    now[key] = len(places)
                    places.append(reached)
                    steps.append(step)
                onward[place].append(now[key])
        before = {place: places[place] for place in now.values()}
    onward |= {place: [-1] * len(controls) for place in before}
    rows = [onward[place] for place in (*range(len(places)), -1)]
    return Moves(controls, np.array(places), np.array(steps), np.array(rows))
