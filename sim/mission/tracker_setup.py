"""Set-up of trackers from a scenario: parameters, motion models and initial tracks."""

from dataclasses import replace
from typing import Any

import numpy as np

from sim.scenario.scenario import Scenario
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.filter.motion import MOTION_MODELS, make_motion_model
from tracking.numerics.arrays import Array
from tracking.parameters import TrackerParameters
from tracking.track import Track


def make_tracker_parameters(scenario: Scenario, uav: int = 0) -> TrackerParameters:
    """Parameters of the tracker of a scenario's UAV."""
    motion, navigation = _make_motion(scenario, scenario.tracking.motion), scenario.uavs[uav].navigation_errors
    return TrackerParameters(motion, scenario.believed_tracking, fusion=scenario.network.fusion, navigation=navigation)


def make_planned_motion(scenario: Scenario, learned: object = None) -> NearlyConstantVelocity:
    """Motion model of people for planners: it predicts over a planning step, scan by scan as the trackers do.

    learned: the present motion model of a UAV's tracker, if it has one.

    Note: planners know only the built-in models; in place of any other they assume nearly constant velocity.
    """
    name = scenario.tracking.motion
    if isinstance(learned, NearlyConstantVelocity):
        model = learned
    else:
        model = _make_motion(scenario, name if name in MOTION_MODELS.built_in else "ncv")
    return replace(model, dt=scenario.rates.plan_step, scans=scenario.rates.plan_scans)


def _make_motion(scenario: Scenario, name: str) -> Any:  # noqa: ANN401 - built-in models have more than `MotionModel`
    """The motion model with this name, over the time between two scans."""
    s = scenario.believed_tracking
    return make_motion_model(name, 1 / scenario.rates.sensing, s.sigma_a, s.max_speed, s.walking_speed)


def make_initial_tracks(scenario: Scenario, here: Array, there: Array) -> list[Track]:
    """Initial tracks of a scenario's trackers; here and there (M, 2) m: people at the first and the second scan.

    With `initial_tracks = "known"` these are all people present at both scans, with position and velocity.
    """
    if scenario.tracking.initial_tracks == "none":
        return []
    step = 1 / scenario.rates.sensing
    states = np.hstack([here, (there - here) / step])
    return [Track(i, Gaussian(s, 0.25 * np.eye(4))) for i, s in enumerate(states) if np.all(np.isfinite(s))]
