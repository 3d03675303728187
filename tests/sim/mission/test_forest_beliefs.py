"""A UAV's belief of the forest changes in flight: what asks for it at that time, and nothing of another UAV."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.flights import IDEAL, fly, recording_of

from planning.baselines import Greedy
from planning.prediction.propagation import Nominal
from sim.facts.sightings import tell_map_error
from sim.facts.tracking_replay import replay_tracking
from sim.mission.archive import compute_digest, load_recording, save
from sim.mission.forest_beliefs import make_forest_beliefs
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Detections
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.unseen_ground import expect_unseen_trees
from tracking.geometry.visibility import Forest, Tree, visible_samples

CHANGE = 50  # the scan at 10 s


class Learns:
    """In place of a mapper: all but a third of the trees are lost to UAV 0 from `CHANGE` on, and most ground unseen."""

    def __init__(self, scenario, forest, seed, change=CHANGE):
        self.given = make_forest_beliefs(scenario, forest, seed).believed(0)
        self.change, self.scans, self.frames = change, 0, []
        ground = np.full((20, 30), np.nan)
        ground[8:10, 14:16] = 1.0
        unseen = expect_unseen_trees(Raster.over((150.0, 100.0), ground), 5.0)
        kept = self.given.trees[::3]
        deviations = tuple(np.linspace(0.1, 1.0, len(kept)).tolist())
        self.learned = Forest(kept, self.given.occlusion, deviations, unseen, Tree(0.0, 0.0))

    def observe(self, time, frames):
        self.scans += 1
        self.frames += frames
        return ()

    def share(self, time, links, working, relay):
        return None

    def believed(self, uav):
        return self.learned if uav == 0 and self.scans > self.change else self.given


class Asked(Greedy):
    def __init__(self):
        self.teams = []

    def plan(self, team, rng):
        self.teams.append({situation.own.id: situation for situation in team})
        return super().plan(team, rng)


@pytest.fixture(scope="module")
def flown():
    planner = Asked()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sim.mission.mission.make_forest_beliefs", Learns)
        mission, snapshots = fly(*IDEAL, "trees.density=75", planner=planner, seed=3, duration=12)
    return mission, planner, recording_of(mission, snapshots, seed=3)


def is_learned(forest, mission):
    assert forest.trees in (mission.beliefs.given.trees, mission.beliefs.learned.trees)
    return forest.trees == mission.beliefs.learned.trees


def test_the_planner_of_that_uav_expects_other_views_from_then_on(flown):
    mission, planner, _ = flown
    changed = 0
    for team in planner.teams:
        for uav, situation in team.items():
            predicted = Nominal().predict(situation, 3, np.random.default_rng(0))
            before = Nominal().predict(replace(situation, forest=mission.beliefs.given), 3, np.random.default_rng(0))
            same = np.array_equal(predicted.blockers, before.blockers)
            assert is_learned(situation.forest, mission) == (not same) == (uav == 0 and situation.time >= 10.0)
            changed += not same
    assert changed == 3  # at 10, 11 and 12 s


def test_the_tracker_of_that_uav_has_other_probabilities_of_detection_from_then_on(flown):
    mission, _, recording = flown
    replay, differ = replay_tracking(recording), 0
    assert not replay.note and len(replay.states) == 61  # the same tracks bit for bit, by the recorded beliefs
    for k, uav in np.ndindex(61, recording.uav_count):
        before, lens = replay.association(k, uav).before, recording.scan_at(k, uav).pose
        lens = mission.scenario.believed_camera(uav).lens(lens)
        given, learned = (
            visible_samples(forest, before.means, before.covariances, lens)[:, 0].mean(axis=1)
            for forest in (mission.beliefs.given, mission.beliefs.learned)
        )
        changes = uav == 0 and k >= CHANGE
        np.testing.assert_array_equal(before.visible, learned if changes else given)
        differ += changes and not np.array_equal(given, learned)
    assert differ > 5


def test_explanations_of_that_uav_say_what_it_believed_from_then_on(flown, tmp_path):
    mission, _, recording = flown
    save(recording, tmp_path / "mission.npz")
    found = load_recording(tmp_path / "mission.npz")
    assert compute_digest(found) == compute_digest(recording)
    told = set()
    for k, uav, person in np.ndindex(found.visible.shape):
        assert is_learned(found.believed_at(k, uav), mission) == (uav == 0 and k >= CHANGE)
        lines = tell_map_error(found, k, uav, person)
        assert not lines or (uav == 0 and k >= CHANGE)
        told |= set(lines)
    assert "on ground not yet seen by the map that UAVs believe" in told
    learned, original = found.believed_at(60, 0), mission.beliefs.learned
    np.testing.assert_array_equal(learned.blockers, original.blockers)
    np.testing.assert_array_equal(learned.grid.unknown.values, original.grid.unknown.values)


@pytest.mark.parametrize(
    ("field", "wrong", "told"),
    [
        ("maps", lambda maps: maps + 7, "name a map that is not there"),
        ("map_sizes", lambda sizes: sizes + 1, "are not the numbers of"),
        ("map_trees", lambda trees: -trees, "have a radius below 0"),
        ("map_unknown", lambda unknown: -unknown - 1.0, "are no numbers of trees"),
        ("map_unknown", lambda unknown: None, "come without"),
    ],
)
def test_a_recording_with_other_maps_than_a_mission_has_is_refused(flown, tmp_path, field, wrong, told):
    _, _, recording = flown
    save(replace(recording, **{field: wrong(getattr(recording, field))}), tmp_path / "mission.npz")
    with pytest.raises(ValueError, match=told):
        load_recording(tmp_path / "mission.npz")


class Sees(BlobDetector):
    """Keeps the maps that frames come with."""

    maps: list = []  # noqa: RUF012 - of all instances

    def detect(self, frame):
        self.maps.append((frame.uav, frame.time, frame.forest))
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))


def test_frames_come_to_the_beliefs_first_and_then_with_them_to_the_detector(monkeypatch):
    monkeypatch.setattr("sim.mission.mission.make_forest_beliefs", lambda *given: Learns(*given, change=1))
    mission, snapshots = fly(f"sensing.detector={__name__}:Sees", duration=0.4)
    beliefs = mission.beliefs
    assert [(frame.uav, frame.image.shape[2]) for frame in beliefs.frames] == [(0, 3), (1, 3), (2, 3)] * 3
    assert len(Sees.maps) == 9
    for uav, time, forest in Sees.maps:
        assert forest is snapshots[round(5 * time)].scans[uav].forest
        assert forest is (beliefs.learned if uav == 0 and time > 0.1 else beliefs.given)
