"""OSPA, OSPA(2) and GOSPA: by hand, against enumeration and Stone Soup."""

import datetime
import itertools
import math
import re
import tracemalloc

import numpy as np
import pytest
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.state import State

from tracking.metrics.ospa import gospa, ospa, ospa2

NONE = np.zeros((0, 2))
NOON = datetime.datetime(2024, 1, 1, 12)


def brute_force(X, Y, distance, c: float, p: float) -> float:
    """Schuhmacher's definition, permutation by permutation, of two lists and the cut-off distance of their members."""
    few, many = sorted((list(X), list(Y)), key=len)
    if not many:
        return 0.0
    best = min(
        sum(distance(x, many[j]) ** p for x, j in zip(few, order, strict=False))
        for order in itertools.permutations(range(len(many)))
    )
    return ((best + c**p * (len(many) - len(few))) / len(many)) ** (1 / p)


@pytest.mark.parametrize(
    ("distance", "estimates", "truths", "expected"),
    [
        (ospa, NONE, NONE, (0, 0, 0)),
        (ospa, NONE, [[1, 2]], (50, 0, 50)),
        (ospa, [[1, 2]], NONE, (50, 0, 50)),
        (ospa, [[3, 4]], [[0, 0]], (5, 5, 0)),
        (ospa, [[300, 400]], [[0, 0]], (50, 50, 0)),
        # Pairs 3 m and 4 m apart, in the other order: sqrt((9 + 16) / 2).
        (ospa, [[10, 4], [0, 0]], [[0, 3], [10, 0]], (math.sqrt(12.5), math.sqrt(12.5), 0)),
        # One pair 6 m apart, one missing: sqrt((36 + 2500) / 2).
        (ospa, [[6, 0]], [[0, 0], [0, 40]], (math.sqrt(1268), math.sqrt(18), math.sqrt(1250))),
        # All four found within 0 m but one ghost among five: sqrt(2500 / 5).
        (ospa, [[0, 0], [9, 0], [0, 9], [9, 9], [5, 5]], [[9, 9], [0, 9], [9, 0], [0, 0]], (500**0.5, 0, 500**0.5)),
        (gospa, NONE, NONE, (0, 0, 0, 0)),
        (gospa, NONE, [[1, 2]], (math.sqrt(50), 0, math.sqrt(50), 0)),
        (gospa, [[1, 2]], NONE, (math.sqrt(50), 0, 0, math.sqrt(50))),
        (gospa, [[3, 4]], [[0, 0]], (5, 5, 0, 0)),
        # At the cut-off an estimate is not of the truth: one false, one missed.
        (gospa, [[10, 0]], [[0, 0]], (10, 0, math.sqrt(50), math.sqrt(50))),
        # One pair 6 m apart, one missed, one false 100 m off.
        (gospa, [[6, 0], [99, 99]], [[0, 0], [0, 40]], (math.sqrt(136), 6, math.sqrt(50), math.sqrt(50))),
    ],
)
def test_ospa_and_gospa_match_hand_computed_values(distance, estimates, truths, expected):
    np.testing.assert_allclose(distance(np.array(estimates, float), np.array(truths, float)), expected, rtol=1e-14)


def test_by_default_trajectories_have_the_cut_off_and_order_of_places():
    """Of three people two are tracked, 30 m and 80 m off; a mean over instants is that of each of them."""
    people, tracks = np.array([[0.0, 0], [0, 500], [500, 0]]), np.array([[30.0, 0], [80, 500]])
    expected = ospa(tracks, people)
    assert expected.distance == pytest.approx(math.sqrt((30**2 + 2 * 50**2) / 3), rel=1e-14)
    np.testing.assert_allclose(ospa2(np.stack([tracks] * 4), np.stack([people] * 4)), expected, rtol=1e-14)


