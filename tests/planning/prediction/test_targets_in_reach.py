"""Targets in reach of a search, and searches that use them."""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.nominal import nominal, squares
from helpers.teams import at_once

from planning.objective.nbo import make_objective
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.mutations import draw_chances, mutate_plans
from planning.prediction.response import Response, mean_velocities
from planning.prediction.targets_in_reach import NO_TARGETS, TargetsInReach, find_targets_in_reach
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest

SPEED = np.array([5.0])


def shown(vehicle, places, point):
    """True if the camera has the point in view from any of the places (N, 2): the point moves instead of it."""
    moved = np.column_stack([point[:2] + vehicle.position[:2] - places, np.full(len(places), point[2])])
    return vehicle.camera.sees(Pose(vehicle.position, vehicle.attitude), moved).any()


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
def test_sights_are_what_can_be_in_view_in_time(random_team, step):
    rng, listed = np.random.default_rng(1), 0
    for seed in range(6):
        situation = random_team(seed, targets=5, spread=35.0)[1]
        situation = dataclasses.replace(situation, motion=NearlyConstantVelocity(step, 0.5))
        view, own = nominal(situation, 3), situation.vehicles[1]
        found = find_targets_in_reach(view, [1], SPEED, at_once(1))
        got = {
            (h, *np.round(place * step + own.position[:2], 6))
            for h, place in zip(found.steps, found.places, strict=True)
        }
        listed += len(got)
        for h in range(3):
            angles, radii = rng.uniform(0, 2 * np.pi, 3000), np.sqrt(rng.uniform(0, 1, 3000)) * SPEED * (h + 1) * step
            around = own.position[:2] + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
            for point in view.points[h, :, 0]:
                if shown(own, around, point):
                    assert (h, *np.round(point[:2], 6)) in got
                elif (h, *np.round(point[:2], 6)) in got:  # in reach by less than chance finds
                    gaps = np.abs(point[:2] - own.position[:2]) - (own.position[2] - point[2]) * np.tan(np.pi / 6)
                    assert 0.9 < np.linalg.norm(np.maximum(gaps, 0.0)) / (SPEED[0] * (h + 1) * step) <= 1.0
    assert 10 < listed < 6 * 15
    assert [len(column) for column in (*NO_TARGETS[:4], *NO_TARGETS.response)] == [0] * 7


LAGGING = Response(np.array([[1.0, -1.0]]), np.array([0.4]), np.array([0.2]))


@pytest.mark.parametrize(
    ("response", "speed"), [(at_once(1), 5.0), (LAGGING, 5.0), (LAGGING, 100.0)], ids=["at once", "lag", "lag, fast"]
)
def test_a_mutation_brings_its_target_into_view_or_keeps_the_paths_end(response, speed):
    """A target 12 m beside the UAV after the second of four steps; the view reaches 5 m."""
    one = TargetsInReach(np.array([0]), np.array([1]), np.array([[12.0, 3.0]]), squares([5.0]), response)
    rng = np.random.default_rng(0)
    parents = rng.uniform(-2.0, 2.0, (4, 1, 4, 2))
    children = mutate_plans(parents, draw_chances(rng, 800, parents), 0.3, np.array([speed]), one)
    assert np.linalg.norm(children, axis=-1).max() <= speed * (1 + 1e-12)
    before = np.repeat(np.cumsum(parents, axis=2)[:, 0], 200, axis=0)[:, -1]
    after, flown = (np.cumsum(v, axis=2)[:, 0] for v in (children, mean_velocities(response, children)))
    aimed = np.isin(np.arange(800) % 8, (2, 6))
    in_view = np.max(np.abs(flown[:, 1] - [12.0, 3.0]), axis=1) <= 5.0
    same_end = np.linalg.norm(after[:, -1] - before, axis=1) < 1e-9
    if not response.lacking.any() or speed > 5.0:  # else full speed does not always bring it into view in time
        assert np.all((in_view | same_end)[aimed])
    assert 70 < np.sum(in_view & aimed) <= 200 and np.sum(in_view & ~aimed) < 100


