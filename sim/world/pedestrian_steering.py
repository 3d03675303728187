"""Pedestrian steering: people walk to their goals and avoid trunks, borders and one another, only by turning."""

import math
from typing import NamedTuple

import numpy as np

from sim.world.trajectories import SAMPLES_PER_SECOND
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, merged
from tracking.numerics.exponential import exp
from tracking.numerics.trigonometry import arctan2, cos, hypot, sin

SEPARATION = 0.6  # m, between the axes of two people

_STEP = 1 / SAMPLES_PER_SECOND  # s
_LOOK_AHEAD = 6.0  # m, distance of the point of the route to which a person walks
_PERIOD = 6  # steps from one decision to the next
_HORIZON = 20  # rollout steps
_ROLLOUT_STEP = 0.2  # s
_RESPONSE = 2.0  # rad/s; the heading follows the decision as a critically damped second-order system
_LATERAL = 1.0  # m/s², largest lateral acceleration in a turn
_COMFORT = 0.5  # m, preferred distance beyond the least one from trunks and people
_BORDER_COMFORT = 6.0  # m
_CORNER = 10.0  # m, radius of a turn in a corner
_SLACK = 0.02  # m, margin for the motion between two samples
_HEADINGS = 25  # candidates of a decision
_SPREAD = math.radians(9.0)  # between two candidates
_PERSISTENCE = 0.5  # weight of the last decision; the weight of the goal is 1
_BLOCK = 120  # samples for which nearby trunks and people are found at once
_FORESIGHT = 2.0  # s, time over which the weight of a future conflict falls to 1/e; not used for the border


class _Near(NamedTuple):
    """Ascending rows of the trunks and of the people that one person may meet."""

    trunks: Indices
    people: Indices


@compiled
def simulate(states: Array, paces: Array, drifts: Array, routes: Array, trunks: Array, half: Array) -> Array:
    """Positions (K, M, 2) m of M people at given speeds, at intervals of 1 / SAMPLES_PER_SECOND.

    states (M, 4) at the start: position m, heading rad, turn rate rad/s; overwritten. paces (K, M) m/s. drifts (K, M)
    rad/s: turn rates of people without a route. routes (M, P, 2) m: points 1 m apart, NaN after the last. trunks (T, 3)
    m: centre and the distance to keep from it. half (2,) m: people stay where |position| <= half.
    """
    positions = np.empty((len(paces), len(states), 2))
    decisions, progress = states[:, 2].copy(), np.zeros(len(states), dtype=np.int64)
    for first in range(0, len(paces), _BLOCK):
        near = _find_surroundings(states, paces[first : first + _BLOCK], trunks)
        for k in range(first, min(first + _BLOCK, len(paces))):
            for i in range(len(states)):
                positions[k, i, 0], positions[k, i, 1] = states[i, 0], states[i, 1]
            for i in range(len(states)):
                if k % _PERIOD == 0:
                    progress[i] = _advance(states[i], routes[i], progress[i])
                    goal = _find_heading(states[i], routes[i], progress[i], drifts[k, i])
                    hazards = _list_hazards(i, states, paces[k], trunks, near[i])
                    decisions[i] = _decide(states[i], goal, decisions[i], paces[k, i], hazards, half)
                _turn(states[i], decisions[i], paces[k, i], _STEP)
                _move(i, states, paces[k, i], trunks, half, near[i])
    return positions


@merged
def _find_surroundings(states: Array, paces: Array, trunks: Array) -> list[_Near]:
    """Rows of all trunks and people that each person may meet while all walk at these paces (K, M) m/s."""
    fastest = thickest = 0.0
    for pace in paces.flat:
        fastest = max(fastest, pace)
    for trunk in trunks:
        thickest = max(thickest, trunk[2])
    way = fastest * (len(paces) * _STEP + _HORIZON * _ROLLOUT_STEP)  # m, longest way that a person walks and foresees
    bark, apart = thickest + 1 + _SLACK, SEPARATION + 1 + _SLACK
    return [
        _Near(_find_near(state, trunks, way + bark), _find_near(state, states, 2 * way + apart)) for state in states
    ]


