"""Conformance: what every planner by name must hold to."""

import copy
import dataclasses
import pickle
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from planning.baselines import Lawnmower
from planning.composition import Composition
from planning.coordination.sequential import Sequential
from planning.loading import load_planner
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.prediction.propagation import MonteCarlo, Nominal
from planning.registry import PLANNERS, installed_planners
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT


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
        _ = (
            situation.forest.blockers,
            situation.motion.F,
            situation.motion.Q,
        )  # cached before the copy, so that the copy has them too
    before = pickle.dumps(copy.deepcopy(team))
    load_planner(name).plan(team, np.random.default_rng(0))
    assert pickle.dumps(copy.deepcopy(team)) == before


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_a_planner_survives_pickling(random_team, name):
    planner = pickle.loads(pickle.dumps(load_planner(name)))
    expected = load_planner(name).plan(random_team(2), np.random.default_rng(3))
    for plan, other in zip(planner.plan(random_team(2), np.random.default_rng(3)), expected, strict=True):
        np.testing.assert_array_equal(plan.controls, other.controls)


@pytest.mark.parametrize("name", ["sma-nbo", "sma-nbo-mwtp", "pma-nbo", "mcr", "dec-pomdp"])
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
        ("sma-nbo(horizn=3)", "has no option 'horizn'; allowed are horizon,"),
        ("sma-nbo(horizn=3)", "did you mean horizon?"),
        ("hover(speed=3)", "has no option 'speed'; it has none"),
        ("sma-nbo(horizon=0)", "horizon must be a whole number from 1 to 100, is 0"),
        ("sma-nbo(horizon=2.5)", "horizon must be a whole number from 1 to 100, is 2.5"),
        ("sma-nbo(beta=-1)", "beta must be a finite number from 0 to 1e+06, is -1"),
        ("sma-nbo(beta=1e999)", "beta must be a finite number"),
        ("sma-nbo(optimizer=cem)", "optimizer 'cem' is unknown; allowed are 'cross-entropy', 'particle-swarm', 'grid'"),
        ("sma-nbo(horizon=3", "is not of the form name(option=value, ...)"),
        ("sma-nbo(3)", "is not of the form name(option=value, ...)"),
        ("sma-nbo(horizon=3, horizon=4)", "is not of the form name(option=value, ...)"),
    ],
)
def test_a_wrong_planner_is_named_in_one_line(name, message, tmp_path, monkeypatch):
    (tmp_path / "broken_planner.py").write_text("class = X\n")
    (tmp_path / "leaving_planner.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=r"^planner: ") as caught:
        load_planner(name)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_options_choose_the_pieces():
    pieces = load_planner("mcr(horizon=3, samples=7, optimizer=particle-swarm, occlusion=disc, beta=0.25)").composition
    assert pieces == Composition(3, Sequential(), MonteCarlo(7), 0.25, ParticleSwarm(evaluations=10_240), "disc")
    pieces = load_planner("sma-nbo( order = worst-first , sweeps=2,visibility='expected', evaluations=99)").composition
    assert pieces == Composition(5, Sequential("worst-first", 2), Nominal(expected=True), 0.0, CrossEntropy(99), None)
    pieces = load_planner("sma-nbo(optimizer=grid, evaluations=99, seconds=0.5)").composition
    assert pieces.optimizer == GridSearch(evaluations=99, seconds=0.5)
    assert load_planner("planning.baselines:Lawnmower(pace=0.5)") == Lawnmower(0.5)


def test_planners_that_other_packages_bring_have_names(monkeypatch):
    point = EntryPoint("theirs", "planning.baselines:Hover", "understory.planners")
    monkeypatch.setattr("planning.registry.entry_points", lambda group: [point] if group == point.group else [])
    installed_planners.cache_clear()
    try:
        assert load_planner("theirs") == load_planner("hover")
        assert list(installed_planners()) == [*PLANNERS, "theirs"]
    finally:
        installed_planners.cache_clear()


def test_the_lawnmower_sees_the_whole_area_in_time(random_team):
    team, planner = random_team(0), load_planner("lawnmower")
    x, y = np.meshgrid(np.arange(-74.5, 75), np.arange(-49.5, 50))
    ground = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, TARGET_HEIGHT)])
    seen = np.zeros(len(ground), dtype=bool)
    for time in range(180):
        for k, plan in enumerate(planner.plan(team, np.random.default_rng(0))):
            own = team[k].own
            position = own.position + np.append(plan.controls[0], 0.0)
            seen |= own.camera.sees(Pose(position, own.attitude), ground)
            team[k] = dataclasses.replace(team[k], own=dataclasses.replace(own, position=position), time=time + 1.0)
    assert seen.mean() >= 0.97