def test_trajectories_are_of_the_same_times_and_in_the_plane():
    with pytest.raises(ValueError, match=r"must be \(K, A, 2\) and \(K, B, 2\), are \(3, 1, 2\) and \(4, 1, 2\)"):
        ospa2(np.zeros((3, 1, 2)), np.zeros((4, 1, 2)))
    with pytest.raises(ValueError, match=r"must be \(K, A, 2\) and \(K, B, 2\), are \(3, 1, 4\) and \(3, 1, 4\)"):
        ospa2(np.zeros((3, 1, 4)), np.zeros((3, 1, 4)))


def random_pairs(count, seed=0):
    """Sets of up to six points, cut-offs and orders: whole numbers, as their powers are exact in Stone Soup too."""
    rng = np.random.default_rng(seed)
    while count:
        X, Y = (rng.uniform(-40, 40, (rng.integers(0, 7), 2)) for _ in range(2))
        if len(X) + len(Y):  # of two empty sets Stone Soup knows no time
            yield X, Y, float(rng.integers(1, 60)), float(rng.integers(1, 4))
            count -= 1


def states(points):
    return [State(point, NOON) for point in points]


def test_ospa_equals_stone_soup_on_1000_random_pairs():
    """Stone Soup 1.9.1 pairs by distance and not by its power, so with p > 1 it is given powers to pair by."""
    plainly = 0
    for X, Y, c, p in random_pairs(1000):
        ours = ospa(X, Y, c, p).distance
        powers = OSPAMetric(c=c**p, p=1, measure=lambda a, b, p=p: np.linalg.norm(a.state_vector - b.state_vector) ** p)
        theirs = powers.compute_OSPA_distance(states(X), states(Y)).value ** (1 / p)
        assert ours == pytest.approx(theirs, rel=1e-12, abs=1e-12)
        plain = OSPAMetric(c=c, p=p).compute_OSPA_distance(states(X), states(Y)).value
        assert ours <= plain + 1e-12
        plainly += ours == pytest.approx(plain, rel=1e-12, abs=1e-12)
        assert p > 1 or plain == pytest.approx(ours, rel=1e-12, abs=1e-12)
    assert plainly > 900


def test_gospa_and_its_parts_equal_stone_soup_on_1000_random_pairs():
    for X, Y, c, p in random_pairs(1000, seed=1):
        theirs = GOSPAMetric(c=c, p=p).compute_gospa_metric(states(X), states(Y))[0].value
        ours = gospa(X, Y, c, p)
        assert ours.distance == pytest.approx(theirs["distance"], rel=1e-12, abs=1e-12)
        for name in ("localisation", "missed", "false"):
            assert getattr(ours, name) ** p == pytest.approx(theirs[name], rel=1e-11, abs=1e-9)


def random_trajectories(rng, instants=4, most=4):
    paths = rng.uniform(-30, 30, (instants, int(rng.integers(0, most + 1)), 2))
    paths[rng.random(paths.shape[:2]) < 0.3] = np.nan
    return paths


def apart(f, g, c):
    """Mean distance of two trajectories (K, 2), instant by instant."""
    distances = []
    for a, b in zip(f, g, strict=True):
        there = (not math.isnan(a[0])) + (not math.isnan(b[0]))
        if there:
            distances.append(min(c, math.dist(a, b)) if there == 2 else c)
    return sum(distances) / len(distances)


def present(paths):
    """The trajectories (K, 2) that are there at any instant."""
    return [path for path in np.moveaxis(paths, 1, 0) if not np.all(np.isnan(path))]


@pytest.mark.parametrize("p", [1.0, 2.0])
def test_ospa2_equals_enumeration_of_all_pairings(p):
    rng = np.random.default_rng(2)
    for _ in range(150):
        X, Y, c = random_trajectories(rng), random_trajectories(rng), float(rng.uniform(5, 60))
        best = brute_force(present(X), present(Y), lambda f, g, c=c: apart(f, g, c), c, p)
        assert ospa2(X, Y, c, p).distance == pytest.approx(best, rel=1e-12, abs=1e-12)


