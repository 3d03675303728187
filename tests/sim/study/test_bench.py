"""The ten worlds of bench-1: frozen, flown without error, scored between hovering and an unlimited view."""

import hashlib

import msgspec
import numpy as np
import pytest
from helpers.studies import Serial, task_of

from sim.installation import ASSETS
from sim.scenario.loading import SCENARIOS, load_scenario
from sim.scenario.remarks import find_remarks
from sim.scenario.scenario import encode_scenario
from sim.study.cells import VIEW, list_cells
from sim.study.definition import adapt_study, read_study
from sim.study.scheduler import fly_trials
from sim.study.trials import list_trials

BENCH = read_study("bench-1")
WORLDS = ("paper", "forest", "scatter", "search", "crowd", "dense", "wind", "patchwork", "recorded", "fleet")
# Of every key of the worlds, their floor and bound, and the recorded paths. What has to change is a world of another
# bench, bench-2, under another name; where a default of a key changes, a world keeps its value by a line in its file.
FROZEN = "7d1e962bf0a1101f01e51cff797d44cc98b00fd7df35c3cb9ffadb298ce9db4c"


def test_the_worlds_of_the_bench_never_change():
    paths = (ASSETS / "trajectories" / "plaza.csv").read_bytes()
    parts = [repr(BENCH.score).encode(), paths] + [encode_scenario(load_scenario(name)).encode() for name in WORLDS]
    digest = hashlib.sha256(b"\0".join(parts)).hexdigest()
    assert digest == FROZEN, "bench-1 is frozen: make another bench of it, and leave its worlds as they are"
    assert WORLDS == BENCH.scenarios and all("version = 1\n" in SCENARIOS[name].read_text("utf-8") for name in WORLDS)


@pytest.mark.parametrize("world", WORLDS)
def test_each_world_flies_with_the_people_and_uavs_that_it_promises(world):
    setting = load_scenario(world)
    assert find_remarks(setting) == []
    (row,) = fly_trials([task_of(msgspec.structs.replace(setting, duration=1.0), "greedy", 3)], Serial())
    assert row.status == "done" and row.metrics["faults"] == 0 and np.isfinite(row.metrics["gospa.mean_m"])


def test_floor_and_bound_are_flown_whatever_planners_are_compared():
    found = list_cells(adapt_study(BENCH, planners=["mine:Mine"]))
    kinds = {(cell.planner, dict(cell.factors).get(VIEW)) for cell in found}
    assert kinds == {("mine:Mine", None), ("hover", None), ("sma-nbo-mwtp", "unlimited")} and len(found) == 30
    some = adapt_study(BENCH, planners=["mine:Mine"], scenarios=["dense", "search", "dense"])
    assert [cell for cell in found if cell.scenario in ("dense", "search")] == sorted(list_cells(some), key=found.index)
    listed = list_trials(adapt_study(BENCH, planners=["hover"], seeds="0"))
    assert len(listed) == 20 and len({task.key for task in listed}) == 20
    for task in listed:
        unlimited = VIEW in dict(task.factors)
        assert (task.setting.sensing.field_of_view == "unlimited") == unlimited == (task.planner != "hover")
