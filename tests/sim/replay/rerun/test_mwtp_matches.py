"""Matches of UAVs and tracks at the end of plans: against the penalty that planners pay, and by hand."""

import numpy as np
import pytest
from helpers.nominal import weighted_trace_penalty
from helpers.recordings import record

from planning.objective.mwtp import matches
from planning.objective.nbo import objective
from planning.planner import Vehicle
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.propagation import Nominal
from planning.prediction.response import mean_velocities, response
from sim.replay.rerun.mwtp_matches import matches_at, situation_at
from tracking.detection.noise import NoiseModel
from tracking.geometry.camera import Camera


def views(count, altitude=20.0):
    vehicle = Vehicle(0, np.array([0.0, 0.0, altitude]), Camera(np.pi / 3, 128), NoiseModel.range_bearing(0.1), 5.0)
    return np.array([view_quadrangle(vehicle)] * count)


def sensors(*places):
    return np.array([(x, y, 0.0) for x, y in places])


def test_the_most_uncertain_gets_the_nearest_and_a_busy_uav_is_farther():
    half = (20.0 - 0.85) * np.tan(np.pi / 6)
    targets = np.array([[30.0, 0.0], [34.0, 0.0], [-60.0, 0.0], [0.0, 0.0]])
    found = matches(targets, np.array([9.0, 4.0, 1.0, 100.0]), np.array([0, 0, 0, 1], bool),
                     sensors((0, 0), (-40, 0)), views(2))  # fmt: skip
    assert [(m.uav, m.target) for m in found] == [(0, 0), (0, 1), (1, 2)]
    # The first has moved until its image just holds the target, which then lies half an image ahead.
    np.testing.assert_allclose([m.distance for m in found], [30.0, 4.0 + half, 20.0])
    np.testing.assert_allclose([m.penalty for m in found], [30.0 * 9.0, 0.0, 20.0 * 1.0])


def test_penalties_add_up_to_what_planners_pay():
    rng = np.random.default_rng(0)
    shared = 0
    for _ in range(50):
        n, count = rng.integers(1, 4), rng.integers(1, 7)
        places, targets = rng.uniform(-40, 40, (n, 2)), rng.uniform(-40, 40, (count, 2))
        traces = rng.uniform(1, 9, count)
        half = (20.0 - 0.85) * np.tan(np.pi / 6)
        seen = (np.abs(targets[:, None] - places[None]) <= half).all(axis=2).any(axis=1)
        found = matches(targets, traces, seen, sensors(*places), views(n))
        expected = weighted_trace_penalty(targets, traces, places.copy(), views(n))
        assert sum(m.penalty for m in found) == pytest.approx(expected)
        assert sorted(m.target for m in found) == np.flatnonzero(~seen).tolist()
        shared += len(found) > len({m.uav for m in found})
    assert shared > 5


def test_matches_of_a_recording_are_those_its_plans_would_pay_for():
    recording = record(21)
    assert matches_at(recording, 1, 0) == ()  # nothing was planned
    count = 0
    for k in range(0, 21, 5):
        controls = np.array([plan.controls for plan in recording.plans_at(k)])
        situation = situation_at(recording, k, 1)
        view = Nominal().predict(situation, 5, np.random.default_rng(0))
        flown = mean_velocities(response(situation.vehicles, situation.step), controls[None])
        paid = [float(objective(view, flown[0], range(3), beta)(flown)[0]) for beta in (0.0, 1.0)]
        found = matches_at(recording, k, 1)
        assert sum(m.penalty for m, _ in found) == pytest.approx(paid[1] - paid[0])
        assert {m.target for m, _ in found} <= {t.id for t in recording.tracks_at(k, 1)}
        count += len(found)
    assert count > 3
