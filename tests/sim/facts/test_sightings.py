"""People that a camera shows, and the trees that hide people."""

import math

import numpy as np
import pytest
from helpers import synthetic

from sim.facts.sightings import tell_sight
from sim.mission.recorder import Recorder
from sim.scenario.scenario import encode_scenario
from sim.views.frames.frame_facts import make_frame_facts
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree, at_target_height
from tracking.track import Track

CAMERA = Camera(math.radians(60), 128)


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
        "seen",
        "absent",
        "seen, cut by the edge",
        "out of view",
        "hidden by tree 3",
        "missed, partly hidden by tree 4",
        "hidden, though no tree is in the way",
    ]
    assert [person.detected for person in seen.people] == [False, True, False, True, False, False, False, False]
    # The line to (0, 8, 0.85) passes y = 5.2 at 6.6 m, y = 5.6 at 5.8 m and y = 6.7 at 3.5 m.
    trees = [Tree(0.0, 5.5, 0.5), Tree(0.0, 6.6, 0.5)]
    hidden = sight([(0.0, 8.0)], trees, visible=[0]).people[0]
    assert (hidden.hidden_by, hidden.status) == ({0: 1.0, 1: 1.0}, "hidden by trees 0 and 1")
    # Straight below the crowns, which overlap, beside one of the trunks and behind the other.
    leaves = [Tree(0.0, 1.0, 3.0, 3.0, 6.0, 0.2, 0.4), Tree(0.0, -1.0, 3.0, 2.0, 5.0, 0.2, 0.2)]
    part = sight([(0.0, 0.0)], leaves, visible=[4]).people[0]
    assert sight([(0.0, 0.0)], leaves, visible=[0]).people[0].status == "hidden, 59 % by trees 0 and 1"
    assert part.hidden_by == pytest.approx({0: 1 - math.exp(-0.6), 1: 1 - math.exp(-0.3)}, rel=1e-12)
    assert part.status == "missed, 59 % hidden by trees 0 and 1"
    part = sight([(0.0, -1.0)], leaves, visible=[4]).people[0]
    assert part.hidden_by[1] == 1.0 and part.status == "missed, partly hidden by trees 0 and 1"
    seen = sight([(0.0, 0.0)], [], visible=[9], tracks=[(70, 90), (70, 80, 90), (5, 80)])
    assert [track.number for track in seen.tracks] == [3, 2]


@pytest.mark.parametrize(("density", "hidden"), [(0.8, False), (40.0, True)])
def test_a_tree_hides_the_place_of_a_track_as_the_law_of_sight_says(density, hidden):
    """Leaves that cover more than half of the line of sight may still show a part of nearly every person."""
    tree = Tree(0.0, 0.0, 3.0, 3.0, 6.0, 0.2, density)
    forest, camera = Forest((tree,)), Pose.level(1.0, 0.0, 20.0)
    place = np.array([[1.0, 0.0]])
    share = forest.shares_hidden(camera.position, at_target_height(place))[0, 0]
    assert share > 0.5
    assert tell_sight(CAMERA, camera, place[0], forest) == ("hidden by tree 0" if hidden else "in view")
