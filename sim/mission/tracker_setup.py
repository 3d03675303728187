"""What a scenario tells its trackers: their parameters, and the tracks that they begin with."""

from __future__ import annotations

import numpy as np

from sim.scenario.scenario import Scenario, Tracking
from tracking.filter.bounded_speed import BoundedSpeed
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.numerics.compiled import Array
from tracking.tracker import Track, TrackerParameters


def tracker_parameters(scenario: Scenario) -> TrackerParameters:
    """What the trackers of a scenario assume."""
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
    """How trackers take people to move over `dt` s."""
    if settings.motion == "bounded":
        return BoundedSpeed(dt, settings.sigma_a, settings.max_speed)
    return NearlyConstantVelocity(dt, settings.sigma_a)


def planned_motion(scenario: Scenario) -> NearlyConstantVelocity:
    """How planners take people to move over a planning step: as trackers predict them, scan by scan.

    Note: to planners nobody's speed is bounded.
    """
    rates = scenario.rates
    return NearlyConstantVelocity(1 / rates.planning, scenario.tracking.sigma_a, scans=rates.sensing // rates.planning)


def initial_tracks(scenario: Scenario, here: Array, there: Array) -> list[Track]:
    """The tracks that the trackers of a scenario begin with, of people (M, 2) m at the first scan and the second.

    With `initial_tracks = "known"`: everyone who is there at both, with position and velocity.
    """
    if scenario.tracking.initial_tracks == "none":
        return []
    step = 1 / scenario.rates.sensing
    states = np.hstack([here, (there - here) / step])
    covariance = np.diag([0.25, 0.25, 0.25, 0.25])
    return [Track(i, Gaussian(s, covariance)) for i, s in enumerate(states) if np.all(np.isfinite(s))]
