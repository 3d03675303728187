"""A UAV that breaks down leaves its fleet and all counts, and is marked in every view of the mission."""

import json

import numpy as np
import pytest
from helpers.films import frames_of
from helpers.flights import fly_ideal as fly
from helpers.flights import recording_of
from helpers.studies import task_of
from helpers.summaries import summary
from helpers.teams import Spy, with_little_effort

from planning.catalogue import PLANNERS
from sim.facts.flight import find_scans
from sim.mission.archive import load_recording
from sim.mission.fault import Fault
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.study.trial_flight import fly_trial
from tracking.errors import InputError

BROKEN = "broke down, hovers from now on"


@pytest.mark.parametrize(
    ("planner", "dynamics"), [*((name, "kinematic") for name in sorted(PLANNERS)), ("sma-nbo-mwtp", "quadrotor")]
)
def test_every_planner_flies_on_without_the_first_uav(planner, dynamics):
    mission, snapshots = fly(
        "uavs.0.fails_at=0.5", f"dynamics={dynamics}", planner=with_little_effort(planner), duration=2
    )
    assert mission.faults == [Fault(0.5, 0, BROKEN)]
    for s in snapshots:
        before = s.time < 0.5
        assert s.working == ([0, 1, 2] if before else [1, 2])
        unknown = np.isnan(s.ospa)
        assert unknown.any(axis=1).tolist() == unknown.all(axis=1).tolist() == [not before, False, False]
        if before:
            continue
        assert s.tracks[0] == () and len(s.scans[0].measurements) == 0 and s.bytes_sent[0] == 0
        assert not s.visible[0].any() and not s.matched[0].any()
        assert s.plans is None or [len(plan.controls) > 0 for plan in s.plans] == [False, True, True]
        if s.time > 0.6:
            np.testing.assert_array_equal(s.commands[0], 0.0)
    places = np.array([s.poses[0].position for s in snapshots if s.time > 1.5])
    slack = 0.05 if dynamics == "quadrotor" else 0
    np.testing.assert_allclose(places, np.tile(places[0], (len(places), 1)), atol=slack)


def test_a_uav_that_broke_down_is_no_neighbour_and_has_no_intent():
    """And ids are told apart from places in the team."""
    planner = Spy(lambda s: [[0.1 * s.own.id, 0.0]])
    _, snapshots = fly("uavs.1.fails_at=1.2", planner=planner, duration=3)
    heard = [[(s.own.id, [v.id for v in s.neighbours], sorted(s.intents)) for s in team] for team in planner.teams]
    every = [(0, [1, 2]), (1, [0, 2]), (2, [0, 1])]
    assert heard[0] == [(i, others, []) for i, others in every]
    assert heard[1] == [(i, others, [0, 1, 2]) for i, others in every]
    assert heard[2:] == [[(0, [2], [0, 2]), (2, [0], [0, 2])]] * 2
    assert snapshots[-1].commands[:, 0].tolist() == [0.0, 0.0, 0.2]


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_the_others_take_over_the_people_of_a_uav_that_breaks_down(seed):
    """In the open, tracked by a planner: no track is lost and no label changes."""
    mission, snapshots = fly("uavs.1.fails_at=4", "trees.density=0", planner="sma-nbo-mwtp", seed=seed, duration=12)
    assert mission.faults == [Fault(4.0, 1, BROKEN)]
    held = [[sorted(t.id for t in s.tracks[i]) for i in s.working] for s in snapshots]
    assert {tuple(ids) for scan in held for ids in scan} == {(0, 1, 2, 3)}
    recording = recording_of(mission, snapshots)
    assert min(summary(recording)["people_held"]) > 0.9
    for person in range(4):  # at the end each id is still that person's
        (track,) = [t for t in snapshots[-1].tracks[0] if t.id == person]
        assert np.linalg.norm(track.belief.mean[:2] - snapshots[-1].people[person]) < 2.0


def test_a_breakdown_changes_neither_forest_nor_people_nor_messages_of_others():
    lossy = ("network.loss=0.5", "network.links=[[0, 1]]")
    (one, whole), (other, broken) = fly(*lossy), fly(*lossy, "uavs.2.fails_at=0")
    assert one.forest.trees == other.forest.trees
    for a, b in zip(whole, broken, strict=True):
        np.testing.assert_array_equal(a.people, b.people)
        np.testing.assert_array_equal(a.bytes_sent[:2], b.bytes_sent[:2])
    # Before the noise of sensors parts ways, with the first measurement of the one that is there or not.
    np.testing.assert_array_equal(whole[0].ospa[:2], broken[0].ospa[:2])


def test_a_mission_without_working_uavs_is_flown_and_shown_to_its_end(tmp_path, without_pictures):
    ends = [f"uavs.{i}.fails_at={(4 + 2 * i) / 10}" for i in range(3)]
    setting = load_scenario("forest", ["duration=2", "sensing.mode=ideal", *ends])
    found = run_mission(Trial(setting, "greedy", 0), tmp_path / "out")
    assert [(f["time"], f["uav"]) for f in found["faults"]] == [(0.4, 0), (0.6, 1), (0.8, 2)]
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    recording = load_recording(tmp_path / "out" / "mission.npz")
    assert recording.working.sum(axis=0).tolist() == [2, 3, 4] and recording.plan_times.tolist() == [0.0]
    known = recording.ospa[:, :, 0][recording.working]
    assert found["ospa"]["mean_m"] == known.mean() and len(known) == 9
    assert found["ospa"]["share_under_1m"] == np.mean(known < 1)
    assert frames_of(tmp_path / "out" / "mission.mp4") == ("h264", 11)
    found = fly_trial(task_of(setting, "greedy", 0)).row.metrics
    assert found["ospa.mean_m"] == pytest.approx(known.mean())
    assert found["faults"] == 0  # of plug-ins


def test_frames_after_a_breakdown_are_refused_and_the_command_says_when(call, refused):
    recording = recording_of(*fly("uavs.1.fails_at=0.5", "uavs.2.fails_at=0", duration=2))
    assert recording.setting.uavs[1].fails_at == 0.5
    assert find_scans(recording, 0.0, 0.4, 1) == [0, 1, 2]
    assert find_scans(recording, 0.0, 2.0, 0) == list(range(11))
    with pytest.raises(InputError, match=r"^--time: at 0\.6 s UAV 1 had broken down; its last scan is that at 0\.4 s$"):
        find_scans(recording, 0.4, 0.8, 1)
    with pytest.raises(InputError, match=r"^--time: at 0 s UAV 2 had broken down; it never worked$"):
        find_scans(recording, 0.0, None, 2)
    options = ["--duration", "1", "--set", "sensing.mode=ideal", "--set", "uavs.2.fails_at=0.4", "--no-video"]
    assert f"fault at 0.4 s, UAV 2: {BROKEN}" in call("run", "--out", "out", "--planner", "hover", *options)[1]
    told = refused("frames", "out", "--uav", "2", "--time", "0.8")
    assert told == "understory: --time: at 0.8 s UAV 2 had broken down; its last scan is that at 0.2 s\n"
