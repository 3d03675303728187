"""Missions of UAVs that hover at first: no planner is asked, nothing is sent, and the tracker works all the while."""

import numpy as np
import pytest

from planning.loading import load_planner
from sim.mission.mission import Mission, Trial
from sim.recording.archive import load as load_recording
from sim.running.run import run
from sim.scenario.loading import load
from sim.scenario.scenario import Scenario

IDEAL = ["sensing.mode=ideal", "dynamics=kinematic", "trees.density=0", "duration=4"]


class Asked:
    """Hovers elsewhere than here: flies east, and notes when it is asked."""

    def __init__(self):
        self.times = []

    def plan(self, team, rng):
        self.times.append(team[0].time)
        plans = load_planner("hover").plan(team, rng)
        for plan in plans:
            plan.controls[:, 0] = 2.0
        return plans


@pytest.mark.parametrize(("first", "asked"), [(0, [0, 1, 2, 3, 4]), (1, [1, 2, 3, 4]), (3, [3, 4]), (4, [4])])
def test_uavs_hover_until_the_first_decision(first, asked):
    planner = Asked()
    snapshots = list(Mission(load("forest", [*IDEAL, f"first_decision={first}"]), planner, 0).fly())
    assert planner.times == asked
    starts = np.array([uav.start for uav in Scenario().uavs])
    for snapshot in snapshots:
        moved = np.array([pose.position[:2] for pose in snapshot.poses]) - starts
        np.testing.assert_allclose(moved, [[2.0 * max(0.0, snapshot.time - first), 0.0]] * 3, atol=1e-9)
        assert (snapshot.plans is not None) == (snapshot.time in asked)
        assert np.all(snapshot.plan_bytes == 0) or snapshot.time in asked
    assert all(scan.measurements.size for scan in snapshots[0].scans)


def test_what_is_sensed_meanwhile_is_the_same():
    """Hovering draws nothing: until the first decision a mission is that of a planner that hovers."""
    scenario = load("forest", [*IDEAL, "first_decision=2", "tracking.initial_tracks=none"])
    later = list(Mission.of(Trial(scenario, "sma-nbo(evaluations=64)", 3)).fly())
    still = list(Mission.of(Trial(scenario, "hover", 3)).fly())
    for one, other in zip(later[:11], still, strict=False):
        assert np.array_equal(one.ospa, other.ospa)
        assert [len(t) for t in one.tracks] == [len(t) for t in other.tracks]
    assert len(later[3].tracks[0]) == 4 and Scenario().first_decision == 0.0


def test_a_mission_that_hovers_at_first_is_recorded_and_shown(tmp_path):
    scenario = load("forest", [*IDEAL, "first_decision=2"])
    run(Trial(scenario, "greedy", 0), tmp_path / "out")
    recording = load_recording(tmp_path / "out" / "mission.npz")
    np.testing.assert_array_equal(recording.plan_times, [2.0, 3.0, 4.0])
    assert recording.plans_at(0) is None
    for name in ("mission.html", "mission.mp4", "timeline.png", "summary.json"):
        assert (tmp_path / "out" / name).is_file()
