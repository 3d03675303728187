"""Contacts of UAVs are noticed, recorded, summarised and shown; near misses are not."""

import dataclasses
import json

import numpy as np
import pytest
from helpers import synthetic
from helpers.flights import fly_ideal
from helpers.recordings import record
from helpers.summaries import shown, summary
from helpers.teams import Spy

from sim.facts.metrics.fleet_facts import list_contacts
from sim.mission.archive import load_recording, save
from sim.mission.recorder import Recorder
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.views.drawing.labels import Labels
from sim.views.drawing.map_view import MapView
from sim.views.drawing.palette import ALARM
from sim.views.scene import ALERT, SceneMaker
from sim.world.contacts import KINDS, Contact, describe_body
from sim.world.world import World
from tracking.geometry.visibility import Forest, Tree

APART = 6.0  # m


def approach(dynamics, offset):
    """Scenario of two UAVs of one altitude, the second one ahead of the first, `offset` m aside."""
    return Scenario(dynamics=dynamics, uavs=(Uav(start=(0.0, 0.0)), Uav(start=(APART, offset))))


@pytest.mark.parametrize("dynamics", ["quadrotor", "kinematic"])
@pytest.mark.parametrize(("offset", "expected"), [(0.1, (Contact(0, "uav", 1),)), (0.5, ())])
def test_uavs_on_a_collision_course_touch_once_they_meet(dynamics, offset, expected):
    with World(approach(dynamics, offset), Forest(()), 0) as world:
        for _ in range(240):  # a second at 1 m/s each leaves 4 m between them
            world.step(np.array([[1.0, 0.0], [-1.0, 0.0]]))
        assert world.take_contacts() == ()
        for _ in range(600):
            world.step(np.array([[1.0, 0.0], [-1.0, 0.0]]))
        assert world.take_contacts() == expected and world.take_contacts() == ()


@pytest.mark.parametrize("dynamics", ["quadrotor", "kinematic"])
@pytest.mark.parametrize("kind", ["canopy", "trunk"])
def test_a_uav_flown_into_a_tree_touches_that_tree(dynamics, kind):
    """No scenario lets trees reach up to a UAV, so the world is given a forest that does."""
    setting = Scenario(dynamics=dynamics, uavs=(Uav(start=(0.0, 0.0)),))
    base = 10.0 if kind == "canopy" else 25.0  # the UAV flies at 17.3 m
    trees = (Tree(0.0, 20.0), Tree(4.0, 0.0, 2.0, base, 30.0), Tree(-30.0, 0.0))
    with World(setting, Forest(trees), 1) as world:
        for _ in range(240 * 3):
            world.step(np.array([[2.0, 0.0]]))
        assert world.take_contacts() == (Contact(0, kind, 1),)
        if dynamics == "quadrotor":
            assert world.poses()[0].position[0] < 4.0


def test_contacts_of_missions_are_recorded_and_come_back_from_the_disk(tmp_path):
    fleet = f"uavs=[{{start=[0, 0]}}, {{start=[{APART}, 0]}}]"
    _, snapshots = fly_ideal("trees.density=0", fleet, planner=Spy(lambda s: [[1.0 - 2.0 * s.own.id, 0.0]]))
    touching = [s.time for s in snapshots if s.contacts]
    # Bodies 0.34 m wide that close 6 m at 2 m/s touch from 2.83 s, before the scan at 3.0 s, to 3.17 s, before 3.2 s.
    assert touching == [3.0, 3.2] and {c for s in snapshots for c in s.contacts} == {Contact(0, "uav", 1)}
    recording = record()
    save(recording, tmp_path / "mission.npz")
    read = load_recording(tmp_path / "mission.npz")
    expected = [(Contact(0, "canopy", 4), Contact(2, "ground", 0)) if 3 <= k <= 5 else () for k in range(11)]
    assert [read.contacts_at(k) for k in range(11)] == expected
    assert [read.snapshot(k).contacts for k in range(11)] == expected
    setting = synthetic.scenario(uavs=1)
    recorder = Recorder()
    for snapshot in list(synthetic.snapshots(setting, Forest(()), 6))[3:]:
        recorder.add(snapshot)
    recording = recorder.recording(scenario="{}", planner="p", seed=0, forest=Forest(()))
    assert recording.contacts[:, 0].tolist() == [0, 0, 1, 1, 2, 2]


def with_contacts(rows):
    return dataclasses.replace(record(), contacts=np.array(rows, dtype=np.int64).reshape(-1, 4))


def test_a_contact_that_lasts_counts_once_and_stands_in_the_table():
    # UAVs 0 and 1 at scans 3 and 4, and again at 6; UAV 2 and canopy 7 at scan 4.
    found = list_contacts(with_contacts([(3, 0, 0, 1), (4, 0, 0, 1), (4, 2, 1, 7), (6, 0, 0, 1)]))
    assert found == [
        {"time": 3 / 5, "until": 4 / 5, "uav": 0, "kind": "uav", "other": 1},
        {"time": 4 / 5, "until": 4 / 5, "uav": 2, "kind": "canopy", "other": 7},
        {"time": 6 / 5, "until": 6 / 5, "uav": 0, "kind": "uav", "other": 1},
    ]
    texts = []
    for rows in ([], [(3, 0, 0, 1), (4, 2, 1, 7)]):
        result = summary(with_contacts(rows))
        assert json.loads(json.dumps(result, allow_nan=False)) == result
        texts.append(shown(result))
    assert "contacts" not in texts[0]
    for piece in ("contacts", "at 0.6 s", "UAV 0 touched UAV 1", "at 0.8 s", "UAV 2 touched the canopy of tree 7"):
        assert piece in texts[1]


def test_the_map_says_in_words_what_was_touched(monkeypatch):
    words = ["UAV 4", "the canopy of tree 4", "the trunk of tree 4", "person 4", "the ground"]
    assert [describe_body(kind, 0 if kind == "ground" else 4) for kind in KINDS] == words
    setting, texts = synthetic.scenario(), []
    (snapshot,) = synthetic.snapshots(setting, Forest(()), 1)
    touching = dataclasses.replace(snapshot, contacts=(Contact(0, "uav", 1), Contact(2, "ground", 0)))
    monkeypatch.setattr(Labels, "put", lambda self, text, *_, **__: texts.append(text))
    MapView(setting, Forest(()), (790, 540)).draw(SceneMaker(setting).add(touching))
    assert {"touched UAV 1", "touched the ground"} <= set(texts)


def test_the_map_marks_a_uav_for_a_second_after_its_contact():
    setting = synthetic.scenario(uavs=2)
    given = list(synthetic.snapshots(setting, Forest(()), 12))
    given = [dataclasses.replace(s, contacts=(Contact(1, "uav", 0),) if k == 2 else ()) for k, s in enumerate(given)]
    view, scenes, marked = MapView(setting, Forest(()), (790, 540)), SceneMaker(setting), []
    for snapshot in given:
        image, _ = view.draw(scenes.add(snapshot))
        centre = np.array([395, 270]) + view.scale * snapshot.poses[1].position[:2] * [1, -1]
        rows, columns = np.nonzero(np.all(image == ALARM, axis=2))
        ring = np.abs(np.hypot(columns + 0.5 - centre[0], rows + 0.5 - centre[1]) - 15.0) < 2.0
        marked.append(bool(ring.sum() > 40))
    assert marked == [2 <= k < 2 + round(ALERT * 5) for k in range(12)]
