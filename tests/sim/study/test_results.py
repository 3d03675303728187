"""The README's claims of the default scenario, flown again: `pytest -m slow -n 0 tests/sim/study/test_results.py`."""

import numpy as np
import pytest
from helpers.flights import mission_of
from helpers.studies import task_of

from planning.catalogue import DEFAULT_PLANNER
from sim.scenario.loading import load_scenario
from sim.study.executors import Pool
from sim.study.scheduler import fly_trials

SEEDS = range(10)


@pytest.mark.slow
def test_the_default_planner_holds_the_people_and_baselines_do_not():
    names = (DEFAULT_PLANNER, "greedy", "hover")
    with Pool(2) as pool:
        rows = fly_trials([task_of(load_scenario("forest"), name, seed) for name in names for seed in SEEDS], pool)
    share = {name: np.mean([r.metrics["ospa.share_under_1m"] for r in rows if r.planner == name]) for name in names}
    assert share[DEFAULT_PLANNER] >= 0.80 and share["greedy"] <= share[DEFAULT_PLANNER] - 0.15
    assert share["hover"] <= share[DEFAULT_PLANNER] - 0.40


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_people_unknown_at_first_are_all_found_and_held(seed):
    setting = load_scenario("forest", ["tracking.initial_tracks=none"])
    sizes = [len(s.tracks[0]) for s in mission_of(setting, DEFAULT_PLANNER, seed).fly()]
    found = sizes.index(4)
    assert found <= 100  # within 20 s
    assert np.mean(np.array(sizes[found:]) == 4) >= 0.95
