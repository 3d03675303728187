"""Conformance: what every planner by name must hold to."""

import copy
import pickle

import numpy as np
import pytest

from planning.registry import PLANNERS, load_planner


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_plans_are_finite_within_limits_and_repeatable(random_team, name):
    planner = load_planner(name)
    for seed in range(3):
        team = random_team(seed)
        plans = planner.plan(team, np.random.default_rng(seed))
        again = load_planner(name).plan(random_team(seed), np.random.default_rng(seed))
        assert len(plans) == len(team)
        for plan, repeated in zip(plans, again, strict=True):
            assert plan.controls.ndim == 2 and plan.controls.shape[1] == 2 and len(plan.controls) >= 1
            assert np.all(np.linalg.norm(plan.controls, axis=1) <= 5.0 * (1 + 1e-9))
            np.testing.assert_array_equal(plan.controls, repeated.controls)


@pytest.mark.parametrize("name", sorted(PLANNERS))
@pytest.mark.parametrize("case", [{"targets": 0}, {"trees": 0}, {"uavs": 1, "targets": 1}])
def test_plans_exist_without_targets_trees_or_companions(random_team, name, case):
    team = random_team(0, **case)
    plans = load_planner(name).plan(team, np.random.default_rng(0))
    assert all(np.all(np.isfinite(p.controls)) for p in plans) and len(plans) == len(team)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_planning_leaves_its_inputs_untouched(random_team, name):
    team = random_team(1)
    for situation in team:
        _ = situation.forest.blockers, situation.motion.Q  # cached before the copy, so that the copy has them too
    before = pickle.dumps(copy.deepcopy(team))
    load_planner(name).plan(team, np.random.default_rng(0))
    assert pickle.dumps(copy.deepcopy(team)) == before


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_a_planner_survives_pickling(random_team, name):
    planner = pickle.loads(pickle.dumps(load_planner(name)))
    expected = load_planner(name).plan(random_team(2), np.random.default_rng(3))
    for plan, other in zip(planner.plan(random_team(2), np.random.default_rng(3)), expected, strict=True):
        np.testing.assert_array_equal(plan.controls, other.controls)


@pytest.mark.parametrize("name", ["sma-nbo", "sma-nbo-mwtp"])
def test_a_uav_plans_with_its_own_tracks_only(random_team, name):
    """The first UAV of the sequence has received nothing: what others believe cannot change its plan."""
    team, other = random_team(5), random_team(6)
    mixed = [team[0], *(type(s)(**{**vars(s), "tracks": o.tracks}) for s, o in zip(team[1:], other[1:], strict=True))]
    plan = load_planner(name).plan(team, np.random.default_rng(0))[0]
    np.testing.assert_array_equal(plan.controls, load_planner(name).plan(mixed, np.random.default_rng(0))[0].controls)


def test_a_planner_can_be_anyones_class():
    assert load_planner("planning.baselines:Hover") == load_planner("hover")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("sma-nbo-mwpt", "did you mean sma-nbo-mwtp?"),
        ("no.such.module:Planner", "cannot be imported"),
        ("planning.baselines:Missing", "cannot be imported"),
        ("planning.planner:Plan", "planner: 'planning.planner:Plan'"),
        ("collections:OrderedDict", "has no method plan"),
        (":", "cannot be imported"),
        ("broken_planner:X", "cannot be imported: SyntaxError"),
        ("leaving_planner:X", "cannot be imported: SystemExit: 3"),
    ],
)
def test_a_wrong_planner_is_named_in_one_line(name, message, tmp_path, monkeypatch):
    (tmp_path / "broken_planner.py").write_text("class = X\n")
    (tmp_path / "leaving_planner.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=r"^planner: ") as caught:
        load_planner(name)
    assert message in str(caught.value) and "\n" not in str(caught.value)
