"""Crossing people keep their tracks, and Stone Soup's JPDA does no better on the same scans.

`pytest -m slow -s tests/tracking/test_crossings.py -n 0` tries 1000 crossings and prints the figures of
docs/results/benchmarks.md.
"""

import numpy as np
import pytest
from helpers.crossings import HARD, WHOLE, Crossing, kept, mean_ospa, ours, theirs, track_deviation

CASES = {"association alone": (HARD, 1e-4), "whole tracker": (WHOLE, 0.0)}


def compare(case: str, count: int) -> None:
    crossings = [Crossing(seed, *CASES[case]) for seed in range(count)]
    histories = [(ours(c), theirs(c)) for c in crossings]
    identities = np.array([[kept(c, h[-1]) for h in pair] for c, pair in zip(crossings, histories, strict=True)])
    distances = np.array([[mean_ospa(c, h) for h in pair] for c, pair in zip(crossings, histories, strict=True)])
    # Two standard deviations of the position, per axis, of a lone person's track: what two tracks can tell apart.
    apart = np.array([c.closest > 2 * track_deviation() for c in crossings])
    print(f"\n{case}: {count} crossings, {apart.sum()} of them more than {2 * track_deviation():.2f} m apart")
    print("identity kept, ours and theirs: apart {} %, nearer {} %".format(*shares(identities, apart)))
    print("mean OSPA [m], ours and theirs: {:.6f} {:.6f}".format(*distances.mean(axis=0)))
    assert identities[apart, 0].mean() >= 0.97
    assert identities[:, 0].sum() >= identities[:, 1].sum()
    assert np.all(distances[:, 0] <= distances[:, 1] + 1e-6)


def shares(identities: np.ndarray, apart: np.ndarray) -> list[np.ndarray]:
    return [np.round(100 * identities[rows].mean(axis=0), 1) for rows in (apart, ~apart)]


@pytest.mark.parametrize("case", CASES)
def test_some_crossing_people_keep_their_tracks_and_stone_soup_does_no_better(case):
    compare(case, 10)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_thousand_crossing_people_keep_their_tracks_and_stone_soup_does_no_better(case):
    compare(case, 1000)


def test_fifty_crossings_with_false_alarms_keep_identity():
    crossings = [Crossing(seed, *CASES["association alone"]) for seed in range(50)]
    apart = [c for c in crossings if c.closest > 2 * track_deviation()]
    assert np.mean([kept(c, ours(c)[-1]) for c in apart]) >= 0.97
    assert len(apart) > 25
