"""`understory check-tracker`: good trackers conform, and each kind of broken tracker fails the check that fits."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.commands import called
from helpers.pages import DOCS

from tracking.filter.kalman import Gaussian
from tracking.fusion.member import TRACKERS
from tracking.fusion.tracker_check import check_tracker
from tracking.track import Track

exec((DOCS / "examples" / "own_tracker.py").read_text(encoding="utf-8"))
Nearest = globals()["Nearest"]
Nearest.__module__ = __name__


class Raising(Nearest):
    def step(self, scan):
        raise RuntimeError("two\nlines")


class Blank(Nearest):
    def message(self, degree):
        return None


class Needy(Nearest):
    def step(self, scan):
        super().step(scan)
        self.first = self.tracks[0]


class Forgetful(Nearest):
    def __init__(self, uav, camera, parameters, initial):
        super().__init__(uav, camera, parameters, ())


class Lost(Nearest):
    """Takes no measurement, and believes that all go south."""

    def step(self, scan):
        self.coast(scan.time)

    def coast(self, time):
        super().coast(time)
        south = np.array([0.0, -2.0, 0.0, 0.0])
        self.tracks = tuple(replace(t, belief=Gaussian(t.belief.mean + south, 1e-3 * np.eye(4))) for t in self.tracks)


class Timid(Nearest):
    def accept(self, message):
        super().accept(message)
        self.tracks = tuple(replace(t, belief=Gaussian(t.belief.mean, 100 * t.belief.covariance)) for t in self.tracks)


class Opinionated(Nearest):
    """Takes over ids alone."""

    def accept(self, message):
        before = {track.id: track.belief for track in self.tracks}
        super().accept(message)
        self.tracks = tuple(replace(t, belief=before.get(t.id, t.belief)) for t in self.tracks)


class Stubborn(Nearest):
    """UAV 1 has ids of its own."""

    def __init__(self, uav, *given):
        super().__init__(uav, *given)
        self.own = 10 * uav

    def message(self, degree):
        self.tracks = tuple(replace(t, id=t.id % 10) for t in self.tracks)
        self.detected = {id % 10: chance for id, chance in self.detected.items()}
        return super().message(degree)

    def accept(self, message):
        super().accept(message)
        self.tracks = tuple(replace(t, id=t.id + self.own) for t in self.tracks)


class Aside(Nearest):
    """UAV 1 has its tracks 0.8 mm to the east."""

    aside = 0.8e-3

    def __init__(self, uav, *given):
        super().__init__(uav, *given)
        self.moved = np.array([self.aside * uav, 0.0, 0.0, 0.0])

    def accept(self, message):
        super().accept(message)
        beliefs = [Gaussian(t.belief.mean + self.moved, t.belief.covariance) for t in self.tracks]
        self.tracks = tuple(replace(t, belief=belief) for t, belief in zip(self.tracks, beliefs, strict=True))


class Apart(Aside):
    """1.2 mm to the east."""

    aside = 1.2e-3


class Random(Nearest):
    def step(self, scan):
        super().step(scan)
        noise = np.random.default_rng().normal(scale=0.01, size=4)
        self.tracks = tuple(Track(t.id, Gaussian(t.belief.mean + noise, t.belief.covariance)) for t in self.tracks)


class Spoiling(Nearest):
    def step(self, scan):
        super().step(scan)
        scan.measurements[:] = 0.0


BROKEN = {
    Raising: {"scans": "cannot take a scan: RuntimeError: two lines ("},
    Blank: {"scans": "cannot give a message: it is no tracking.fusion.message.Message but NoneType"},
    Forgetful: {"known tracks": "of initial tracks 0, 1, 2 it has []", "people": "0 of 4 people have"},
    Needy: {"unknown start": "cannot take a scan: IndexError: list index out of range ("},
    Lost: {"people": "0 of 4 people have", "covariances": "covariances are far too small"},
    Timid: {"covariances": "covariances are far too large"},
    Opinionated: {"neighbours agree": "at 0.0 s means of two UAVs that hear one another differ by "},
    Stubborn: {"neighbours agree": "at 0.0 s UAV 0 has ids [0, 1, 2], UAV 1, which hears it, [10, 11, 12]"},
    Apart: {"neighbours agree": "at 0.0 s means of two UAVs that hear one another differ by 0.0012"},
    Random: {"same scans, same tracks": "other instances have other tracks after the same scans"},
    Spoiling: {"inputs untouched": "what step is given.measurements is changed"},
}


def named(kind):
    return f"{__name__}:{kind.__name__}"


@pytest.mark.parametrize("name", [*TRACKERS.built_in, named(Nearest), named(Aside)])
def test_good_trackers_conform(name):
    findings = check_tracker(name)
    assert [str(f) for f in findings if not f.passed] == []
    seen = {f.check: f.seen for f in findings}
    for check_name, begun in (("people", "3 of 4"), ("unknown start", "0 of 4")):
        held = seen[check_name]
        assert held.startswith(begun if name not in TRACKERS.built_in else "4 of 4") and "; 0 false tracks" in held


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_tracker_fails_the_check_that_fits(kind):
    failed = {f.check: f.seen for f in check_tracker(named(kind)) if f.passed is False}
    assert failed.keys() == BROKEN[kind].keys()
    for name, words in BROKEN[kind].items():
        assert words in failed[name]
        if "cannot" in words:
            assert "test_tracker_check.py:" in failed[name]


def test_of_a_tracker_that_does_not_fly_nothing_else_is_tried():
    first, *others = check_tracker(named(Raising))
    assert first.check == "scans" and {f.passed for f in others} == {None}
    assert {f.seen for f in others} == {"not tried: it fails 'scans'"}


def test_the_command_prints_a_line_per_check_and_exits_with_1(monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", list(sys.path))
    code, out, err = called(["check-tracker", "jpda"], monkeypatch, capsys)
    assert (code, err) == (0, "") and out.endswith("It conforms.\n") and out.count("passed ") == 9
    code, out, _ = called(["check-tracker", named(Random)], monkeypatch, capsys)
    assert code == 1 and "1 of 9 checks failed" in out
    code, out, err = called(["check-tracker", "jdpa"], monkeypatch, capsys)
    assert (code, out) == (2, "") and "did you mean jpda?" in err and err.count("\n") == 1
