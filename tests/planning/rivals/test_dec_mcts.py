"""Dec-MCTS against every joint plan of small cases, and its parts against the objective and closed forms."""

import dataclasses
import itertools
from functools import partial

import numpy as np
import pytest
from helpers.nominal import information
from helpers.teams import knowing, planned

from planning.prediction.intent import policy_of_intent
from planning.prediction.propagation import Nominal
from planning.rivals.dec_mcts import DecMCTS, TreeSearch
from planning.rivals.distribution import optimise_probabilities
from planning.rivals.gathered_information import build_prior, gain_of, gather_information
from planning.rivals.moves import make_moves
from planning.rivals.tree import SearchTree, find_promising_sequences
from tracking.filter.kalman import NearlyConstantVelocity

gained = partial(information, expected=True)


@pytest.mark.parametrize("directions", [4, 8])
def test_places_are_those_of_all_sequences_and_merge(directions):
    made = make_moves(3, directions)
    ends, ways = set(), set()
    for sequence in itertools.product(range(directions + 1), repeat=3):
        place = -1
        for step, control in enumerate(sequence):
            place = made.onward[place, control]
            assert made.steps[place] == step
            way = made.controls[list(sequence[: step + 1])].sum(axis=0)
            np.testing.assert_allclose(made.places[place], way, atol=1e-5)
        ends.add(place)
        ways.add(tuple(np.round(way, 4) + 0.0))
    assert len(ends) == len(ways) < 200 and np.all(made.onward[sorted(ends)] == -1)


