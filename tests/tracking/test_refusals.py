"""Validation of parameters, tracks, poses and scenarios: errors in one line."""

import dataclasses
import math

import numpy as np
import pytest
from helpers.scenes import ABOVE, CAMERA, MOTION, OPEN, play, scan, track, tracker

from sim.scenario.loading import load
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.camera import Pose
from tracking.metrics.gospa import gospa
from tracking.metrics.ospa import ospa
from tracking.parameters import MOST_SCANS
from tracking.tracker import Track, Tracker, TrackerParameters


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("detection_probability", 1.0, r"in \(0, 1\)"),
        ("gate_probability", 0.0, r"in \(0, 1\)"),
        ("survival", 0.0, r"in \(0, 1\]"),
        ("clutter_density", 0.0, "positive"),
        ("birth_density", 0.0, "positive"),
        ("management", "musicki", "m_of_n or existence"),
        ("confirm", (4, 3), "integers"),
        ("delete", (0, 3), "integers"),
        ("negative_information", -1.0, "0 or more"),
        ("negative_information", math.nan, "0 or more"),
        ("reacquire_after", -1.0, "0 or more"),
        ("reacquire_after", math.nan, "0 or more"),
        ("max_variance", 0.0, "positive"),
        ("max_variance", math.nan, "positive"),
        ("max_speed", -3.0, "positive"),
        ("clutter_density", math.inf, "finite"),
        ("birth_density", math.inf, "finite"),
        ("max_speed", math.inf, "finite"),
        ("confirm", (1.5, 2.5), "integers"),
        ("delete", (63, 63), "<= 62"),
    ],
)
def test_wrong_parameters_of_a_tracker_are_named(field, value, allowed):
    with pytest.raises(ValueError, match=f"^{field} must be .*{allowed}.* is .*{str(value)[1:-1]}"):
        TrackerParameters(MOTION, **{field: value})
    wrong = "0 < deletion_threshold < confirmation_threshold < 1 must hold, they are 0.5 and 0.4"
    with pytest.raises(ValueError, match=f"^{wrong}$"):
        TrackerParameters(MOTION, deletion_threshold=0.5, confirmation_threshold=0.4)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        *(("dt", v, "positive") for v in (0.0, -0.2, math.nan)),
        *(("sigma_a", v, "0 or more") for v in (-1.0, math.nan, math.inf)),
    ],
)
def test_wrong_steps_and_noise_of_a_motion_are_named(field, value, allowed):
    with pytest.raises(ValueError, match=f"^{field} must be {allowed} and finite, is {value}"):
        NearlyConstantVelocity(**{"dt": 0.2, "sigma_a": 1.0, field: value})


@pytest.mark.parametrize(
    ("mean", "covariance", "existence", "complaint"),
    [
        (np.full(4, math.nan), np.eye(4), 1.0, "means of tracks are not finite"),
        (np.zeros(2), np.eye(4), 1.0, r"means of tracks of shape \(1, 2\), not \(1, 4\)"),
        (
            np.zeros(4),
            -np.eye(4),
            1.0,
            "covariances of tracks are not .* positive definite",
        ),
        (np.zeros(4), np.eye(4) + np.eye(4, k=1), 1.0, "covariances of tracks are not symmetric"),
        (np.zeros(4), np.full((4, 4), math.nan), 1.0, "covariances of tracks are not finite"),
        (np.zeros(4), np.eye(4), 1.7, r"existence of tracks is not in \(0, 1\]"),
        (np.zeros(4), np.eye(4), math.nan, "existence of tracks are not finite"),
    ],
)
def test_initial_tracks_that_are_no_beliefs_are_refused_in_one_line(mean, covariance, existence, complaint):
    with pytest.raises(ValueError, match=complaint) as raised:
        Tracker(0, CAMERA, OPEN, TrackerParameters(MOTION), [Track(7, Gaussian(mean, covariance), existence)])
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("quaternion", [np.full(4, math.nan), np.zeros(4), np.zeros(3), np.array([0, 0, 0, 1.01])])
def test_a_scan_from_an_impossible_attitude_is_refused_and_changes_nothing(quaternion):
    subject = tracker(track(1, 0, 0, 0, 0))
    with pytest.raises(ValueError, match=r"pose.quaternion of a scan must be four numbers of norm 1, is \["):
        subject.step(dataclasses.replace(scan(0), pose=Pose(ABOVE.position, quaternion)))
    play(subject, [scan(0, (0, 0))])


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("tracking.delete=[63,63]", "delete 63 of 63 counts too many scans; at most 62 are allowed"),
        ("tracking.confirm=[2,100]", "confirm 2 of 100 counts too many scans"),
        ("tracking.reacquire_after=nan", "reacquire_after"),
    ],
)
def test_wrong_settings_of_a_scenarios_tracker_are_named(setting, complaint):
    assert MOST_SCANS == 62
    with pytest.raises(ValueError, match=complaint):
        load("forest", [setting])


@pytest.mark.parametrize("distance", [ospa, gospa])
def test_ospa_and_gospa_refuse_states_as_positions(distance):
    with pytest.raises(ValueError, match=r"estimates must be \(A, 2\), are \(1, 4\)"):
        distance(np.zeros((1, 4)), np.zeros((1, 2)))
    assert distance([], np.zeros((0, 4))).distance == 0.0
