"""`understory check-detector`: our detectors conform, and each kind of broken detector fails the check that fits."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.commands import called

from sim.scenario.sensing import DETECTORS
from sim.sensing.detector_check import check_detector
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Detections


class Good:
    """The people seen as if whole."""

    def detect(self, frame):
        frame.image.flags.writeable = True  # which it may do with its own copy
        found = BlobDetector().detect(frame)
        frame.image[:] = 0
        return found


class Ordering(Good):
    """Takes images for BGR, as OpenCV reads them."""

    def detect(self, frame):
        return BlobDetector().detect(replace(frame, image=frame.image[..., ::-1]))


class Raising:
    def detect(self, frame):
        raise RuntimeError("two\nlines")


class Silent:
    def detect(self, frame):
        return None


class Uncertain(Good):
    def detect(self, frame):
        return replace(super().detect(frame), covariances=np.full((6, 2, 2), np.nan))


class Blind:
    def detect(self, frame):
        return Detections(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))


class Seeing(Good):
    """Sees twenty people in every frame."""

    def detect(self, frame):
        pixels = np.random.default_rng(0).uniform(0, 128, (20, 2))
        return Detections(pixels, frame.camera.ground_points(frame.pose, pixels), np.tile(np.eye(2), (20, 1, 1)))


class Sure(Good):
    def detect(self, frame):
        found = super().detect(frame)
        return replace(found, covariances=found.covariances / 1e3)


class Unsure:
    def detect(self, frame):
        found = BlobDetector().detect(frame)
        return replace(found, covariances=13 * found.covariances)


class Random(Good):
    def detect(self, frame):
        found = super().detect(frame)
        return replace(found, ground=found.ground + np.random.default_rng().normal(scale=0.01, size=found.ground.shape))


class Counting(Good):
    calls = 0

    def detect(self, frame):
        self.calls += 1
        found = super().detect(frame)
        return replace(found, covariances=found.covariances * self.calls)


class OneGross(Unsure):
    """Far too unsure of all people but one, whose error makes the mean NEES about right."""

    def detect(self, frame):
        found = super().detect(frame)
        found.ground[:1] += 0.5
        return replace(found, covariances=2 * found.covariances)


class Remembering(Counting):
    """Doubts more from frame to frame, and says so."""

    stateful = True

    def reset(self, seed):
        self.calls = 0

    def detect(self, frame):
        found = super().detect(frame)
        return replace(found, covariances=found.covariances / 26)  # after 25 frames, as good as `Good`


class Unforgetting(Remembering):
    def reset(self, seed):
        pass


class Flat(Good):
    """Knows cameras of one size."""

    def detect(self, frame):
        if frame.camera.pixels != 128:
            raise ValueError("expected 128 x 128 pixels")
        return super().detect(frame)


BROKEN = {
    Raising: {"detections": "RuntimeError: two lines"},
    Silent: {"detections": "of type NoneType (/"},
    Uncertain: {"detections": "covariances"},
    Flat: {"detections": "finer image: ValueError: expected 128 x 128 pixels"},
    Blind: {"people": "0 of 6 in plain view"},
    Ordering: {"people": "6 with red and blue exchanged: images are RGB, not BGR"},
    Seeing: {"people": "false detection", "no person in view": "20 detections"},
    Sure: {"covariances": "far too small"},
    Unsure: {"covariances": "far too large"},
    Random: {"same frame, same result": "another instance"},
    Counting: {"same frame, same result": "without stateful = True, but after another frame"},
    OneGross: {"covariances": "far too large"},
    Unforgetting: {"same frame, same result": "after reset(seed) with the same seed"},
}


def named(kind):
    return f"{__name__}:{kind.__name__}"


@pytest.mark.parametrize("name", [*DETECTORS.built_in, named(Good), named(Remembering)])
def test_good_detectors_conform(name):
    findings = check_detector(name)
    assert [str(f) for f in findings if not f.passed] == []
    assert "6 of 6 in plain view, 0 false detections" in str(findings[1])
    assert str(findings[2]).count(" 6 of 6") == 4
    assert ("it writes into frame.image" in str(findings[0])) == (name not in DETECTORS.built_in)


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_detector_fails_the_check_that_fits(kind):
    failed = {f.check: f.seen for f in check_detector(named(kind)) if f.passed is False}
    for name, words in BROKEN[kind].items():
        assert words in failed.pop(name)
    assert set(failed) <= {"covariances"}  # of false detections no errors are known


def test_the_command_prints_a_line_per_check_and_exits_with_1(monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", list(sys.path))
    code, out, err = called(["check-detector", "blob"], monkeypatch, capsys)
    assert (code, err) == (0, "") and out.endswith("It conforms.\n") and out.count("passed ") == 7
    code, out, _ = called(["check-detector", named(Blind)], monkeypatch, capsys)
    assert code == 1 and "1 of 7 checks failed" in out
    code, out, err = called(["check-detector", "blop"], monkeypatch, capsys)
    assert (code, out) == (2, "") and "did you mean blob?" in err and err.count("\n") == 1
