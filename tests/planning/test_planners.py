"""Planners by name and their options; `test_planner_check.py` has what every planner must hold to."""

import dataclasses
import math
import re
import sys
from types import SimpleNamespace
from typing import get_args, get_type_hints

import numpy as np
import pytest
from helpers.teams import refitted
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from planning.baselines import Lawnmower
from planning.composed import Composed
from planning.coordination.schemes import Centralised, Sequential
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.grid_search import GridSearch
from planning.optimizers.particle_swarm import ParticleSwarm
from planning.options import Range
from planning.planner_loading import add_options, load_planner, split_options
from planning.prediction.propagation import MonteCarlo, Nominal
from planning.rivals.dec_mcts import DecMCTS
from planning.rivals.thompson import Thompson
from tracking.errors import InputError
from tracking.geometry.camera import Pose
from tracking.geometry.person import TARGET_HEIGHT


def test_options_choose_the_pieces_of_ours_and_of_anyones_class():
    assert load_planner("planning.baselines:Hover") == load_planner("hover")
    planner = load_planner("mcr(horizon=3, samples=7, optimizer=particle-swarm, occlusion=disc, beta=0.25)")
    assert (planner.horizon, planner.beta, planner.occlusion, planner.scheme) == (3, 0.25, "disc", Sequential())
    assert (planner.propagator, planner.minimiser) == (MonteCarlo(7), ParticleSwarm(evaluations=10_240))
    planner = load_planner("sma-nbo( order = worst-first , sweeps=2,visibility='expected', evaluations=99)")
    assert (planner.horizon, planner.beta, planner.scheme) == (5, 0.0, Sequential("worst-first", 2))
    assert (planner.propagator, planner.minimiser) == (Nominal(expected=True), CrossEntropy(99))
    planner = load_planner("sma-nbo(optimizer=grid, evaluations=99, seconds=0.5)")
    assert planner.minimiser == GridSearch(evaluations=99, seconds=0.5)
    own = Centralised()
    assert Composed(coordination=own).scheme is own
    assert load_planner("planning.baselines:Lawnmower(pace=0.5)") == Lawnmower(0.5)


# Options, and how the message begins and ends that refuses them.
WRONG = {
    "sma-nbo(horizon=0)": ["horizon must be a whole number from 1 to 100, is 0"],
    "sma-nbo(horizon=five)": ["option horizon of 'sma-nbo' must be a number, is 'five'"],
    "sma-nbo(optimizer=3)": ["option optimizer of 'sma-nbo' must be a word, is 3"],
    "sma-nbo(existence=1)": ["option existence of 'sma-nbo' must be True or False, is 1"],
    "sma-nbo(coordination=sequentail)": ["coordination 'sequentail' is unknown", "did you mean sequential?"],
    "sma-nbo(optimiser=grid)": ["has no option 'optimiser'", "did you mean optimizer?"],
    "hover(speed=3)": ["has no option 'speed'; it has none"],
    "sma-nbo(3)": ["is not of the form name(option=value, ...)"],
    "sma-nbo(horizon=3, horizon=4)": ["has the option 'horizon' more than once; allowed is once"],
    "pma-nbo(order=random)": [
        "order=random has no effect with coordination 'parallel'; set order=fixed or coordination=sequential"
    ],
    "sma-nbo(samples=5)": ["samples=5 has no effect with propagation 'nominal'", "propagation=monte-carlo"],
    "mcr(visibility=expected)": [
        "visibility=expected has no effect with propagation 'monte-carlo'",
        "propagation=nominal",
    ],
    "sma-nbo-gospa(escape=20, existence=False)": ["escape=20 needs probabilities of existence", "existence=True"],
    "oracle(visibility=expected)": ["visibility=expected is not for an oracle", "people will be"],
    "rsp(cutoff=10)": ["cutoff=10 has no effect with uncertainty 'information'; set cutoff=0"],
    "sma-nbo(cost_to_go=0.3)": ["cost_to_go=0.3 needs a cut-off; set cost_to_go=0 or cutoff=10"],
    "dec-mcts(evaluations=4)": ["evaluations must be at least the 5 rounds, is 4"],
}


@pytest.mark.parametrize("text", WRONG)
def test_options_that_cannot_be_or_have_no_effect_are_refused(text):
    with pytest.raises(InputError, match="^planner: .*" + ".*".join(map(re.escape, WRONG[text])) + "$") as error:
        load_planner(text)
    name, _, options = text.removesuffix(")").partition("(")
    for option, value in re.findall(r"(?:set| or) (\w+)=([\w-]+)(?= or|$)", str(error.value)):
        others = [other for other in options.split(", ") if not other.startswith(f"{option}=")]
        assert callable(load_planner(f"{name}({', '.join([*others, f'{option}={value}'])})").plan)


@pytest.mark.parametrize("kind", [Composed, DecMCTS, Thompson, Lawnmower, CrossEntropy])
def test_numbers_beyond_their_range_are_refused(kind):
    hints = get_type_hints(kind, include_extras=True).items()
    ranges = {option: part for option, hint in hints for part in get_args(hint) if isinstance(part, Range)}
    assert ranges
    for option, bounds in ranges.items():
        for value in (bounds.least - (not bounds.above), bounds.most + 1, math.inf, math.nan, True, "1"):
            with pytest.raises(ValueError, match=rf"^{option} must be a (whole )?number {re.escape(str(bounds))}, is "):
                kind(**{option: value})


def test_values_of_options_may_hold_commas(monkeypatch):
    made = SimpleNamespace(Made=lambda **options: SimpleNamespace(plan=lambda team, rng: None, options=options))
    monkeypatch.setitem(sys.modules, "made", made)
    text = "made:Made(places=[(1, 2), (3, 4)], word='a, b', path=runs/x.npz, pair=(5,))"
    options = {"places": [(1, 2), (3, 4)], "word": "a, b", "path": "runs/x.npz", "pair": (5,)}
    assert load_planner(text).options == options
    assert split_options(add_options(text, {"more": "(6, 7)"}))[1][-2:] == ["pair=(5,)", "more=(6, 7)"]


def test_random_velocities_are_spread_evenly_over_the_disc(random_team):
    team, rng = random_team(0), np.random.default_rng(5)
    drawn = np.array([[plan.controls[0] for plan in load_planner("random").plan(team, rng)] for _ in range(2000)])
    speeds, angles = np.hypot(*drawn.reshape(-1, 2).T) / 5.0, np.arctan2(*drawn.reshape(-1, 2).T)
    for share in (np.square(speeds), angles / (2 * np.pi) + 0.5):  # each even between 0 and 1
        assert kstest(share, "uniform").pvalue > 0.01


@pytest.mark.parametrize("tilt", [0, 20, 30, 45])
def test_the_lawnmower_sees_the_whole_area_in_time(random_team, tilt):
    attitude = Rotation.from_euler("Y", -tilt, degrees=True).as_quat()
    team = refitted(random_team(0), lambda v: dataclasses.replace(v, attitude=attitude))
    planner = load_planner("lawnmower")
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
