"""Fit of the learned cost-to-go: to a known table, to a mission taken apart plainly, and to its own missions."""

import math

import numpy as np
import pytest

from planning.objective.cost_to_go import DEVIATION, FUTURE, SECONDS
from planning.planner_loading import load_planner
from sim.calibration.future_errors import CUTOFF, FUTURE_SECONDS, collect_states, fit, fly_and_fit
from sim.mission.mission import Mission
from sim.scenario.loading import load
from tracking.geometry.visibility import TARGET_HEIGHT


def test_the_fit_finds_a_table_again():
    """Rows lie anywhere, also beyond the table's ends, and have noise of mean zero."""
    rng = np.random.default_rng(0)
    times, deviations = rng.uniform(-1.0, 12.0, 40_000), rng.uniform(0.0, 1.2, 40_000)
    i, j = np.clip(deviations / DEVIATION, 0.0, 5.0), np.clip(times / SECONDS, 0.0, 5.0)
    errors = 1.0 + i + j + 0.1 * i * j + rng.normal(0.0, 0.5, 40_000)
    table = [[1.0 + row + column + 0.1 * row * column for column in range(6)] for row in range(6)]
    np.testing.assert_allclose(fit(np.column_stack((times, deviations, errors))), table, atol=0.1)


def test_the_fit_grows_along_both_sides_where_rows_do_not():
    rows = np.array([(SECONDS * i, DEVIATION * j, 9.0 - i - j) for i in range(6) for j in range(6)])
    np.testing.assert_allclose(fit(rows), np.full((6, 6), 4.0))


def test_states_are_those_of_a_mission_taken_apart():
    """All people leave a hovering fleet's views sooner or later."""
    scenario = load("scatter", ["duration=30", "sensing.mode=ideal"])
    planner = load_planner("hover")
    found = collect_states(Mission(scenario, planner, 3))
    seconds = list(Mission(scenario, planner, 3).fly())[:: round(scenario.rates.sensing)]
    fleet, expected = Mission(scenario, planner, 3).team[0].vehicles, []
    for k in range(len(seconds) - FUTURE_SECONDS):
        for uav, tracks in enumerate(seconds[k].tracks):
            for track in tracks:
                gaps = [math.dist(track.belief.mean[:2], person) for person in seconds[k].people]
                if min(gaps) > CUTOFF:
                    continue
                person, future = gaps.index(min(gaps)), 0.0
                for later in seconds[k + 1 : k + 1 + FUTURE_SECONDS]:
                    misses = [math.dist(t.belief.mean[:2], later.people[person]) for t in later.tracks[uav]]
                    future += min([*misses, CUTOFF]) ** 2 / CUTOFF**2
                away = []
                for v, pose in zip(fleet, seconds[k].poses, strict=True):
                    reach = math.tan(v.camera.fov / 2) * (pose.position[2] - TARGET_HEIGHT)
                    gap = math.dist(track.belief.mean[:2], pose.position[:2]) - reach
                    away.append(max(gap, 0.0) / v.max_speed)
                expected.append((min(away), math.sqrt(np.trace(track.belief.covariance[:2, :2])) / CUTOFF, future))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert len(expected) > 100 and max(row[0] for row in expected) > 2.0 and max(row[2] for row in expected) > 5.0


@pytest.mark.slow
def test_the_table_is_what_its_command_finds():
    """Some three minutes: 44 missions."""
    np.testing.assert_array_equal(fly_and_fit()[0], FUTURE)
