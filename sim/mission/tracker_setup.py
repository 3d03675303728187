"""Set-up of trackers from a scenario: parameters, motion models and initial tracks."""

from __future__ import annotations

import numpy as np

from sim.scenario.perception import Tracking
from sim.scenario.scenario import Scenario
from tracking.filter.bounded_speed import BoundedSpeed
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.numerics.arrays import Array
from tracking.tracker import Track, TrackerParameters


def tracker_parameters(scenario: Scenario) -> TrackerParameters:
    """Parameters of a scenario's trackers."""
    settings = scenario.tracking
    return TrackerParameters(
        motion=motion(settings, 1 / scenario.rates.sensing),
        detection_probability=settings.detection_probability,
        clutter_density=settings.clutter_density,
        gate_probability=settings.gate_probability,
        confirm=settings.confirm,
        delete=settings.delete,
        absence_weight=settings.absence_weight,
        recovery_after=settings.recovery_after,
        max_variance=settings.max_variance,
        max_speed=settings.max_speed,
        life=settings.life,
        survival=settings.survival,
        birth_density=settings.birth_density,
        sure=settings.sure,
        doubt=settings.doubt,
        fusion=scenario.network.fusion,
    )


def motion(settings: Tracking, dt: float) -> NearlyConstantVelocity:
    """Motion model of people over `dt` s, as trackers use it."""
    if settings.motion == "bounded":
        return BoundedSpeed(dt, settings.sigma_a, settings.max_speed)
    return NearlyConstantVelocity(dt, settings.sigma_a)


def planned_motion(scenario: Scenario) -> NearlyConstantVelocity:
    """Motion model of people over a planning step, as planners use it: the trackers' prediction, scan by scan.

    Note: planners do not bound speeds.
    """
    rates = scenario.rates
    return NearlyConstantVelocity(1 / rates.planning, scenario.tracking.sigma_a, scans=rates.sensing // rates.planning)


def initial_tracks(scenario: Scenario, here: Array, there: Array) -> list[Track]:
    """Initial tracks of a scenario's trackers, of people at (M, 2) m at the first scan and the second.

    With `initial_tracks = "known"`: all people present at both, with position and velocity.
    """
    if scenario.tracking.initial_tracks == "none":
        return []
    step = 1 / scenario.rates.sensing
    states = np.hstack([here, (there - here) / step])
    covariance = np.diag([0.25, 0.25, 0.25, 0.25])
    return [Track(i, Gaussian(s, covariance)) for i, s in enumerate(states) if np.all(np.isfinite(s))]