def test_an_infinite_order_is_the_limit_and_equals_enumeration_of_all_pairings():
    """Of each pairing the farthest pair counts; as few pairs as possible reach the cut-off."""
    for X, Y, c, _ in random_pairs(300, seed=3):
        few, many = sorted((X, Y), key=len)
        gaps = np.minimum(np.linalg.norm(few[:, None] - many[None], axis=2), c)
        orders = itertools.permutations(range(len(many)), len(few))
        pairings = [np.array([gaps[i, j] for i, j in enumerate(order)]) for order in orders]
        best = min(pairings, key=lambda pairing, c=c: (np.sum(pairing == c), pairing[pairing < c].max(initial=0)))
        near, lacking = best[best < c], len(many) > len(few)
        assert ospa(X, Y, c, math.inf) == (c if lacking else best.max(initial=0), best.max(initial=0), c * lacking)
        paths = ospa2(X[None], Y[None], c, math.inf)
        np.testing.assert_allclose(paths, ospa(X, Y, c, math.inf), rtol=1e-14)
        left = c * (len(Y) > len(near)), c * (len(X) > len(near))
        assert gospa(X, Y, c, math.inf) == (max(near.max(initial=0), *left), near.max(initial=0), *left)
    assert ospa(NONE, NONE, 50, math.inf) == (0, 0, 0) and gospa(NONE, NONE, 10, math.inf) == (0, 0, 0, 0)
    # Nearest in sum are 0 and 3 m, nearest at the farthest 2 and 2 m.
    assert ospa([[0, 0], [2, 0]], [[2, 0], [0, 2]], 50, math.inf).distance == 2


@pytest.mark.parametrize("distance", [ospa, gospa])
@pytest.mark.parametrize("wrong", [[0.0, 0.0], [[0, 0, 0]]])
def test_positions_of_other_shapes_are_refused(distance, wrong):
    shape = re.escape(str(np.shape(wrong)))
    for name, sets in (("estimates", (wrong, NONE)), ("truths", (NONE, wrong))):
        with pytest.raises(ValueError, match=f"^{name} must be \\(A, 2\\), are {shape}$"):
            distance(*sets)
    assert distance([], np.zeros((0, 4))).distance == 0.0


@pytest.mark.parametrize("distance", [ospa, gospa])
def test_positions_that_are_not_finite_are_named(distance):
    for name, sets in (("estimates", ([[0, 0], [math.nan, 1]], NONE)), ("truths", (NONE, [[0, 0], [1, math.inf]]))):
        with pytest.raises(ValueError, match=rf"^{name}\[1\] is not finite; leave absent ones out$"):
            distance(*sets)


@pytest.mark.parametrize(("c", "p"), [(0.0, 2.0), (50.0, 0.5), (math.nan, 2.0), (50.0, 11.0), (50.0, -math.inf)])
def test_a_cut_off_or_order_without_meaning_is_refused(c, p):
    for distance, nothing in ((ospa, NONE), (gospa, NONE), (ospa2, NONE[None])):
        with pytest.raises(ValueError, match="c must be from 1e-9 to 1e9 and p from 1 to 10 or infinite"):
            distance(nothing, nothing, c, p)


def test_ospa2_of_a_long_mission_takes_little_memory_and_is_the_same(monkeypatch):
    rng = np.random.default_rng(0)
    X, Y = (rng.normal(0.0, 20.0, (2000, count, 2)) for count in (60, 50))
    for Z in (X, Y):
        Z[rng.random(Z.shape[:2]) < 0.3] = np.nan
    tracemalloc.start()
    whole = ospa2(X, Y)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5e8  # at once it would be 2.7e8
    monkeypatch.setattr("tracking.metrics.ospa._AT_ONCE", 77_777)
    np.testing.assert_allclose(ospa2(X, Y), whole, rtol=1e-13)
