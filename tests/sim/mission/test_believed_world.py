"""Missions in which UAVs believe another world than the true one."""

import dataclasses

import numpy as np
import pytest
from helpers.flights import IDEAL, fly, fly_ideal, recorded, recording_of

from planning.baselines import Hover
from sim.facts.sightings import find_sightings, tell_map_error
from sim.facts.tracking_replay import replay_tracking
from sim.mission.archive import compute_digest, load_recording, save
from sim.mission.tracker_setup import make_planned_motion, make_tracker_parameters
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario, encode_scenario
from sim.views.drawing.map_view import MapView
from sim.views.scene import Scene
from tracking.errors import InputError
from tracking.geometry.visibility import Forest, Tree

ERRORS = ("believed.tree_shift=1", "believed.trees_missing=0.3", "believed.trees_invented=0.2")


class Asked(Hover):
    """Hovers, and keeps the situations."""

    def __init__(self):
        self.team = []

    def plan(self, team, rng):
        self.team += team
        return super().plan(team, rng)


def test_a_recording_without_errors_says_nothing_of_them():
    assert "believed" not in encode_scenario(Scenario())
    assert '"believed":{"tree_shift":1.0' in encode_scenario(load_scenario("forest", ERRORS))


def test_the_world_stays_true_and_planners_search_and_trackers_get_what_is_believed():
    search, seen = ("tracking.initial_tracks=none",), ("believed.trees_missing=1",)
    planner = Asked()
    true, snapshots = fly_ideal(*search, planner=Asked(), seed=3)
    wrong, others = fly_ideal(*search, *seen, planner=planner, seed=3)
    assert wrong.forest.trees == true.forest.trees != ()
    assert wrong.beliefs.believed(0).trees == () and true.beliefs.believed(0) is true.forest
    assert all(situation.forest.trees == () for situation in planner.team)
    for one, other in zip(snapshots, others, strict=True):
        np.testing.assert_array_equal(one.people, other.people)
        np.testing.assert_array_equal(one.visible, other.visible)  # true trees hide people
        for a, b in zip(one.scans, other.scans, strict=True):
            np.testing.assert_array_equal(a.measurements, b.measurements)
    # In an empty forest all that the square of a camera shows has been seen, in the true one a part.
    left = [team[-1].undetected.people.sum() for team in (planner.team, true.planner.team)]
    assert left[0] < left[1]


def test_planners_and_trackers_reckon_with_errors_of_the_map_and_detectors_do_not():
    planner = Asked()
    mission, _ = fly("believed.tree_deviation=0.5", "believed.trees_unknown=0.2", planner=planner, duration=0.2)
    maps = [situation.forest for situation in planner.team]
    believed = mission.beliefs.believed(0)
    assert all((m.deviation, m.unknown) == (0.5, believed.unknown) for m in maps) and maps[0].unknown > 0
    assert believed.as_mapped.blockers.shape[1] == 6 and believed.as_mapped.trees == mission.forest.trees


def test_hidden_people_are_given_up_by_trackers_that_do_not_know_the_trees():
    def count_held(*errors):
        return len(fly_ideal("trees.density=75", *errors, duration=20)[1][-1].tracks[0])

    assert count_held() == 4 and count_held("believed.trees_missing=1") == 2


def test_detectors_locate_people_with_the_believed_map():
    def measured(*errors):
        mission, snapshots = fly("sensing.noise=camera", *errors, duration=4, seed=1)
        return mission, [z for s in snapshots for scan in s.scans for z in scan.measurements.tolist()]

    (true, one), (wrong, other) = measured(), measured("believed.tree_shift=1")
    assert true.forest.trees == wrong.forest.trees and len(one) == len(other) and one != other
    moved = [np.linalg.norm(np.subtract(a, b)) for a, b in zip(one, other, strict=True)]
    assert np.quantile(moved, 0.4) == 0.0 < 0.1 < max(moved) < 1.0  # those cut by a tree only


