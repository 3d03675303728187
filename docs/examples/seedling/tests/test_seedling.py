"""The seedling keeps to what planners must, shares out people, and its training repeats."""

import csv
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from seedling.planner import Seedling
from seedling.train import OTHERS, TRAINED, VALIDATED, Flight, Training, main, train, utilities
from seedling.weights import LEARNED, SIZE, hand_set, load, packed, unpacked

from planning.conformance.checks import check
from planning.conformance.situations import random_team
from tracking.numerics.arrays import Array

TINY = ["--population", "4", "--missions", "2", "--duration", "2", "--every", "0"]


def test_it_conforms() -> None:
    """As `understory check-planner seedling` says."""
    for finding in check("seedling.planner:Seedling"):
        assert finding.passed, finding


def test_two_uavs_do_not_fly_to_the_same_one_of_two_people() -> None:
    """Each person is nearer to a UAV after the step than before, and by another UAV."""
    team = random_team(5, uavs=2, targets=2, trees=0)
    places = np.array([[0.0, 30.0], [0.0, -30.0]])
    tracks = tuple(
        replace(track, belief=replace(track.belief, mean=np.array([*place, 0.0, 0.0])))
        for track, place in zip(team[0].tracks, places, strict=True)
    )
    fleet = [replace(s.own, position=np.array([x, 1.0, 20.0])) for s, x in zip(team, (-4.0, 4.0), strict=True)]
    team = [
        replace(s, own=v, neighbours=tuple(w for w in fleet if w is not v), tracks=tracks)
        for s, v in zip(team, fleet, strict=True)
    ]
    plans = Seedling().plan(team, np.random.default_rng(0))
    north = [float(plan.controls[0, 1]) for plan in plans]
    assert min(north) < -2.0 and max(north) > 2.0


def test_two_generations_give_the_same_bytes_twice_and_other_ones_of_another_seed(tmp_path: Path) -> None:
    """Nor does it matter how many processes fly."""
    runs: dict[str, list[str]] = {"one": [], "two": [], "more": ["--workers", "2"], "other": ["--seed", "1"]}
    for name, options in runs.items():
        main([*TINY, "--generations", "2", "--out", str(tmp_path / f"{name}.npz"), *options])
    one, two, more, other = ((tmp_path / f"{name}.npz").read_bytes() for name in runs)
    assert one == two == more != other
    with (tmp_path / "one.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["generation"] for row in rows] == ["1", "2"]
    assert all(0.0 < float(row["least"]) <= float(row["cost"]) for row in rows)
    moved = packed(load(tmp_path / "one.npz")) - hand_set(0)
    assert 0.0 < np.abs(moved).max() < 1.0
    Seedling(str(tmp_path / "one.npz"))


def test_weights_move_towards_what_costs_less() -> None:
    """The best of four has the highest utility, the worst the lowest."""
    np.testing.assert_array_equal(utilities(np.array([3.0, 1.0, 2.0, 9.0])), np.array([-0.5, 1.5, 0.5, -1.5]) / 4)


def test_training_finds_weights_that_each_map_only_hints_at() -> None:
    """The mean of the maps' optima, of which each generation sees four, is come near to."""
    rng = np.random.default_rng(3)
    start, best, scale = hand_set(0), hand_set(0) + rng.normal(0.0, 0.25, SIZE), rng.exponential(1.0, SIZE) ** 2

    def error(weights: Array, optimum: Array) -> float:
        return float((scale * np.square(weights - optimum)).sum())

    def fly(cost: object, flights: Iterable[Flight]) -> list[float]:
        return [error(f.weights, best + np.random.default_rng(f.seed).normal(0.0, 0.3, SIZE)) for f in flights]

    found = train(Training(generations=60, every=0), fly, start, lambda told, weights: None)
    assert error(found, best) < 0.3 * error(start, best)


def test_maps_of_training_validation_and_reports_are_apart() -> None:
    """Each generation flies new maps."""
    maps = [where for generation in range(1000) for where in Training().maps(generation)]
    seeds = [seed for _, seed in maps]
    assert len(set(seeds)) == len(seeds) and TRAINED <= min(seeds) and max(seeds) < VALIDATED
    assert {name for name, _ in maps} == {"forest", *OTHERS}


def test_the_learned_weights_are_small_and_pack_without_loss() -> None:
    """The file is far below a megabyte."""
    flat = packed(load(LEARNED))
    assert len(flat) == SIZE < 1000 and LEARNED.stat().st_size < 100_000
    np.testing.assert_array_equal(packed(unpacked(flat)), flat)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    """The error names what the file holds."""
    np.savez(tmp_path / "other.npz", table=np.zeros(3))
    with pytest.raises(ValueError, match="holds table; expected track_linear"):
        Seedling(str(tmp_path / "other.npz"))
