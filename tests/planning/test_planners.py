"""Planners by name and their options; `conformance/test_checks.py` has what every planner must hold to."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import kstest

from planning.baselines import Lawnmower
from planning.composition import Composition
from planning.coordination.schemes import Sequential
from planning.loading import PlannerError, load_planner
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.prediction.propagation import MonteCarlo, Nominal
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import TARGET_HEIGHT


def test_options_choose_the_pieces_of_ours_and_of_anyones_class():
    assert load_planner("planning.baselines:Hover") == load_planner("hover")
    pieces = load_planner("mcr(horizon=3, samples=7, optimizer=particle-swarm, occlusion=disc, beta=0.25)").composition
    assert pieces == Composition(3, Sequential(), MonteCarlo(7), 0.25, ParticleSwarm(evaluations=10_240), "disc")
    pieces = load_planner("sma-nbo( order = worst-first , sweeps=2,visibility='expected', evaluations=99)").composition
    assert pieces == Composition(5, Sequential("worst-first", 2), Nominal(expected=True), 0.0, CrossEntropy(99), None)
    pieces = load_planner("sma-nbo(optimizer=grid, evaluations=99, seconds=0.5)").composition
    assert pieces.optimizer == GridSearch(evaluations=99, seconds=0.5)
    assert load_planner("planning.baselines:Lawnmower(pace=0.5)") == Lawnmower(0.5)


@pytest.mark.parametrize(
    ("option", "planner", "reason", "needs"),
    [
        ("order=random", "pma-nbo", "coordination 'parallel'", "coordination=sequential"),
        ("samples=5", "sma-nbo", "propagation 'nominal'", "propagation=monte-carlo"),
    ],
)
def test_an_option_without_effect_is_an_error(option, planner, reason, needs):
    with pytest.raises(PlannerError) as error:
        load_planner(f"{planner}({option})")
    assert str(error.value).endswith(f"{option} has no effect with {reason}; leave it out, or set {needs}")
    assert callable(load_planner(f"{planner}({option}, {needs})").plan)


def test_random_velocities_are_spread_evenly_over_the_disc(random_team):
    team, rng = random_team(0), np.random.default_rng(5)
    drawn = np.array([[plan.controls[0] for plan in load_planner("random").plan(team, rng)] for _ in range(2000)])
    speeds, angles = np.hypot(*drawn.reshape(-1, 2).T) / 5.0, np.arctan2(*drawn.reshape(-1, 2).T)
    for share in (np.square(speeds), angles / (2 * np.pi) + 0.5):  # each even between 0 and 1
        assert kstest(share, "uniform").pvalue > 0.01


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
