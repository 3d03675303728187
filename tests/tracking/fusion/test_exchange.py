"""Trackers that know beliefs alone: the exchange of their tracks gives them the fleet's ids, beliefs and ends."""

import numpy as np
import pytest
from helpers.kalman import update
from helpers.scenes import ALONE, CAMERA, MOTION, track

from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import fuse
from tracking.fusion.exchange import TrackExchange
from tracking.fusion.member import make_tracker
from tracking.fusion.message import new_id
from tracking.parameters import TrackerParameters
from tracking.track import Scan, Track

LINKED = ~np.eye(2, dtype=bool)


class Scripted:
    """A tracker with tracks and detections that a test sets."""

    max_speed = 3.0

    def __init__(self, uav, initial=(), **settings):
        self.uav, self.tracks, self.detected, self.time = uav, tuple(initial), {}, 0.0
        self.exchange = TrackExchange(uav, TrackerParameters(MOTION, **settings), initial)

    def begins(self, *state):
        self.tracks += (track(self.exchange.new_id(), *state),)
        self.detected[self.tracks[-1].id] = 1.0

    def message(self, degree):
        return self.exchange.message(degree, self.time, self.tracks, self.detected)

    def accept(self, message):
        self.tracks = self.exchange.accept(message)
        self.time, self.detected = self.time + 0.2, {}

    @property
    def ids(self):
        return [t.id for t in self.tracks]


def test_the_tracks_of_a_lone_uav_come_back():
    lone = Scripted(7, [track(0, 1, 2, 0, 1), Track(3, Gaussian(np.ones(4), 2 * np.eye(4)), 0.7)])
    before = lone.tracks
    for _ in range(3):
        fuse([lone], ALONE, 5)
    for old, new in zip(before, lone.tracks, strict=True):
        assert (old.id, old.existence) == (new.id, pytest.approx(new.existence, abs=1e-12))
        np.testing.assert_allclose(new.belief.mean, old.belief.mean, atol=1e-12)
        np.testing.assert_allclose(new.belief.covariance, old.belief.covariance, atol=1e-12)
    assert lone.tracks[0].existence == 1.0


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
def test_the_belief_of_the_uav_that_detects_counts(fusion):
    one, other = (Scripted(u, [track(0, 0, 0, 0, 0)], fusion=fusion) for u in range(2))
    one.tracks = (track(0, 0.5, 0.2, 0, 0, variance=0.02),)
    one.detected = {0: 1.0}
    fuse([one, other], LINKED, 20)
    for belief in (one.tracks[0].belief, other.tracks[0].belief):
        np.testing.assert_allclose(belief.mean, [0.5, 0.2, 0, 0], atol=1e-6)
        np.testing.assert_allclose(belief.covariance, 0.02 * np.eye(4), atol=1e-6)


@pytest.mark.parametrize("detects", [False, True])
def test_a_track_that_one_uav_leaves_out_ends_unless_another_detects_it(detects):
    one, other = (Scripted(u, [track(0, 0, 0, 0, 0), track(1, 9, 9, 0, 0)]) for u in range(2))
    for _ in range(2):
        fuse([one, other], LINKED, 5)
    one.tracks = one.tracks[1:]
    other.detected = {0: 1.0} if detects else {}
    fuse([one, other], LINKED, 5)
    assert one.ids == other.ids == ([0, 1] if detects else [1])
    fuse([one, other], LINKED, 5)
    assert one.ids == other.ids == ([0, 1] if detects else [1])


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (lambda m: setattr(m, "tracks", m.tracks * 2), r"ids of tracks are there twice: \[0, 0\]"),
        (lambda m: setattr(m, "tracks", (track(5, 0, 0, 0, 0),)), r"ids \[5\] are not of the fleet; .* from new_id"),
        (lambda m: setattr(m, "detected", {5: 1.0}), r"detected must have .* has \{5: 1\.0\}"),
        (lambda m: setattr(m, "detected", {0: 1.5}), r"detected must have .* has \{0: 1\.5\}"),
        (lambda m: setattr(m, "time", 0.0), r"scan at 0\.0 s is not after the last one at 0\.0 s"),
        (lambda m: [m.exchange.new_id() for _ in range(501)], "at most 500 tracks may begin in a scan"),
    ],
)
def test_what_the_fleet_cannot_use_is_refused(wrong, complaint):
    member = Scripted(0, [track(0, 0, 0, 0, 0)])
    fuse([member], ALONE, 5)
    with pytest.raises(ValueError, match=complaint):
        wrong(member)
        member.message(0)


def test_each_scan_may_begin_500_tracks_and_only_the_fleets_tracks_are_deleted():
    lone = Scripted(0, [track(0, 0, 0, 0, 0)])
    lone.tracks = ()
    for k in range(3):
        born = [lone.exchange.new_id() for _ in range(500)]  # none of which lives until the message
        assert born == [new_id(k + 1, 0, n) for n in range(500)]
        said = lone.message(0)
        assert said.deleted == ((0, 0.0),)
        lone.accept(said)


def test_only_a_sure_detection_is_a_sighting():
    lone, sighted = Scripted(0, [track(0, 0, 0, 0, 0)]), []
    for k, chance in enumerate((0.0, 0.5, 0.98, 0.99)):
        lone.tracks, lone.detected = (track(0, k, 0, 0, 0),), {0: chance}
        fuse([lone], ALONE, 5)
        sighted.append(lone.tracks[0].sighting)
    np.testing.assert_allclose(sighted, [[0, 0, 0.0]] * 3 + [[3, 0, 0.6]], atol=1e-9)


class Kalman(Scripted):
    """A filter of one person by the first measurement of each scan."""

    def __init__(self, uav, camera, parameters, initial):
        super().__init__(uav, initial)

    def coast(self, time):
        if self.time:
            self.tracks = tuple(Track(t.id, MOTION.predict(t.belief)) for t in self.tracks)

    def step(self, scan):
        self.coast(scan.time)
        z, R = scan.measurements, scan.covariances
        self.tracks = tuple(Track(t.id, update(t.belief, z[0], R[0])) for t in self.tracks)
        self.detected = {0: 1.0}
        z[:] = np.nan


def test_a_tracker_from_outside_equals_the_filter_that_it_is():
    made = make_tracker(f"{__name__}:Kalman", 0, CAMERA, TrackerParameters(MOTION), [track(0, 0, 0, 1, 0)])
    belief, z, R = track(0, 0, 0, 1, 0).belief, np.array([[0.1, 0.2]]), 0.05 * np.eye(2)[None]
    for k in range(5):
        belief = MOTION.predict(belief) if k else belief
        belief = update(belief, z[0], R[0])
        made.step(Scan(0, 0.2 * k, None, z, R))
        fuse([made], ALONE, 5)
        np.testing.assert_allclose(made.tracks[0].belief.mean, belief.mean, atol=1e-12)
        np.testing.assert_allclose(made.tracks[0].belief.covariance, belief.covariance, atol=1e-12)
    assert z.tolist() == [[0.1, 0.2]]  # the tracker changes its copy
