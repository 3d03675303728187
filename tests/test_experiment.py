"""Missions side by side come out as they do alone."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from sim.errors import InputError
from sim.experiment import compare, fly, fly_all
from sim.loading import load
from sim.mission import Mission, Trial

IDEAL = ["duration=2", "sensing.mode=ideal"]


def measured(outcome):
    """An outcome less its wall time."""
    return dataclasses.replace(outcome, planning_s=0.0)


def test_an_outcome_is_that_of_the_mission_alone():
    setting = load("forest", IDEAL)
    distance = np.array([s.ospa[:, 0] for s in Mission.of(Trial(setting, "greedy", 4)).fly()])
    outcome = fly(Trial(setting, "greedy", 4))
    assert (outcome.planner, outcome.seed, outcome.faults) == ("greedy", 4, 0)
    assert outcome.mean_m == distance.mean() and outcome.median_m == np.median(distance)
    assert outcome.share_under_1m == np.mean(distance < 1)
    assert outcome.planning_s > 0


def test_worker_processes_change_nothing_and_outcomes_keep_their_order():
    setting = load("forest", IDEAL)
    heard = []
    together = compare(setting, ["hover", "greedy"], [2, 0], workers=2, progress=heard.append)
    assert [(o.planner, o.seed) for o in together] == [("hover", 2), ("hover", 0), ("greedy", 2), ("greedy", 0)]
    assert sorted(o.seed for o in heard) == [0, 0, 2, 2]
    alone = [fly(Trial(setting, o.planner, o.seed)) for o in together]
    assert list(map(measured, together)) == list(map(measured, alone))


def test_any_executor_will_do():
    trials = [Trial(load("forest", IDEAL), "hover", seed) for seed in (0, 1)]
    with ThreadPoolExecutor(1) as executor:
        outcomes = fly_all(trials, executor)
    assert list(map(measured, outcomes)) == [measured(fly(trial)) for trial in trials]


def test_wrong_input_comes_back_from_a_worker_as_such():
    with pytest.raises(InputError, match=r"trees\.density = 160"):
        compare(load("forest", ["trees.density=160"]), ["hover"], [0, 1])