@pytest.mark.parametrize("targets", [0, 4, 30])
def test_information_by_places_sums_to_the_objective_of_joint_plans(random_team, targets):
    for seed in range(6):
        situation, rng = random_team(seed, targets=targets, spread=15.0)[0], np.random.default_rng(seed)
        plans = rng.uniform(-3.5, 3.5, (3, 4, 2))
        belief = Nominal(expected=True).predict(situation, 4, rng)
        starts = np.array([v.position[:2] for v in situation.vehicles])
        paths = starts[:, None] + situation.step * np.cumsum(plans, axis=1)
        tables = [gather_information(belief, i, paths[i], np.arange(4)) for i in range(3)]
        for uavs in ([0], [1, 2], [0, 1, 2]):
            found = gain_of(build_prior(belief), sum(tables[i] for i in uavs))
            assert found == pytest.approx(gained(situation, uavs, plans[None, uavs])[0], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("temperature", [1.0, 0.1, 0.02])
def test_distributions_cool_towards_exponentials_of_the_gains(temperature):
    gains = np.random.default_rng(0).random(8)
    expected = np.exp(gains / temperature)
    found = optimise_probabilities(gains, temperature, 300)
    np.testing.assert_allclose(found, expected / expected.sum(), rtol=1e-6, atol=1e-9)


def controls_of(horizon, directions):
    each = 5.0 * make_moves(horizon, directions).controls
    return np.array(list(itertools.product(each, repeat=horizon)))


def test_distributions_concentrate_on_the_optimum_of_a_small_case(random_team):
    """Two UAVs of 25 sequences each."""
    each = controls_of(2, 4)
    joint = np.stack([each[list(pair)] for pair in itertools.product(range(25), repeat=2)])
    small = {"horizon": 2, "directions": 4, "rounds": 8, "samples": 40, "updates": 300}
    planner = DecMCTS(evaluations=2000, discount=0.99, **small)
    for seed in range(5):
        team, rng = random_team(seed, uavs=2, spread=10.0), np.random.default_rng(seed)
        searches = [TreeSearch(planner, s, stream) for s, stream in zip(team, rng.spawn(2), strict=True)]
        for now in range(planner.rounds):
            for one, other in (searches, searches[::-1]):
                one.advance(now)
                other.receive(one, now)
        plans = np.array([search.decision() for search in searches])
        found = gained(team[0], [0, 1], plans[None])[0]
        assert found >= 0.999 * gained(team[0], [0, 1], joint).max()
        for search, plan in zip(searches, plans, strict=True):
            same = np.abs(search.controls - plan).max(axis=(1, 2)) < 1e-9
            assert search.chances[same].sum() > 0.9
        np.testing.assert_array_equal(plans, planned(planner, team, seed))


def test_with_effort_no_uav_alone_can_better_the_teams_plan(random_team):
    """One could have gained up to 68 % where UAVs answered each other all at once."""
    each = controls_of(2, 8)
    for seed in range(6):
        team = random_team(seed, spread=12.0)
        plans = planned(DecMCTS(horizon=2, evaluations=2000), team, seed)
        found = gained(team[0], range(3), plans[None])[0]
        for uav in range(3):
            others = np.repeat(plans[None], len(each), axis=0)
            others[:, uav] = each
            assert found >= (1 - 1e-3) * gained(team[0], range(3), others).max() > 0.0


def test_of_a_sender_those_sequences_count_that_arrive_in_this_round(random_team):
    """Sequence k of round r is message 10 r + k; those that arrive share the probability."""
    planner = DecMCTS(evaluations=60, rounds=2)
    team = random_team(0, uavs=2, spread=12.0)
    arriving = ((0, 3), (1, 4, 7))
    heard = tuple((1,) if k % 10 in arriving[k // 10] else () for k in range(planner.exchange.rounds))
    team[0] = dataclasses.replace(team[0], reception=heard)
    one, other = (TreeSearch(planner, s, rng) for s, rng in zip(team, np.random.default_rng(0).spawn(2), strict=True))
    for now in range(2):
        other.advance(now)
        one.receive(other, now)
        found, kept = one._gather_team(), list(arriving[now])
        shares = other.chances[kept] / other.chances[kept].sum()
        np.testing.assert_allclose(np.diff(found.chances, prepend=0.0), shares, atol=1e-12)
        paths = team[1].own.position[:2] + np.cumsum(other.controls[kept], axis=1)
        tables = [gather_information(one._belief, 1, path, np.arange(5)) for path in paths]
        np.testing.assert_array_equal(found.others, tables)


def test_places_of_a_plan_follow_the_length_of_its_steps(random_team):
    """Two UAVs with steps of half a second: information by the trees' tables is that of the objective."""
    motion = NearlyConstantVelocity(0.5, 0.5, scans=5)
    team = [dataclasses.replace(s, motion=motion) for s in random_team(1, uavs=2, spread=8.0)]
    planner = DecMCTS(evaluations=200, rounds=1, sequences=1)
    one, other = (TreeSearch(planner, s, rng) for s, rng in zip(team, np.random.default_rng(0).spawn(2), strict=True))
    other.advance(0)
    one.receive(other, 0)
    one.advance(0)
    seen = one._gather_team().others[0] + one._gather_information(find_promising_sequences(one._tree, 1))[0]
    joint = np.stack([one.decision(), other.decision()])[None]
    assert gain_of(one._prior, seen) == pytest.approx(gained(team[0], [0, 1], joint)[0], rel=1e-9)
    assert gained(team[0], [0], joint[:, :1])[0] > 0.0 < gained(team[0], [1], joint[:, 1:])[0]


def test_visits_are_discounted_and_the_most_promising_sequences_stand_first(random_team):
    team = random_team(3, spread=12.0)
    search = TreeSearch(DecMCTS(evaluations=300, rounds=1, discount=0.99), team[0], np.random.default_rng(0))
    search.advance(0)
    tree: SearchTree = search._tree
    assert tree.visits[0] == pytest.approx((1 - 0.99**300) / 0.01, rel=1e-9) and tree.counts.tolist() == [301, 300]
    now = tree.visits * 0.99 ** (300 - tree.last)
    for node in range(1, 301):
        below = tree.children[node][tree.children[node] >= 0]
        # A node has its own first visit and those of its children.
        assert now[node] >= now[below].sum() - 1e-9
    assert now[0] == pytest.approx(now[tree.children[0]].sum(), rel=1e-9)
    first = find_promising_sequences(tree, 5)
    means = tree.sums[1:301] / tree.visits[1:301]
    np.testing.assert_array_equal(first[0], tree.sequences[1 + np.argmax(means)])
    assert len(np.unique(first, axis=0)) == 5


def test_of_uavs_not_heard_and_without_gains_the_policy_of_intent_is_flown(random_team):
    team = knowing(random_team(0, spread=12.0), np.random.default_rng(0).uniform(-2, 2, (3, 4, 2)))
    away = [dataclasses.replace(s, tracks=tuple(dataclasses.replace(t, existence=0.0) for t in s.tracks)) for s in team]
    np.testing.assert_array_equal(planned(DecMCTS(), away), [policy_of_intent(s, s.own, 5) for s in away])
    planner = DecMCTS(evaluations=100)
    lost = [dataclasses.replace(s, reception=((),) * planner.exchange.rounds) for s in team]
    for k, stream in enumerate(np.random.default_rng(1).spawn(3)):
        alone = TreeSearch(planner, lost[k], stream)
        for now in range(planner.rounds):
            alone.advance(now)
        np.testing.assert_array_equal(planned(planner, lost, 1)[k], alone.decision())
