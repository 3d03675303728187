"""People that a camera shows, the trees that hide people, and the outline of hidden ground."""

import math

import cv2
import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import recorded
from helpers.poses import tilted

from sim.facts.sightings import make_frame_facts, outline_cylinder, outline_hidden_ground, tell_sight
from sim.mission.recorder import Recorder
from sim.scenario.scenario import encode_scenario
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree, at_target_height
from tracking.track import Track

CAMERA = Camera(math.radians(60), 128)


@pytest.mark.parametrize("occlusion", ["line_of_sight", "disc"])
@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_outlines_hold_just_the_pixels_of_hidden_ground(tilt, occlusion):
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(15):
        trees = [Tree(*rng.uniform(-30, 30, 2), rng.uniform(0.5, 5), 3.0, rng.uniform(4, 7), 0.4) for _ in range(30)]
        forest = Forest(tuple(trees), occlusion)
        pose = tilted(rng, (*rng.uniform(-20, 20, 2), rng.uniform(8, 25)), tilt)
        uv = rng.uniform(0, 128, (300, 2))
        uv = uv[CAMERA.rays(pose, uv)[:, 2] < -0.01]
        ground = CAMERA.ground_points(pose, uv, TARGET_HEIGHT)
        hidden = ~forest.visible(pose.position, np.column_stack([ground, np.full(len(ground), TARGET_HEIGHT)]))[0]
        depths = np.full(len(uv), -np.inf)  # in pixels, inside the nearest outline
        for outline in (part for tree in outline_hidden_ground(CAMERA, pose, forest) for part in tree):
            polygon = outline.astype(np.float32)[:, None]
            depths = np.maximum(depths, [cv2.pointPolygonTest(polygon, p.tolist(), True) for p in uv])
        clear = np.abs(depths) > 0.1
        np.testing.assert_array_equal(depths[clear] > 0, hidden[clear])
        assert clear.mean() > 0.95
        shares.append(hidden.mean())
    assert 0.1 < np.mean(shares) < 0.9


