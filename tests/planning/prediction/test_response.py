"""UAVs' response to commands: a first-order lag, against a differential equation solved by a library."""

import dataclasses
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

from planning.prediction.response import mean_velocities, response, vehicle_after
from planning.testing.made_up_teams import make_random_team


def lagging(lags, velocities):
    """UAVs with these lags [s], at these velocities (n, 2) m/s."""
    (situation, *_) = make_random_team(0)
    moving = zip(situation.vehicles[: len(lags)], lags, velocities, strict=True)
    return [dataclasses.replace(v, lag=lag, velocity=velocity) for v, lag, velocity in moving]


def test_mean_velocities_are_those_of_the_differential_equation_of_a_first_order_lag():
    rng = np.random.default_rng(0)
    lags, before = (0.65, 0.1, 3.0), rng.uniform(-3, 3, (3, 2))
    plans = rng.uniform(-5, 5, (4, 3, 5, 2))
    found = mean_velocities(response(lagging(lags, before), 1.0), plans)
    for n, uav, axis in product(range(4), range(3), range(2)):
        v = before[uav, axis]
        for h in range(5):
            u = plans[n, uav, h, axis]
            way = solve_ivp(
                lambda _, s, u=u, lag=lags[uav]: [s[1], (u - s[1]) / lag], (0, 1), [0, v], rtol=1e-10, atol=1e-12
            )
            np.testing.assert_allclose(found[n, uav, h, axis], way.y[0, -1], atol=1e-7)
            v = way.y[1, -1]


def test_a_uav_without_a_lag_has_its_commands_to_the_bit_beside_others_that_lag():
    rng = np.random.default_rng(1)
    plans = rng.uniform(-5, 5, (4, 3, 5, 2))
    fleet = lagging((0.0, 1e-4, 0.65), rng.uniform(-3, 3, (3, 2)))
    found = mean_velocities(response(fleet, 0.5), plans)
    assert found[:, 0].tobytes() == plans[:, 0].tobytes()
    np.testing.assert_allclose(found[:, 1], plans[:, 1], atol=2e-4 * 16.0)  # a lag of 0.2 per mille of the step
    assert np.abs(found[:, 2] - plans[:, 2]).max(axis=(0, 2)).min() > 0.5
    command = np.array([-3.0, 2.0])
    after = vehicle_after(fleet[0], command, 0.5)
    assert after.velocity.tolist() == [-3.0, 2.0]  # at once
    np.testing.assert_allclose(after.position, [*(fleet[0].position[:2] + 0.5 * command), fleet[0].position[2]])


def test_none_is_taken_to_be_faster_than_its_limit():
    fleet = lagging((0.65, 0.65), np.array([[30.0, 40.0], [1.0, 2.0]]))
    np.testing.assert_allclose(response(fleet, 1.0).velocities, [[3.0, 4.0], [1.0, 2.0]])


def test_a_vehicle_a_step_later_has_moved_and_turned_as_the_differential_equation_says():
    (uav,) = lagging((0.65,), np.array([[1.0, -2.0]]))
    command, left = np.array([-3.0, 2.0]), np.exp(-0.5 / 0.65)
    after = vehicle_after(uav, command, 0.5)
    np.testing.assert_allclose(after.velocity, command + left * (uav.velocity - command))
    way = 0.5 * command + 0.65 * (1.0 - left) * (uav.velocity - command)
    np.testing.assert_allclose(after.position, [*(uav.position[:2] + way), uav.position[2]])