@compiled
def _find_near(state: Array, places: Array, reach: float) -> Indices:
    """Ascending rows of the places (n, 2 or more) m that are less than `reach` m from a person."""
    rows, count = np.empty(len(places), dtype=np.int64), 0
    for k in range(len(places)):
        dx, dy = places[k, 0] - state[0], places[k, 1] - state[1]
        if dx * dx + dy * dy < reach * reach:
            rows[count] = k
            count += 1
    return rows[:count].copy()


@compiled
def _advance(state: Array, route: Array, progress: int) -> int:
    """Index of the first point of the route, from `progress` on, at least the look-ahead distance away."""
    while progress < len(route):
        dx, dy = route[progress, 0] - state[0], route[progress, 1] - state[1]
        if not hypot(dx, dy) < _LOOK_AHEAD:
            break
        progress += 1
    return progress


@merged
def _find_heading(state: Array, route: Array, progress: int, drift: float) -> float:
    """Heading [rad] to the next point of the route; after the last one, a heading that turns at the rate `drift`."""
    if progress == len(route) or math.isnan(route[progress, 0]):
        return float(state[2] + 2 * drift / _RESPONSE)
    return arctan2(route[progress, 1] - state[1], route[progress, 0] - state[0])


@merged
def _list_hazards(i: int, states: Array, paces: Array, trunks: Array, near: _Near) -> Array:
    """Trunks and people that person i may meet soon (n, 5): position m, velocity m/s, distance to keep m."""
    hazards, n = np.zeros((len(near.trunks) + len(near.people), 5)), 0
    time = _HORIZON * _ROLLOUT_STEP
    for t in near.trunks:
        trunk = trunks[t]
        if hypot(trunk[0] - states[i, 0], trunk[1] - states[i, 1]) < paces[i] * time + trunk[2] + 1:
            hazards[n, 0], hazards[n, 1], hazards[n, 4] = trunk[0], trunk[1], trunk[2] + _SLACK
            n += 1
    for j in near.people:
        away = hypot(states[j, 0] - states[i, 0], states[j, 1] - states[i, 1])
        if j != i and away < (paces[i] + paces[j]) * time + SEPARATION + 1:
            hazards[n, 0], hazards[n, 1] = states[j, 0], states[j, 1]
            hazards[n, 2] = paces[j] * cos(states[j, 2])
            hazards[n, 3] = paces[j] * sin(states[j, 2])
            hazards[n, 4] = SEPARATION + _SLACK
            n += 1
    return hazards[:n]


