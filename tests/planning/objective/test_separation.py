"""UAVs keep apart where they are told to."""

import dataclasses

import numpy as np
import pytest

from planning.loading import load_planner
from planning.objective.terms import Separation, _closest
from planning.prediction.intent import camera_paths


def level(team, places):
    """The team at one height, at these places (n, 2) m."""
    fleet = [dataclasses.replace(s.own, position=np.array([*p, 19.0])) for s, p in zip(team, places, strict=True)]
    return [
        dataclasses.replace(s, own=v, neighbours=tuple(w for w in fleet if w is not v))
        for s, v in zip(team, fleet, strict=True)
    ]


def nearest(team, plans):
    """Least distance [m] at any time between UAVs that fly straight from step to step."""
    now = np.array([s.own.position for s in team])
    way = np.concatenate([now[:, None], camera_paths(now, np.array([p.controls for p in plans]), 1.0)], axis=1)
    times = np.linspace(0, way.shape[1] - 1, 2001)
    flown = np.array([[np.interp(times, np.arange(way.shape[1]), w[:, axis]) for axis in range(3)] for w in way])
    pairs = [np.linalg.norm(flown[i] - flown[j], axis=0).min() for i in range(len(flown)) for j in range(i)]
    return min(pairs)


def test_the_closest_approach_between_steps_is_that_of_straight_flight():
    rng = np.random.default_rng(0)
    relative = rng.normal(size=(30, 4, 3)) * 4
    s = np.linspace(0, 1, 4001)[:, None, None, None]
    sampled = np.linalg.norm((1 - s) * relative[:, :-1] + s * relative[:, 1:], axis=-1).min(axis=0)
    np.testing.assert_allclose(_closest(relative), sampled, atol=2e-3)


@pytest.mark.parametrize("coordination", ["sequential", "centralised"])
def test_planned_paths_stay_the_separation_apart(random_team, coordination):
    crowded = 0
    for seed in range(4):
        team = level(random_team(seed, targets=2, spread=6.0), [(-15.0, 0.0), (0.0, 12.0), (15.0, 0.0)])
        free = load_planner(f"sma-nbo-mwtp(coordination={coordination})").plan(team, np.random.default_rng(seed))
        kept = load_planner(f"sma-nbo-mwtp(coordination={coordination}, separation=5)")
        assert nearest(team, kept.plan(team, np.random.default_rng(seed))) >= 5.0 - 1e-3
        crowded += nearest(team, free) < 5.0
    assert crowded >= 2


def test_height_counts_as_distance(random_team):
    """UAVs 2 m above one another keep 1.9 m whatever they do."""
    team = random_team(0)
    uavs = [dataclasses.replace(s.own, position=np.array([0.0, 0.0, 15.0 + 2.0 * s.own.id])) for s in team]
    team = [
        dataclasses.replace(s, own=u, neighbours=tuple(w for w in uavs if w is not u))
        for s, u in zip(team, uavs, strict=True)
    ]
    plain = load_planner("sma-nbo-mwtp").plan(team, np.random.default_rng(0))
    apart = load_planner("sma-nbo-mwtp(separation=1.9)").plan(team, np.random.default_rng(0))
    for plan, other in zip(apart, plain, strict=True):
        np.testing.assert_array_equal(plan.controls, other.controls)


def test_where_uavs_are_too_near_the_plan_that_parts_them_soonest_costs_least(random_team):
    team = level(random_team(1, uavs=2), [(0.0, 0.0), (1.0, 0.0)])
    still, away, toward = np.zeros((1, 2, 2)), np.full((1, 2, 2), [-5.0, 0.0]), np.full((1, 2, 2), [0.5, 0.0])
    cost = Separation(4.0).term(team[0], np.zeros((2, 2, 2)), [0])(np.array([still, away, toward]))
    # The first step starts 1 m off in any case; the second 1 m, 6 m and 0.5 m off.
    np.testing.assert_allclose(cost, [6e6, 3e6, 3.5e6 + 4e6], rtol=1e-9)
