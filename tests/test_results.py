"""What the README claims of the default scenario, flown again: `pytest -m slow -n 0 tests/test_results.py`."""

import numpy as np
import pytest

from sim.experiment import compare
from sim.loading import load
from sim.mission import Mission, Trial

SEEDS = range(10)


@pytest.mark.slow
def test_the_default_planner_holds_the_people_and_baselines_do_not():
    outcomes = compare(load("forest"), ["sma-nbo-mwtp", "greedy", "hover"], list(SEEDS), workers=2)
    share = {
        name: np.mean([o.share_under_1m for o in outcomes if o.planner == name])
        for name in ("sma-nbo-mwtp", "greedy", "hover")
    }
    assert share["sma-nbo-mwtp"] >= 0.80
    assert share["greedy"] <= share["sma-nbo-mwtp"] - 0.15
    assert share["hover"] <= share["sma-nbo-mwtp"] - 0.40


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_people_unknown_at_first_are_all_found_and_held(seed):
    setting = load("forest", ["tracking.initial_tracks=none"])
    sizes = [len(s.tracks[0]) for s in Mission.of(Trial(setting, "sma-nbo-mwtp", seed)).fly()]
    found = sizes.index(4)
    assert found <= 100  # within 20 s
    assert np.mean(np.array(sizes[found:]) == 4) >= 0.95
