"""A detector with a memory has one instance for each camera, which is reset before its first frame."""

import sys

import pytest
from helpers.pages import DOCS, blocks

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.sensing.detector_check import check_detector
from tracking.detection.blob_detector import BlobDetector
from tracking.errors import InputError

PAGE = (DOCS / "tutorials" / "first-detector.md").read_text("utf-8")
MADE = []


class Plain:
    def __init__(self):
        self.seeds, self.frames = [], []
        MADE.append(self)

    def detect(self, frame):
        self.frames.append((frame.uav, frame.time))
        return BlobDetector().detect(frame)


class Remembering(Plain):
    stateful = True

    def reset(self, seed):
        assert not self.frames
        self.seeds.append(seed)


class Unresettable(Plain):
    stateful = True


class Failing(Remembering):
    def reset(self, seed):
        raise OSError("no\nmodel")


def setting(kind, duration=0.6):
    return Scenario(duration=duration, sensing=Sensing(detector=f"{__name__}:{kind.__name__}"))


@pytest.fixture
def hover():
    return load_planner("hover")


def test_each_camera_has_its_own_memory(hover):
    MADE.clear()
    list(Mission(setting(Remembering), hover, 3).fly())
    assert [made.frames for made in MADE] == [[(i, k / 5) for k in range(4)] for i in range(3)]
    assert [len(made.seeds) for made in MADE] == [1, 1, 1] and len({made.seeds[0] for made in MADE}) == 3
    seeds = [made.seeds for made in MADE]
    MADE.clear()
    list(Mission(setting(Remembering), hover, 3).fly())
    assert [made.seeds for made in MADE] == seeds


def test_a_detector_without_memory_has_one_instance(hover):
    MADE.clear()
    list(Mission(setting(Plain), hover, 3).fly())
    assert [made.seeds for made in MADE] == [[]] and len(MADE[0].frames) == 12


@pytest.mark.parametrize(
    ("kind", "told"),
    [(Unresettable, "is stateful, but has no method reset(seed)"), (Failing, "cannot be reset: OSError: no model")],
)
def test_a_memory_that_cannot_be_reset_is_one_line(hover, kind, told):
    with pytest.raises(InputError) as caught:
        Mission(setting(kind), hover)
    assert str(caught.value).startswith("sensing.detector: ") and told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_background_subtraction_of_the_tutorial_conforms_and_repeats(hover, tmp_path, monkeypatch):
    code = next(block for _, block in blocks(PAGE) if block.startswith("# mymotion.py"))
    (tmp_path / "mymotion.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mymotion", raising=False)
    findings = {f.check: f for f in check_detector("mymotion:Moving")}
    assert [str(f) for f in findings.values() if not f.passed] == []
    assert "6 of 6 in plain view" in findings["people"].seen
    scenario = Scenario(duration=4.0, sensing=Sensing(detector="mymotion:Moving"))
    one, two = (list(Mission(scenario, hover, 0).fly()) for _ in range(2))
    assert any(len(scan.measurements) for s in one for scan in s.scans)
    for first, second in zip(one, two, strict=True):
        for a, b in zip(first.scans, second.scans, strict=True):
            assert a.measurements.tobytes() == b.measurements.tobytes()
