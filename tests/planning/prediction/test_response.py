"""UAVs' response to commands: a first-order lag, against a differential equation solved by a library."""

import dataclasses

import numpy as np
from scipy.integrate import solve_ivp

from planning.planner import Plan
from planning.prediction.response import Response, mean_velocities, response


def lagging(team, lags, last):
    """The first situation of a team whose UAVs have these lags [s] and flew these commands (n, 2) m/s last."""
    fleet = [dataclasses.replace(v, lag=lag) for v, lag in zip(team[0].vehicles, lags, strict=True)]
    intents = {v.id: Plan(np.array([command, [9.0, 9.0]])) for v, command in zip(fleet, last, strict=True)}
    return dataclasses.replace(team[0], own=fleet[0], neighbours=tuple(fleet[1:]), intents=intents)


def test_mean_velocities_are_those_of_the_differential_equation_of_a_first_order_lag(random_team):
    rng = np.random.default_rng(0)
    lags, last = (0.65, 0.1, 3.0), rng.uniform(-3, 3, (3, 2))
    situation, plans = lagging(random_team(0), lags, last), rng.uniform(-5, 5, (4, 2, 5, 2))
    found = mean_velocities(response(situation, [0, 2]), plans)
    for n, (j, uav), axis in ((n, row, axis) for n in range(4) for row in enumerate((0, 2)) for axis in range(2)):
        v = last[uav, axis]
        for h in range(5):
            u = plans[n, j, h, axis]
            way = solve_ivp(
                lambda _, s, u=u, lag=lags[uav]: [s[1], (u - s[1]) / lag], (0, 1), [0, v], rtol=1e-10, atol=1e-12
            )
            np.testing.assert_allclose(found[n, j, h, axis], way.y[0, -1], atol=1e-7)
            v = way.y[1, -1]


def test_without_a_lag_mean_velocities_are_the_commands_to_the_bit(random_team):
    rng = np.random.default_rng(1)
    plans = rng.uniform(-5, 5, (4, 3, 5, 2))
    situation = lagging(random_team(0), (0.0, 0.0, 0.0), rng.uniform(-3, 3, (3, 2)))
    assert mean_velocities(response(situation, range(3)), plans).tobytes() == plans.tobytes()
    assert mean_velocities(Response.at_once(3), plans).tobytes() == plans.tobytes()


def test_a_uav_without_a_known_command_hovers_and_none_is_faster_than_its_limit(random_team):
    situation = lagging(random_team(0), (0.65, 0.65, 0.65), np.array([[30.0, 40.0], [1.0, 2.0], [0.0, 0.0]]))
    situation = dataclasses.replace(situation, intents={0: situation.intents[0], 2: Plan(np.zeros((0, 2)))})
    np.testing.assert_allclose(response(situation, range(3)).velocities, [[3.0, 4.0], [0.0, 0.0], [0.0, 0.0]])
