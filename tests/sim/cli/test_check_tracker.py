"""`understory check-tracker`: good trackers conform, and each kind of broken tracker fails the check that fits."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.commands import called
from helpers.pages import DOCS, blocks

from sim.conformance.tracker import check
from tracking.filter.kalman import Gaussian
from tracking.fusion.member import TRACKERS
from tracking.track import Track

PAGE = (DOCS / "how-to" / "trackers.md").read_text(encoding="utf-8")
exec(next(content for language, content in blocks(PAGE) if language == "python"))
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


class Infinite(Nearest):
    def step(self, scan):
        super().step(scan)
        self.tracks = tuple(Track(t.id, Gaussian(t.belief.mean + np.inf, np.eye(4))) for t in self.tracks)


class Shape(Nearest):
    def step(self, scan):
        super().step(scan)
        self.tracks = tuple(Track(t.id, Gaussian(t.belief.mean[:2], t.belief.covariance)) for t in self.tracks)


class Sure(Nearest):
    def step(self, scan):
        super().step(scan)
        self.tracks = tuple(Track(t.id, Gaussian(t.belief.mean, np.zeros((4, 4)))) for t in self.tracks)


class Twin(Nearest):
    def accept(self, message):
        super().accept(message)
        self.tracks = (*self.tracks, self.tracks[-1])


class Forgetful(Nearest):
    def __init__(self, uav, camera, forest, parameters, initial):
        super().__init__(uav, camera, forest, parameters, ())


class Lost(Nearest):
    """Takes no measurement, and believes that all go south."""

    def step(self, scan):
        self.coast(scan.time)

    def coast(self, time):
        super().coast(time)
        south = np.array([0.0, -2.0, 0.0, 0.0])
        self.tracks = tuple(replace(t, belief=Gaussian(t.belief.mean + south, 1e-3 * np.eye(4))) for t in self.tracks)


class Coasting(Nearest):
    """Takes no measurement."""

    def step(self, scan):
        self.coast(scan.time)


class Standing(Coasting):
    """Believes that all stand where they were."""

    def coast(self, time):
        before = self.tracks
        super().coast(time)
        self.tracks = before


class Plain(Nearest):
    def step(self, scan):
        super().step(scan)
        self.tracks = [(t.id, t.belief, t.existence) for t in self.tracks]


class Unknown(Nearest):
    def accept(self, message):
        super().accept(message)
        self.tracks = None


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


class Random(Nearest):
    def step(self, scan):
        super().step(scan)
        noise = np.random.default_rng().normal(scale=0.01, size=4)
        self.tracks = tuple(Track(t.id, Gaussian(t.belief.mean + noise, t.belief.covariance)) for t in self.tracks)


class Spoiling(Nearest):
    def step(self, scan):
        super().step(scan)
        scan.measurements[:] = 0.0


class Timeless(Nearest):
    def coast(self, time):
        self.time = None if self.time is None else self.time - 1e3
        if time == 0.0 and self.time is not None:
            time = 1e3
        super().coast(time)


BROKEN = {
    Raising: {"scans": "cannot take a scan: RuntimeError: two lines ("},
    Blank: {"scans": "cannot give a message: it is no tracking.fusion.message.Message but NoneType"},
    Infinite: {"finite": "means of tracks are not finite"},
    Shape: {"finite": "means of tracks of shape (3, 2), not (3, 4)"},
    Sure: {"positive definite": "covariances of tracks are not symmetric and positive definite"},
    Twin: {"ids": "ids of tracks are there twice: [2]"},
    Forgetful: {"known tracks": "of initial tracks 0, 1, 2 it has []", "people": "0 of 4 people, "},
    Needy: {"unknown start": "cannot take a scan: IndexError: tuple index out of range ("},
    Lost: {"people": "0 of 4 people, "},
    Coasting: {"people": "0 of 4 people, "},
    Standing: {"people": "0 of 4 people, "},
    Plain: {
        "ids": "after step: among tracks is a tuple without id; a track is an object with id, belief and existence"
    },
    Unknown: {"ids": "cannot give its tracks after accept: tracks are no sequence but NoneType ("},
    Opinionated: {"neighbours agree": "at 0.0 s means of UAV 0 and UAV 1, which hear one another, differ by "},
    Stubborn: {"neighbours agree": "at 0.0 s UAV 0 has ids [0, 1, 2], UAV 1, which hears it, [10, 11, 12]"},
    Random: {"same scans, same tracks": "other instances have other tracks after the same scans"},
    Spoiling: {"inputs untouched": "the scan.measurements is changed"},
    Timeless: {"times that go back": "takes a scan of 0.0 s after 4.8 s"},
}


def named(kind):
    return f"{__name__}:{kind.__name__}"


@pytest.mark.parametrize("name", [*TRACKERS.built_in, named(Nearest), "soup:SoupJPDA"])
def test_good_trackers_conform(name, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "examples" / "soup"))
    findings = check(name)
    assert [str(f) for f in findings if not f.passed] == []
    seen = {f.check: f.seen for f in findings}
    for check_name, begun in (("people", "3 of 4"), ("unknown start", "0 of 4")):
        held = seen[check_name]
        assert held.startswith(begun if "Nearest" in name else "4 of 4") and held.endswith("0 false tracks")
        assert begun == "0 of 4" or float(held.partition(" m off")[0].rpartition(" ")[2]) < 0.5


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_tracker_fails_the_check_that_fits(kind):
    failed = {f.check: f.seen for f in check(named(kind)) if f.passed is False}
    assert failed.keys() == BROKEN[kind].keys()
    for name, words in BROKEN[kind].items():
        assert words in failed[name]
        if "cannot" in words:
            assert "test_check_tracker.py:" in failed[name]


@pytest.mark.parametrize("kind", [Shape, Infinite, Twin])
def test_scans_that_are_not_all_flown_have_not_passed(kind):
    found = {f.check: f for f in check(named(kind))}
    assert (found["scans"].passed, found["scans"].seen) == (None, "not tried: it does not fly all scans")
    assert [f.check for f in found.values() if f.passed] == ["known tracks"]


def test_the_command_prints_a_line_per_check_and_exits_with_1(monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", list(sys.path))
    code, out, err = called(["check-tracker", "jpda"], monkeypatch, capsys)
    assert (code, err) == (0, "") and out.endswith("It conforms.\n") and out.count("passed ") == 12
    code, out, _ = called(["check-tracker", named(Random)], monkeypatch, capsys)
    assert code == 1 and "1 of 12 checks failed" in out
    code, out, err = called(["check-tracker", "jdpa"], monkeypatch, capsys)
    assert (code, out) == (2, "") and "did you mean jpda?" in err and err.count("\n") == 1
