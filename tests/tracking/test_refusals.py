"""Validation of parameters, tracks, poses and scenarios: errors in one line."""

import math

import numpy as np
import pytest
from helpers.scenes import CAMERA, MOTION

from tracking.errors import InputError
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.parameters import TrackerParameters
from tracking.track import Track
from tracking.tracker import Tracker


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("detection_probability", 1.0, "expected `float` < 1.0"),
        ("management", "musicki", "allowed are existence, m_of_n"),
        ("negative_information", math.nan, "expected `float` >= 0.0"),
    ],
)
def test_wrong_settings_of_a_tracker_are_named_with_their_bounds(field, value, allowed):
    with pytest.raises(InputError, match=f"^{field}: {value!r} is not allowed; {allowed}"):
        TrackerParameters(MOTION, **{field: value})


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"survivl": 0.9}, "survivl: unknown key; .*did you mean survival"),
        ({"confirm": (4, 3)}, "confirm 4 of 3 can never happen"),
        ({"delete": (0, 3)}, "delete.0: 0 is not allowed; expected `int` >= 1"),
        (
            {"deletion_threshold": 0.5, "confirmation_threshold": 0.4},
            "deletion_threshold 0.5 must be below confirmation_threshold 0.4",
        ),
    ],
)
def test_settings_of_a_tracker_that_do_not_fit_are_named(settings, complaint):
    with pytest.raises(InputError, match=f"^{complaint}"):
        TrackerParameters(MOTION, **settings)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("dt", 0.0, "positive and finite"),
        ("sigma_a", math.nan, "0 or more and finite"),
        ("scans", 2.0, "an integer, 1 or more"),
    ],
)
def test_wrong_steps_and_noise_of_a_motion_are_named(field, value, allowed):
    with pytest.raises(ValueError, match=f"^{field} must be {allowed}, is {value}"):
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
        (np.zeros(4), np.eye(4), 1.7, r"existence of tracks is not in \(0, 1\]"),
    ],
)
def test_initial_tracks_that_are_no_beliefs_are_refused_in_one_line(mean, covariance, existence, complaint):
    with pytest.raises(ValueError, match=complaint) as raised:
        Tracker(0, CAMERA, TrackerParameters(MOTION), [Track(7, Gaussian(mean, covariance), existence)])
    assert "\n" not in str(raised.value)
