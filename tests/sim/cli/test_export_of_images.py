"""Labelled images by the command line: of recordings and of scenarios, split by seeds; wrong input leaves nothing."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from helpers.flights import recorded

from sim.exchange.export import LABELS
from sim.mission.archive import save


@pytest.fixture
def runs(call, tmp_path):
    """Folders `a`, `b` and `c` of missions with the seeds 1, 2 and 2, and `real` of a flight from elsewhere."""
    for name, seed in (("a", 1), ("b", 2), ("c", 2)):
        (tmp_path / name).mkdir()
        save(recorded(seed=seed, duration=0.4), tmp_path / name / "mission.npz")
    first = recorded(seed=1, duration=0.4)
    save(dataclasses.replace(first, frames=np.ones((3, 3), dtype=bool)), tmp_path / "real.npz")


def flights(folder):
    """Flights and numbers of images of each split of a COCO data set."""
    sets = {path.stem.removeprefix("instances_"): json.loads(path.read_text()) for path in Path(folder).rglob("*.json")}
    return {split: (made["flights"], len(made["images"])) for split, made in sets.items()}


def test_recordings_are_split_by_their_seeds(call, runs, tmp_path):
    code, out, _ = call("export", "a", "b", "c", "--to", "coco", "--test", "2", "--every", "0.4s")
    assert code == 0 and "annotations, images" in out
    made = flights("runs/images-coco")
    assert {split: [flight["id"] for flight in listed] for split, (listed, _) in made.items()} == {
        "train": [0], "test": [1, 2]
    }  # fmt: skip
    assert {split: count for split, (_, count) in made.items()} == {"train": 2 * 3, "test": 2 * 2 * 3}
    code, _, told = call("export", "a", "--to", "yolo")
    assert code == 0 and "--val: names no seed, so val of data.yaml has no images of its own" in told
    splits = "train: images/train\nval: images/train  # it has none of its own\n"
    assert (tmp_path / "a" / "export-yolo" / "data.yaml").read_text() == f"{splits}names:\n  0: person\n"


def test_scenarios_are_flown_with_seeds_in_random_appearance(call):
    words = ("--seeds", "3-5", "--val", "4", "--test", "5", "--duration", "0.4", "--set", "people.count=6")
    code, _, err = call("export", "forest", "dense", "--to", "coco", *words)
    assert code == 0, err
    made = flights("runs/images-coco")
    seeds = {split: [flight["seed"] for flight in listed] for split, (listed, _) in made.items()}
    assert seeds == {"train": [3, 3], "val": [4, 4], "test": [5, 5]}
    for flown, count in made.values():
        scenarios = [flight["scenario"] for flight in flown]
        assert all(s["appearance"]["randomise"] and s["people"]["count"] == 6 for s in scenarios)
        assert {flight["planner"] for flight in flown} == {"greedy"} and count == 2 * 3 * 3
        assert scenarios[0]["trees"] != scenarios[1]["trees"]


def test_a_setting_of_the_user_counts_more_than_random_appearance(call):
    words = ("--seeds", "0", "--duration", "0.2", "--set", "appearance.randomise=false", "--planner", "hover")
    code, out, _ = call("export", "forest", "--to", "coco", *words)
    (((flight,), _),) = flights("runs/forest-coco").values()
    assert code == 0 and "runs/forest-coco" in out
    assert not flight["scenario"].get("appearance", {}).get("randomise") and flight["planner"] == "hover"


WRONG = {
    "scenario without seeds": ("forest --to coco", "DIR: forest does not exist; ", "--seeds 0-9"),
    "flight from elsewhere": ("a real.npz --to coco", "DIR: real.npz was not flown here", "expected a mission"),
    "unknown seed": ("a b --to coco --val 3", "--val: no flight has the seed 3; allowed are 1, 2", ""),
    "seed in two splits": ("a b --to coco --val 2 --test 1-2", "--test: 2 is in --val, too", "one of them"),
    "split of tables": ("a --to csv --val 1", "--val: not allowed together with --to csv", "--to coco and yolo"),
    "several recordings as tables": ("a b --to csv", "DIR: 'b' is one too many", "one recording"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line_and_leaves_nothing(refused, runs, tmp_path, case):
    (tmp_path / "broken").mkdir()
    words, *told = WRONG[case]
    said = refused("export", *words.split())
    assert all(part in said for part in told), said


def test_a_mission_that_cannot_be_written_to_the_end_leaves_nothing(refused, runs, monkeypatch):
    """As of a disk that is full when half of the labels are written."""

    def fail(images, folder):
        for _, labelled in zip(range(5), images, strict=False):
            (folder / labelled.name).touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(LABELS, "coco", fail)
    assert "No space left on device; nothing is kept" in refused("export", "a", "--to", "coco", code=1)