def test_with_fields_of_view_made_wider_the_objective_is_that_of_wider_views(random_team):
    situation = random_team(2, trees=0, targets=6)[0]
    view, rng = nominal(situation, 3), np.random.default_rng(0)
    controls, candidates = rng.uniform(-3, 3, (3, 3, 2)), rng.uniform(-5, 5, (100, 2, 3, 2))
    wider = view.views.copy()
    halves = wider[:, 0, 2] + [1.0, 0.0, 0.5]
    wide = view._replace(views=squares(halves))
    # UAVs that do not decide keep their fields of view, so UAVs 0 and 2 decide.
    eased = make_objective(view, controls, [0, 2], 0.5)(candidates, np.array([1.0, 0.5]))
    np.testing.assert_allclose(eased, make_objective(wide, controls, [0, 2], 0.5)(candidates), rtol=1e-12)
    assert np.mean(eased != make_objective(view, controls, [0, 2], 0.5)(candidates)) > 0.5


def far_target(random_team):
    """One UAV and one target that comes into view in the last of five steps, if every step goes straight to it."""
    situation = random_team(0, uavs=1, targets=1)[0]
    half = (situation.own.position[2] - 0.85) * np.tan(np.pi / 6)
    track = situation.tracks[0]
    mean = np.array([*(situation.own.position[:2] + half + 24.99 * np.array([0.8, 0.6])), 0.0, 0.0])
    belief = dataclasses.replace(track.belief, mean=mean)
    return dataclasses.replace(situation, tracks=(dataclasses.replace(track, belief=belief),), forest=Forest(()))


@pytest.mark.parametrize("seed", range(5))
def test_what_only_the_straightest_flight_can_see_is_found_with_hints(random_team, seed):
    view = nominal(far_target(random_team), 5)
    value = make_objective(view, np.zeros((1, 5, 2)), [0], 0.0)
    hover, straight = np.zeros((1, 1, 5, 2)), np.tile([4.0, 3.0], (1, 1, 5, 1))
    assert value(straight)[0] < value(hover)[0]
    hints = find_targets_in_reach(view, [0], SPEED, at_once(1))
    found = CrossEntropy(4096).minimise(value, hover, SPEED, np.random.default_rng(seed), hints)
    assert value(found[None])[0] == pytest.approx(value(straight)[0], rel=1e-3)


def counting(random_team, uavs):
    """An objective that can be eased and the lengths of what it was asked, with hints, for so many UAVs that decide."""
    view, asked = nominal(random_team(1)[0], 5), []
    value = make_objective(view, np.zeros((3, 5, 2)), range(uavs), 0.5)

    def counted(candidates, ease=None):
        asked.append((len(candidates), ease is not None))
        return value(candidates, ease)

    return value, counted, asked, find_targets_in_reach(view, range(uavs), np.full(uavs, 5.0), at_once(uavs))


@pytest.mark.parametrize("uavs", [1, 3])
@pytest.mark.parametrize(
    "optimizer", [CrossEntropy(4096), CrossEntropy(64), CrossEntropy(5), CrossEntropy(512, rounds=1), CrossEntropy(0)]
)
def test_with_hints_no_start_is_better_and_the_budget_holds(random_team, uavs, optimizer):
    value, counted, asked, hints = counting(random_team, uavs)
    starts = np.random.default_rng(0).uniform(-3, 3, (60, uavs, 5, 2))
    found = optimizer.minimise(counted, starts, np.full(uavs, 5.0), np.random.default_rng(0), hints)
    # Plans side by side share sums, so that a batch of others may change the last bit.
    assert value(found[None])[0] <= value(starts).min() * (1 + 1e-12)
    assert sum(count for count, _ in asked) <= 60 + optimizer.evaluations
    assert any(eased for _, eased in asked) == (optimizer.evaluations == 4096)


def test_when_time_ends_a_relaxed_search_plans_get_their_true_costs(random_team, monkeypatch):
    value, counted, asked, hints = counting(random_team, 1)
    ticks = itertools.count()
    monkeypatch.setattr("planning.optimizers.cross_entropy.perf_counter", lambda: next(ticks))
    starts = np.random.default_rng(0).uniform(-3, 3, (60, 1, 5, 2))
    pools = []

    def kept(candidates, ease=None):
        pools.append(candidates)
        return counted(candidates, ease)

    found = CrossEntropy(4096, seconds=4).minimise(kept, starts, SPEED, np.random.default_rng(0), hints)
    assert [eased for _, eased in asked[-3:]] == [True, True, False]
    # Plans side by side share sums, so that a batch of others may change the last bit.
    assert value(found[None])[0] == pytest.approx(value(pools[-1]).min(), rel=1e-12)
    assert value(found[None])[0] <= value(starts).min() * (1 + 1e-12)