@pytest.mark.parametrize("sensing", [(), IDEAL, ("sensing.occlusion=disc",)])
def test_a_recording_tells_what_was_believed_and_its_trackers_run_again(tmp_path, sensing):
    mission, snapshots = fly(*ERRORS, *sensing, planner="greedy", seed=3, duration=4)
    recording = recording_of(mission, snapshots, seed=3)
    save(recording, tmp_path / "mission.npz")
    found = load_recording(tmp_path / "mission.npz")
    believed = mission.beliefs.believed(0).trees
    assert found.believed_forest.trees == believed != found.forest.trees == mission.forest.trees
    assert found.believed_forest.occlusion == mission.scenario.sensing.occlusion
    replay = replay_tracking(found)
    assert not replay.note and len(replay.states) == len(snapshots)


def test_the_same_seed_flies_the_same_mission_and_repeats_believe_the_same_map():
    one, again = (recorded(*IDEAL, *ERRORS, duration=3) for _ in range(2))
    assert compute_digest(one) == compute_digest(again)
    maps = [fly_ideal(*ERRORS, seed=3, duration=1, repeat=n)[0].beliefs.believed(0).trees for n in (0, 1)]
    assert maps[0] == maps[1]


def test_what_trackers_and_planners_expect_of_people_and_detectors_is_off_by_the_factors():
    errors = ("believed.speed=2", "believed.sigma_a=3", "believed.misses=5", "tracking.motion=mean-reverting")
    setting = load_scenario("forest", errors)
    parameters, true = make_tracker_parameters(setting), setting.tracking
    assert parameters.settings.detection_probability == pytest.approx(0.95)
    assert (parameters.settings.max_speed, parameters.settings.walking_speed) == (6.0, 3.5)
    assert parameters.motion.sigma_a == make_planned_motion(setting).sigma_a == 3 * true.sigma_a
    assert parameters.motion.walking_speed == 3.5
    assert (true.detection_probability, true.max_speed) == (0.99, 3.0)  # as set
    assert make_tracker_parameters(Scenario()).settings == Scenario().tracking
    assert dataclasses.replace(make_planned_motion(setting), walking_speed=1.75, sigma_a=0.75) == make_planned_motion(
        Scenario()
    )


def test_explanations_say_where_the_believed_map_has_a_person_in_view_or_hidden():
    recording = recorded(*IDEAL, "trees.density=75", "believed.trees_missing=1", duration=3)
    told = 0
    for k, uav, person in np.ndindex(recording.visible.shape):
        sighting = find_sightings(recording, k, uav, recording.setting.true_camera(uav))[person]
        lines = tell_map_error(recording, k, uav, person)
        assert lines == (["in view by the map that UAVs believe"] if sighting.state == "hidden" else [])
        told += len(lines)
    assert told > 10
    exact = recorded(*IDEAL, "trees.density=75", duration=0.2)
    assert not any(tell_map_error(exact, 0, *who) for who in np.ndindex(exact.visible.shape[1:]))


def test_maps_outline_the_believed_crowns_that_are_not_there():
    setting, true = load_scenario("forest"), Forest((Tree(-20.0, 10.0), Tree(30.0, 0.0)))
    believed = Forest((Tree(-20.0, 10.0), Tree(33.0, 0.0)))
    size = (900, 600)
    plain, same, other = (MapView(setting, true, size, map_) for map_ in (None, Forest(true.trees), believed))
    images = [view.draw(Scene(0.0, 0.0, False, False, (), (), (), (), None))[0] for view in (plain, same, other)]
    np.testing.assert_array_equal(images[0], images[1])
    rows, columns = np.nonzero((images[0] != images[2]).any(axis=2))
    away = np.hypot(*(np.column_stack([columns, rows]) - other.pixels([33.0, 0.0])).T) / other.scale
    assert len(away) > 30 and np.abs(away - 5.0).max() < 3 / other.scale


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("believed.trees_missing=1.2", "believed.trees_missing: 1.2 is not allowed; expected `float` <= 1"),
        ("believed.tree_shift=nan", "believed.tree_shift: nan is not allowed"),
        ("believed.leaf_area=0", "believed.leaf_area: 0 is not allowed"),
        ("believed.shift=1", "believed.shift: unknown key"),
        ("believed.misses=100", "believed.misses: 100 times the 0.01 that tracking.detection_probability leaves"),
    ],
)
def test_a_wrong_error_is_refused_in_a_line(wrong, told):
    with pytest.raises(InputError, match=told.replace("`", ".")):
        load_scenario("forest", [wrong])
