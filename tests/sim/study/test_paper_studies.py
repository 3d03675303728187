"""The studies of the paper's own setting: what they set, where they begin and where they end."""

import itertools
import math

import msgspec
import pytest

from planning.loading import load_planner
from planning.registry import DEFAULT_PLANNER
from sim.scenario.scenario import Scenario
from sim.study.cells import cells
from sim.study.study import adapted, read
from sim.study.tasks import tasks
from tracking.geometry.visibility import TARGET_HEIGHT

WALK = adapted(read("paper-to-default"), seeds="0")
ORIGINAL = adapted(read("paper-original"), seeds="0")
STEPS = (
    "1-paper", "2-tracks-known", "3-line-of-sight", "4-quadrotors", "5-pixels",
    "6-tracker", "7-process-noise", "8-optimizer", "9-default",
)  # fmt: skip


def walked(density):
    """The scenario and planner of each step."""
    return {
        dict(t.factors)["step"]: (t.setting, load_planner(t.planner))
        for t in tasks(WALK)
        if dict(t.factors)["lambda"] == density
    }


def differing(one, other):
    """Keys in which two scenarios differ."""
    a, b = (msgspec.to_builtins(setting) for setting in (one, other))
    return {
        f"{key}.{name}" if isinstance(a[key], dict) else key
        for key in a
        for name in (a[key] if isinstance(a[key], dict) else [""])
        if (a[key][name] != b[key][name] if isinstance(a[key], dict) else a[key] != b[key])
    }


def test_the_walk_ends_at_the_default():
    for density in ("15", "45", "75"):
        setting, planner = walked(density)["9-default"]
        assert differing(setting, Scenario()) <= {"trees.density"} and setting.trees.density == float(density)
        assert planner == load_planner(DEFAULT_PLANNER)


def test_the_walk_begins_at_the_papers_own_setting():
    """Of that it is SMA-NBO with MWTP and a horizon of five steps."""
    for density in ("15", "45", "75"):
        (first,) = [
            t
            for t in tasks(ORIGINAL)
            if t.planner.startswith("sma-nbo-mwtp") and dict(t.factors) == {"lambda": density, "H": "5"}
        ]
        setting, planner = walked(density)["1-paper"]
        assert setting == first.setting and planner == load_planner(first.planner)


def test_each_step_of_the_walk_takes_back_what_it_is_called():
    steps = walked("45")
    assert tuple(steps) == STEPS
    changes = [differing(steps[a][0], steps[b][0]) for a, b in itertools.pairwise(STEPS)]
    assert changes == [
        {"tracking.initial_tracks", "first_decision"},
        {"sensing.occlusion"},
        {"dynamics"},
        {"sensing.mode", "uavs"},
        {f"tracking.{k}" for k in ("detection_probability", "gate_probability", "absence_weight", "recovery_after")},
        {"tracking.sigma_a"},
        set(),
        set(),
    ]
    planners = [steps[step][1] for step in STEPS]
    assert len(set(planners[:7])) == 1 and len(set(planners[6:])) == 3
    assert planners[7].optimizer == "cross-entropy" and planners[7].visibility == "nominal"


def test_the_papers_setting_is_the_papers():
    """As its text and its public code say; the default has the rest: fields of view, alpha, area, rates, 40 s."""
    found = cells(ORIGINAL)
    assert len(found) == 3 * 3 * 3 + 2 * 2  # Dec-POMDP where the paper has it
    for task in tasks(ORIGINAL):
        s = task.setting
        assert (s.sensing.mode, s.sensing.occlusion, s.sensing.noise) == ("ideal", "disc", "range_bearing")
        assert (s.dynamics, s.first_decision, s.duration) == ("kinematic", 1.0, 40.0)
        assert (s.tracking.initial_tracks, s.tracking.sigma_a) == ("none", 1.0)
        assert (s.tracking.confirm, s.tracking.delete, s.tracking.life) == ((2, 3), (5, 5), "m_of_n")
        assert (s.network.fusion, s.network.rounds, s.network.links, s.network.loss) == ("kla", 5, (), 0.0)
        assert s.tracking.absence_weight == 0.0 and s.tracking.recovery_after > s.duration
        assert s.trees.canopy_radius == 5.0 and (s.area.width, s.area.height) == (150.0, 100.0)
        assert [(u.alpha, u.max_speed) for u in s.uavs] == [(0.1, 5), (0.15, 5), (0.12, 5)]
        edges = [2 * (u.altitude - TARGET_HEIGHT) * math.tan(math.radians(u.fov_deg / 2)) for u in s.uavs]
        assert edges == pytest.approx([20, 25, 22], abs=0.002)
        assert [u.start for u in s.uavs] == [u.start for u in Scenario().uavs]
        assert (s.rates.sensing, s.rates.planning, s.people.count) == (5, 1, 4)
        pieces = load_planner(task.planner)
        assert pieces.visibility == "nominal" and pieces.search == 0.0 and pieces.optimizer == "particle-swarm"
        assert (pieces.beta == 0.5) == task.planner.startswith("sma-nbo-mwtp")
        assert (pieces.actions == "first") == task.planner.startswith("mcr")
        assert pieces.horizon == int(dict(task.factors)["H"])
