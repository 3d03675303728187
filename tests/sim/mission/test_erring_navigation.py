"""Missions whose UAVs do not know their poses: truth flies and renders, and everybody else has the belief."""

import dataclasses

import numpy as np
import pytest

from planning.planner import Plan
from sim.facts.rerender import Rerenderer
from sim.facts.tracking_replay import replay_tracking
from sim.mission.archive import load_recording, save
from sim.mission.mission import Mission
from sim.mission.recorder import Recorder
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import encode_scenario
from tracking.errors import InputError
from tracking.registration.pose_errors import move_to_believed

ERRING = ("duration=3", "trees.density=15", "uavs.1.navigation=consumer", "uavs.2.navigation.clock_deviation=0.4")


class East:
    def plan(self, team, rng):
        return [Plan(np.tile([2.0, 0.0], (2, 1))) for _ in team]


def fly(*overrides, seed=3):
    return list(Mission(load_scenario("forest", [*ERRING, *overrides]), East(), seed).fly())


@pytest.fixture(scope="module")
def flown():
    return fly()


def test_belief_differs_where_navigation_errs_and_planners_have_it(flown):
    mission = Mission(load_scenario("forest", ERRING), East(), 3)
    while not mission.over:
        team = mission.team
        now = mission.step()
        assert now.believed[0] is now.cameras[0]
        for own in [situation.own for situation in team]:
            np.testing.assert_array_equal(own.position, now.believed[own.id].position)
        gap = now.believed[2].position - now.cameras[2].position
        np.testing.assert_array_equal(now.scans[1].pose.position, now.believed[1].position)
    assert abs(gap[0]) > 0.1  # 2 m/s for the offset of the clock
    np.testing.assert_allclose(gap[1:], 0.0, atol=0.02)
    assert np.hypot(*(now.believed[1].position - now.cameras[1].position)[:2]) > 0.1


def test_errors_of_one_uav_change_neither_truth_nor_those_of_others(flown):
    other = fly("uavs.0.navigation=gnss", "sensing.mode=ideal")
    for a, b in zip(flown, other, strict=True):
        np.testing.assert_array_equal(a.people, b.people)
        np.testing.assert_array_equal(
            a.believed[1].position - a.cameras[1].position, b.believed[1].position - b.cameras[1].position
        )
    assert not np.array_equal(other[0].believed[0].position, other[0].cameras[0].position)


def test_detections_are_where_their_rays_meet_the_ground_from_the_believed_pose():
    exact = ("duration=0.6", "sensing.mode=ideal", "uavs.0.alpha=1e-6", "uavs.1.alpha=1e-6", "uavs.2.alpha=1e-6")
    for snapshot in fly(*exact):
        for scan, true, believed, matched in zip(
            snapshot.scans, snapshot.cameras, snapshot.believed, snapshot.matched, strict=True
        ):
            expected = move_to_believed(snapshot.people[matched], true, believed)
            np.testing.assert_allclose(np.sort(scan.measurements, axis=0), np.sort(expected, axis=0), atol=0.02)


def test_recordings_have_truth_and_belief_and_can_be_rendered_and_tracked_again(tmp_path):
    mission = Mission(load_scenario("forest", ERRING), East(), 3)
    images = []
    recorder = Recorder()
    for snapshot in mission.fly():
        recorder.add(snapshot)
        images.append(mission.images)
    flown = recorder.recording(
        scenario=encode_scenario(mission.scenario), planner="east", seed=3, forest=mission.forest
    )
    save(flown, tmp_path / "a.npz")
    read = load_recording(tmp_path / "a.npz")
    np.testing.assert_equal(dataclasses.asdict(read), dataclasses.asdict(flown))
    assert read.believed.shape == read.cameras.shape and not np.array_equal(read.believed, read.cameras)
    replay = replay_tracking(read)
    assert replay.note == "" and len(replay.states) == len(read.times)
    with Rerenderer(read) as again:
        for k in (0, 7, 15):
            for i in range(3):
                np.testing.assert_array_equal(again.image(k, i), images[k][i])


def test_exact_navigation_leaves_no_array_in_a_recording():
    for snapshot in Mission(load_scenario("forest", ["duration=0.2"]), East()).fly():
        assert snapshot.believed is None


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "uavs.0.navigation=gnsss",
            "uavs.0: navigation: 'gnsss' is unknown; allowed are exact, rtk, gnss, consumer; did you mean gnss?",
        ),
        ("uavs.1.navigation.yaw=1", "uavs.1.navigation.yaw: unknown key; "),
    ],
)
def test_wrong_figures_are_told_in_one_line(setting, message):
    with pytest.raises(InputError) as error:
        load_scenario("forest", [setting])
    assert message in str(error.value) and "\n" not in str(error.value)