@merged
def _decide(state: Array, goal: float, decision: float, pace: float, hazards: Array, half: Array) -> float:
    """Heading [rad] to turn to: close to the goal and to the last decision, and free of conflicts."""
    costs, rated = np.empty(_HEADINGS), np.zeros(_HEADINGS, dtype=np.bool_)
    for n in range(_HEADINGS):
        heading = state[2] + (n - _HEADINGS // 2) * _SPREAD
        to_goal, to_decision = _wrap(heading - goal), _wrap(heading - decision)
        costs[n] = to_goal * to_goal + _PERSISTENCE * to_decision * to_decision
    # Conflicts only add to costs. So the best heading is found once the best one so far has been rated, and the offset
    # needs those beside it.
    best = int(np.argmin(costs))
    while not rated[best]:
        costs[best] += _rate_conflict(state, state[2] + (best - _HEADINGS // 2) * _SPREAD, pace, hazards, half)
        rated[best] = True
        best = int(np.argmin(costs))
    for n in range(max(best - 1, 0), min(best + 2, _HEADINGS)):
        if not rated[n]:
            costs[n] += _rate_conflict(state, state[2] + (n - _HEADINGS // 2) * _SPREAD, pace, hazards, half)
    offset = 0.0
    if 0 < best < _HEADINGS - 1:
        # The vertex of the parabola through the best candidate and its neighbours; exact if nothing is in the way.
        before, after = costs[best - 1] - costs[best], costs[best + 1] - costs[best]
        offset = 0.5 * (before - after) / max(before + after, 1e-12)
    return float(state[2] + (best - _HEADINGS // 2 + offset) * _SPREAD)


@compiled
def _wrap(angle: float) -> float:
    """The same angle in [-π, π) [rad]."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@compiled
def _rate_conflict(state: Array, heading: float, pace: float, hazards: Array, half: Array) -> float:
    """Cost of turning to `heading`; it grows with nearness to the border and to hazards at constant velocity."""
    ahead = state.copy()
    cost = 0.0
    for n in range(_HORIZON):
        x, y = ahead[0], ahead[1]
        _turn(ahead, heading, pace, _ROLLOUT_STEP)
        dx, dy = pace * cos(ahead[2]) * _ROLLOUT_STEP, pace * sin(ahead[2]) * _ROLLOUT_STEP
        ahead[0], ahead[1] = x + dx, y + dy
        weight = exp(-n * _ROLLOUT_STEP / _FORESIGHT) * _ROLLOUT_STEP
        cost += _ROLLOUT_STEP * _rate_gap(_measure_to_border(ahead, half), _BORDER_COMFORT)
        for h in hazards:
            hx, hy = h[2] * _ROLLOUT_STEP, h[3] * _ROLLOUT_STEP
            gap = _measure_to_segment(h[0] + n * hx - x, h[1] + n * hy - y, hx - dx, hy - dy) - h[4]
            cost += weight * _rate_gap(gap, _COMFORT)
    return cost


@compiled
def _rate_gap(gap: float, comfort: float) -> float:
    """Cost per second [rad²/s] of a distance that is `gap` m more than the least one."""
    if gap >= comfort:
        return 0.0
    lack = 1 - gap / comfort
    return 3 * lack * lack + (30.0 - 30.0 * gap if gap < 0 else 0.0)


@merged
def _measure_to_border(state: Array, half: Array) -> float:
    """Distance [m] to the border of the rectangle with half edges (2,) m, with corners rounded for turning."""
    radius = min(_CORNER, min(half[0], half[1]))
    x, y = abs(state[0]) - half[0] + radius, abs(state[1]) - half[1] + radius
    return float(radius - hypot(max(x, 0.0), max(y, 0.0)) - min(max(x, y), 0.0))


@merged
def _measure_to_segment(x: float, y: float, dx: float, dy: float) -> float:
    """Distance from the origin to the segment from (x, y) to (x + dx, y + dy)."""
    length = dx * dx + dy * dy
    s = min(max(-(x * dx + y * dy) / length, 0.0), 1.0) if length > 0 else 0.0
    return hypot(x + s * dx, y + s * dy)


@compiled
def _turn(state: Array, heading: float, pace: float, dt: float) -> None:
    """Turn a person's state towards `heading` for dt s, in place."""
    rate = state[3] + dt * _RESPONSE * (_RESPONSE * _wrap(heading - state[2]) - 2 * state[3])
    limit = _LATERAL / pace
    state[3] = min(max(rate, -limit), limit)
    state[2] += dt * state[3]


@compiled
def _move(i: int, states: Array, pace: float, trunks: Array, half: Array, near: _Near) -> None:
    """Move person i by one step, in place, with the smallest instantaneous turn that avoids touching anything.

    Turns are multiples of 5°. If every heading touches something, the person walks straight on.
    """
    heading, length = states[i, 2], pace * _STEP
    for n in range(73):
        side = (n + 1) // 2 if n % 2 else -(n // 2)
        turned = heading + side * math.radians(5.0)
        x, y = states[i, 0] + length * cos(turned), states[i, 1] + length * sin(turned)
        if _is_free(i, states, x, y, trunks, near) and abs(x) <= half[0] and abs(y) <= half[1]:
            states[i, 0], states[i, 1], states[i, 2] = x, y, turned
            return
    states[i, 0] += length * cos(heading)
    states[i, 1] += length * sin(heading)


@merged
def _is_free(i: int, states: Array, x: float, y: float, trunks: Array, near: _Near) -> bool:
    """True if person i may stand at (x, y) m."""
    for t in near.trunks:
        if hypot(trunks[t, 0] - x, trunks[t, 1] - y) < trunks[t, 2] + _SLACK:
            return False
    for j in near.people:
        if j != i and hypot(states[j, 0] - x, states[j, 1] - y) < SEPARATION + _SLACK:
            return False
    return True
