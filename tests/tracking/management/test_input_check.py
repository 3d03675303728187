"""Scans that make no sense are refused with one line, before they change anything."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.scenes import ABOVE, R, play, scan, track, tracker

from tracking.geometry.camera import Pose

TWO = scan(1, (0, 0), (1, 1))
NAN = np.array([[0.0, 0.0], [math.nan, 1.0]])


def with_second(covariance) -> np.ndarray:
    return np.array([R, covariance])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"measurements": NAN}, r"measurements\[1\] must be finite, is \[nan, 1.0\]"),
        ({"measurements": np.zeros((2, 3))}, r"measurements of a scan must be \(N, 2\), are \(2, 3\)"),
        ({"measurements": [["a", 1], [0, 0]]}, "measurements of a scan must be an array of numbers"),
        ({"covariances": R[None]}, r"of a scan of 2 measurements must be \(2, 2, 2\), are \(1, 2, 2\)"),
        ({"covariances": with_second([[1, math.nan], [math.nan, 1]])}, r"covariances\[1\] must be finite, symm.*nan"),
        ({"covariances": with_second([[1, 0.5], [0.4, 1]])}, r"symmetric and positive definite, is \[\[1.0, 0.5\], \["),
        ({"covariances": with_second([[1, 2], [2, 1]])}, r"symmetric and positive definite, is \[\[1.0, 2.0\], \["),
        ({"covariances": with_second([[-1, 0], [0, -1]])}, r"symmetric and positive definite, is \[\[-1.0, 0.0\], \["),
        ({"covariances": with_second(np.diag([1.0, math.inf]))}, r"covariances\[1\] must be finite, symm.*inf"),
        ({"time": math.nan}, "time of a scan must be finite, is nan"),
        ({"time": -0.2}, "scan at -0.2 s is not after the last one at 0.0 s"),
        ({"pose": Pose(np.array([0, 0, math.nan]), ABOVE.quaternion)}, "pose.position of a scan must be three finite"),
        ({"pose": Pose(ABOVE.position, np.array([0, 0, 0, 1.01]))}, "pose.quaternion of a scan must be four numbers"),
    ],
)
def test_a_scan_that_makes_no_sense_is_refused_and_changes_nothing(change, complaint):
    subject, untouched = (tracker(track(1, 0, 0, 0, 0), track(2, 1, 1, 0, 0)) for _ in range(2))
    for t in (subject, untouched):
        play(t, [scan(0, (0, 0))])
    with pytest.raises(ValueError, match=complaint) as raised:
        subject.step(dataclasses.replace(TWO, **change))
    assert "\n" not in str(raised.value)
    for t in (subject, untouched):
        play(t, [TWO])
    for a, b in zip(subject.tracks, untouched.tracks, strict=True):
        np.testing.assert_array_equal(a.belief.mean, b.belief.mean)
        np.testing.assert_array_equal(a.belief.covariance, b.belief.covariance)


def test_lists_of_numbers_and_slightly_asymmetric_covariances_are_taken():
    plain, listed = (tracker(track(1, 0, 0, 0, 0)) for _ in range(2))
    play(plain, [scan(0, (1, 0))])
    play(listed, [dataclasses.replace(scan(0), measurements=[[1, 0]], covariances=[R.tolist()])])
    np.testing.assert_array_equal(plain.tracks[0].belief.mean, listed.tracks[0].belief.mean)
    subject = tracker(track(1, 0.0, 0.0, 0.0, 0.0))
    play(subject, [dataclasses.replace(scan(0, (0, 0)), covariances=np.array([[[1, 0.5], [0.5 + 1e-12, 1]]]))])
    (held,) = subject.tracks
    assert np.isfinite(held.belief.covariance).all()