def test_what_is_behind_the_camera_or_below_the_target_has_no_outline():
    upwards = Pose(np.array([0.0, 0.0, 20.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert outline_cylinder(CAMERA, upwards, np.array([0.0, 0.0, 2.0, 3.0, 6.0])).shape == (0, 2)
    assert outline_hidden_ground(CAMERA, upwards, Forest((Tree(0.0, 0.0),))) == [[]]
    forest = Forest((Tree(0.0, 0.0, 2.0, 0.3, 0.8),))
    assert outline_hidden_ground(CAMERA, Pose.level(0, 0, 20), forest) == [[]]


def sight(people, trees, *, visible, tracks=((),)):
    """The view of one UAV above the origin, 20 m on the ground, at the last of several scans."""
    setting = synthetic.scenario(uavs=1, people=len(people))
    recorder = Recorder()
    first = next(synthetic.snapshots(setting, Forest(()), 1))
    for k, held in enumerate(tracks):
        pose = Pose.level(0.0, 0.0, setting.uavs[0].altitude)
        values = {
            "time": k / setting.rates.sensing,
            "people": np.array(people, float),
            "visible": np.array([visible]),
            "matched": np.array([visible]) > 4,
            "cameras": [pose],
            "tracks": [tuple(Track(id_, Gaussian(np.zeros(4), np.eye(4))) for id_ in held)],
        }
        recorder.add(type(first)(**{**vars(first), **values}))
    recording = recorder.recording(scenario=encode_scenario(setting), planner="p", seed=0, forest=Forest(tuple(trees)))
    return make_frame_facts(recording, len(tracks) - 1, 0)


def test_every_person_and_track_is_named_with_trees_that_hide_people():
    # From 17.3 m above the origin: the line to (8, 0, 0.85) passes over x = 6.2 at a height of 4.5 m.
    trees = [Tree(40.0, 0.0), Tree(6.2, 0.0, 1.0), Tree(0.0, 3.0, 0.5), Tree(0.0, 7.0, 0.5), Tree(-6.0, 0.0, 1.0)]
    people = [(8.0, 0.0), (3.0, 0.0), (np.nan, np.nan), (10.2, 0.0), (20.0, 0.0), (0.0, 7.1), (-6.0, 0.0), (1.0, -5.0)]
    seen = sight(people, trees, visible=[0, 9, 0, 5, 0, 0, 3, 0])
    assert [person.status for person in seen.people] == [
        "hidden by tree 1",
        "in view",
        "absent",
        "cut by the edge",
        "outside the view",
        "hidden by tree 3",
        "partly hidden by tree 4",
        "not shown, though no tree is in the way",
    ]
    assert [person.detected for person in seen.people] == [False, True, False, True, False, False, False, False]
    # The line to (0, 8, 0.85) passes y = 5.2 at 6.6 m, y = 5.6 at 5.8 m and y = 6.7 at 3.5 m.
    trees = [Tree(0.0, 5.5, 0.5), Tree(0.0, 6.6, 0.5)]
    hidden = sight([(0.0, 8.0)], trees, visible=[0]).people[0]
    assert (hidden.hidden_by, hidden.status) == ({0: 1.0, 1: 1.0}, "hidden by trees 0 and 1")
    # Straight below the crowns, which overlap, beside one of the trunks and behind the other.
    leaves = [Tree(0.0, 1.0, 3.0, 3.0, 6.0, 0.2, 0.4), Tree(0.0, -1.0, 3.0, 2.0, 5.0, 0.2, 0.2)]
    part = sight([(0.0, 0.0)], leaves, visible=[4]).people[0]
    assert part.hidden_by == pytest.approx({0: 1 - math.exp(-0.6), 1: 1 - math.exp(-0.3)}, rel=1e-12)
    assert part.status == "59 % hidden by trees 0 and 1"
    part = sight([(0.0, -1.0)], leaves, visible=[4]).people[0]
    assert part.hidden_by[1] == 1.0 and part.status == "partly hidden by trees 0 and 1"
    seen = sight([(0.0, 0.0)], [], visible=[9], tracks=[(70, 90), (70, 80, 90), (5, 80)])
    assert [track.id for track in seen.snapshot.tracks[0]] == [3, 2]


def test_measurements_lie_on_their_detections_through_the_camera_that_the_uav_believes():
    wrong = ("uavs.0.camera=thermal-640", "uavs.0.camera.scale=0.25", "uavs.0.camera.believed.focal=[700, 705]")
    recording = recorded(*wrong, "sensing.noise=camera", "trees.density=0", "uavs.0.navigation=gnss", duration=1)
    gaps, others = [], []
    for k in range(len(recording.times)):
        facts = make_frame_facts(recording, k, 0)
        points = at_target_height(recording.scan_at(k, 0).measurements)
        pixels = recording.pixels_at(k, 0)
        gaps += np.hypot(*(facts.believed_camera.project(facts.believed, points)[0] - pixels).T).tolist()
        others += np.hypot(*(facts.camera.project(facts.believed, points)[0] - pixels).T).tolist()
    assert len(gaps) > 5 and np.median(gaps) < 1e-6 and np.median(others) > 1.0  # people at the edge are cut


@pytest.mark.parametrize(("density", "hidden"), [(0.8, False), (40.0, True)])
def test_a_tree_hides_the_place_of_a_track_as_the_law_of_sight_says(density, hidden):
    """Leaves that cover more than half of the line of sight may still show a part of nearly every person."""
    tree = Tree(0.0, 0.0, 3.0, 3.0, 6.0, 0.2, density)
    forest, camera = Forest((tree,)), Pose.level(1.0, 0.0, 20.0)
    place = np.array([[1.0, 0.0]])
    share = forest.shares_hidden(camera.position, at_target_height(place))[0, 0]
    assert share > 0.5
    assert tell_sight(CAMERA, camera, place[0], forest) == (
        "hidden by tree 0" if hidden else "in view but not detected"
    )
