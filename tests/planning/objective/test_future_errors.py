"""Fit of the learned cost-to-go to missions: it finds the table in use."""

import numpy as np
import pytest
from scipy.optimize import nnls

from planning.objective.cost_to_go import DEVIATION, FUTURE, SECONDS
from planning.planner_loading import load_planner
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.quadrangle import radius_in_view
from sim.mission.mission import Mission
from sim.scenario.loading import load_scenario
from tracking.numerics.distances import length
from tracking.track import beliefs_of

CUTOFF, FUTURE_SECONDS = 10.0, 15  # m, s


def fit(rows):
    """Table of future errors of the shape of `FUTURE`, fitted to rows (N, 3) in the least-squares sense.

    rows: the time until a UAV can have a track in view [s], its standard deviation in units of the cut-off, and the sum
    of its squared errors in units of the cut-off's square. Between entries the table is interpolated. Errors grow with
    each of the two, and the more with one the greater the other; at most they are those of a track that stays lost.
    """
    deviations, seconds = FUTURE.shape
    by_time = _find_weights(rows[:, 0] / SECONDS, seconds) @ np.tri(seconds)
    by_spread = _find_weights(rows[:, 1] / DEVIATION, deviations) @ np.tri(deviations)
    design = (by_spread[:, :, None] * by_time[:, None, :]).reshape(len(rows), -1)
    rises, _ = nnls(design, rows[:, 2], maxiter=10_000)
    table = np.tri(deviations) @ rises.reshape(deviations, seconds) @ np.tri(seconds).T
    return np.minimum(table, FUTURE_SECONDS).round(2)


def _find_weights(places, count):
    """Weights (N, count) of the entries between which linear interpolation finds each place (N,) on their scale."""
    return np.maximum(1.0 - np.abs(np.clip(places, 0, count - 1)[:, None] - np.arange(count)), 0.0)


def collect_states(mission):
    """Rows as in `fit` of all UAVs' tracks within `CUTOFF` of a person, at each second that has the future after it."""
    vehicles = mission.team[0].vehicles
    views = np.array([view_quadrangle(v) for v in vehicles])
    radii, speeds = np.array([radius_in_view(view) for view in views]), np.array([v.max_speed for v in vehicles])
    seconds = list(mission.fly())[:: round(mission.scenario.rates.sensing)]
    errors = np.array([[_find_errors(s.people, beliefs_of(tracks).means) for tracks in s.tracks] for s in seconds])
    rows = [np.empty((0, 3))]
    for k, snapshot in enumerate(seconds[:-FUTURE_SECONDS]):
        aims = np.array([pose.position[:2] for pose in snapshot.poses]) + views[:, 4, :2]
        for uav, tracks in enumerate(snapshot.tracks):
            means, covariances = beliefs_of(tracks)
            gaps = length(means[:, None, :2] - snapshot.people)
            person = np.argmin(np.where(np.isnan(gaps), np.inf, gaps), axis=1)
            near = gaps[np.arange(len(gaps)), person] <= CUTOFF
            away = np.maximum(length(means[near, None, :2] - aims) - radii, 0.0) / speeds
            deviations = np.sqrt(np.trace(covariances[near, :2, :2], axis1=1, axis2=2)) / CUTOFF
            future = errors[k + 1 : k + 1 + FUTURE_SECONDS, uav, person[near]].sum(axis=0)
            rows.append(np.column_stack((away.min(axis=1), deviations, future)))
    return np.concatenate(rows)


def _find_errors(people, means):
    """Squared errors (M,) of the nearest means (T, 4) of people (M, 2) m, as `fit` takes them; 0 of absent people."""
    gaps = length(people[:, None] - means[:, :2]).min(axis=1, initial=CUTOFF)
    return np.where(np.isnan(gaps), 0.0, np.minimum(gaps, CUTOFF) / CUTOFF) ** 2


@pytest.mark.slow
def test_the_table_is_what_missions_flown_without_it_teach():
    """Some three minutes: 44 missions."""
    planner = load_planner("sma-nbo-gospa(cost_to_go=0)")
    missions = (
        Mission(load_scenario(world), planner, seed) for world in ("crowd", "scatter") for seed in range(340, 362)
    )
    np.testing.assert_array_equal(fit(np.concatenate([collect_states(mission) for mission in missions])), FUTURE)
