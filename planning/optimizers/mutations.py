"""Mutations of plans in a search, and the choice of distinct plans, compiled.

Most mutations change a path, the cumulative sums of a plan's controls (H, 2) m/s: metres divided by the length of a
step. If steps of the path are then farther apart than the UAV's speed limit allows, they are pulled together: first the
steps before an anchor towards it, which is the changed step or the end of the path, then all steps towards the start.
"""

import math
from typing import NamedTuple

import numpy as np

from planning.prediction.quadrangle import shortest_move
from planning.prediction.response import Response, follow_command
from planning.prediction.targets_in_reach import TargetsInReach
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import exp
from tracking.numerics.normal import standard_normal
from tracking.numerics.trigonometry import hypot

_SHAKE, _MIX, _BEND, _JOIN, _SIGHT = range(5)
_CYCLE = (_SHAKE, _BEND, _SIGHT, _BEND, _MIX, _BEND, _SIGHT, _JOIN)  # kinds of mutations, in turn
_NONE = -1  # no target in reach
_MARGIN = 1e-3  # m/s, by which a target is brought inside the field of view, so that rounding cannot leave it outside


class Chances(NamedTuple):
    """The random numbers behind N children of plans of k UAVs over H steps."""

    normals: Array  # (N, 3): a change along each axis, and the logarithm of the change's size
    noise: Array  # (ceil(N / cycle), 2 k (H + 1)): two numbers for each UAV, then two for each of its steps
    picks: Indices  # (N,) below 2^62: uniform choices


def draw_chances(rng: np.random.Generator, children: int, parents: Array) -> Chances:
    """Random numbers for a number of children of `parents` (E, k, H, 2)."""
    _, k, H, _ = parents.shape
    rows, columns = math.ceil(children / len(_CYCLE)), 2 * k * (H + 1)
    drawn = standard_normal(rng, 3 * children + rows * columns)  # all at once, because calls are slow
    normals, noise = drawn[: 3 * children].reshape(children, 3), drawn[3 * children :].reshape(rows, columns)
    return Chances(normals, noise, rng.integers(2**62, size=children))


@compiled
def mutate_plans(parents: Array, drawn: Chances, spread: float, max_speeds: Array, in_reach: TargetsInReach) -> Array:
    """Children (N, k, H, 2) m/s of plans, within the speed limits.

    The kinds of mutations take turns, as `_CYCLE` says. A mate is another parent.

    - shake: noise on all steps;
    - bend: a shift of one waypoint, or of the path from there on;
    - sight: the least shift that brings a target into view, or a bend if there is none;
    - mix: a move towards or away from a mate, in proportion to the difference of the parents;
    - join: the mate's path from some step on.

    Noise and bends have the size of `spread` maximum speeds, times a random factor.
    parents (E, k, H, 2) m/s have equally many children; drawn: the random numbers behind these; max_speeds (k,) m/s;
    in_reach: targets that can be brought into view.
    """
    _, k, H, _ = parents.shape
    out, path = np.empty((len(drawn.picks), k, H, 2)), np.empty((H, 2))
    for c in range(len(out)):
        kind, size, pick = _CYCLE[c % len(_CYCLE)], spread * exp(drawn.normals[c, 2]), drawn.picks[c]
        pick, mate = divmod(pick, len(parents))
        _copy(out, c, parents, c * len(parents) // len(out))
        if kind == _SHAKE:
            _shake(out, c, drawn.noise, c // len(_CYCLE), size * math.sqrt(0.5), max_speeds)
            _limit(out, c, max_speeds)
        elif kind == _MIX:
            _mix(out, c, parents, mate, 0.5 * (1.0 + drawn.normals[c, 0]))
            _limit(out, c, max_speeds)
        else:
            pick, keep_end = divmod(pick, 2)  # the anchor: the path's end, or the changed step
            pick, all_later = divmod(pick, 2)
            s = pick % len(in_reach.rows) if kind == _SIGHT and len(in_reach.rows) else _NONE
            j, step = (in_reach.rows[s], in_reach.steps[s]) if s != _NONE else (pick % k, pick // k % H)
            _set_path(path, 0, out, c, j)
            if kind == _JOIN:
                _set_path(path, step, parents, mate, j)
                step = 0
            elif s == _NONE or not _bring_into_view(path, in_reach, s):
                size *= max_speeds[j]
                last = H if all_later else step + 1
                _shift(path, step, last, size * drawn.normals[c, 0], size * drawn.normals[c, 1])
            _tighten(path, H - 1 if keep_end else step, max_speeds[j])
            _set_controls(path, out, c, j)
    return out


@inlined
def _copy(plans: Array, c: int, others: Array, i: int) -> None:
    """Set the plans of one candidate to those of another, in a loop, because slices take much longer."""
    for j in range(plans.shape[1]):
        for step in range(plans.shape[2]):
            plans[c, j, step, 0], plans[c, j, step, 1] = others[i, j, step, 0], others[i, j, step, 1]


@inlined
def _mix(plans: Array, c: int, others: Array, i: int, share: float) -> None:
    """Move the plans of a candidate towards those of another by a share of the difference."""
    for j in range(plans.shape[1]):
        for step in range(plans.shape[2]):
            for axis in range(2):
                plans[c, j, step, axis] += share * (others[i, j, step, axis] - plans[c, j, step, axis])


@inlined
def _shake(plans: Array, c: int, noise: Array, i: int, size: float, max_speeds: Array) -> None:
    """Add a constant offset and white noise over the steps, both of the same variance, to a candidate's plans."""
    k, H = plans.shape[1], plans.shape[2]
    for j in range(k):
        for step in range(H):
            for axis in range(2):
                both = noise[i, 2 * j + axis] + noise[i, 2 * k + 2 * (j * H + step) + axis]
                plans[c, j, step, axis] += size * max_speeds[j] * both


@inlined
def _set_controls(path: Array, plans: Array, c: int, j: int) -> None:
    """Set the plan of UAV j in candidate c to the controls along a path."""
    x = y = 0.0
    for h in range(len(path)):
        plans[c, j, h, 0], plans[c, j, h, 1] = path[h, 0] - x, path[h, 1] - y
        x, y = path[h, 0], path[h, 1]


@inlined
def _shift(path: Array, first: int, last: int, dx: float, dy: float) -> None:
    for h in range(first, last):
        path[h, 0] += dx
        path[h, 1] += dy


@inlined
def _set_path(path: Array, step: int, plans: Array, c: int, j: int) -> None:
    """Set a path, from a step on, to the path of UAV j in candidate c."""
    x = y = 0.0
    for h in range(len(path)):
        x, y = x + plans[c, j, h, 0], y + plans[c, j, h, 1]
        if h >= step:
            path[h, 0], path[h, 1] = x, y


@inlined
def _bring_into_view(path: Array, in_reach: TargetsInReach, s: int) -> bool:
    """Displace a step of a path by the least that brings a target into view; False if the target is already in view."""
    j, h = in_reach.rows[s], in_reach.steps[s]
    x, y = _predict_position(path, h, in_reach.response, j)
    dx, dy = shortest_move(in_reach.views, j, in_reach.places[s, 0] - x, in_reach.places[s, 1] - y)
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return False
    size = (1.0 + _MARGIN / length) / (1.0 - in_reach.response.lacking[j])
    _shift(path, h, h + 1, dx * size, dy * size)
    return True


@inlined
def _predict_position(path: Array, h: int, response: Response, j: int) -> tuple[float, float]:
    """Position of UAV j after step h if a path commands it, which it follows with its lag."""
    x, y, vx, vy = 0.0, 0.0, response.velocities[j, 0], response.velocities[j, 1]
    for i in range(h + 1):
        px, py = (path[i - 1, 0], path[i - 1, 1]) if i else (0.0, 0.0)
        mean, vx = follow_command(response, j, vx, path[i, 0] - px)
        x += mean
        mean, vy = follow_command(response, j, vy, path[i, 1] - py)
        y += mean
    return x, y


@inlined
def _tighten(path: Array, anchor: int, max_speed: float) -> None:
    """Keep the speed limit: pull the steps before `anchor` towards it, then all steps towards the start."""
    for h in range(anchor - 1, -1, -1):
        _pull(path, h, path[h + 1, 0], path[h + 1, 1], max_speed)
    x = y = 0.0
    for h in range(len(path)):
        _pull(path, h, x, y, max_speed)
        x, y = path[h, 0], path[h, 1]


@inlined
def _pull(path: Array, h: int, x: float, y: float, max_speed: float) -> None:
    """Move a step of a path towards (x, y) until the two are at most one step at full speed apart."""
    dx, dy = path[h, 0] - x, path[h, 1] - y
    square = dx * dx + dy * dy
    if square > max_speed * max_speed:
        share = max_speed / math.sqrt(square)
        path[h, 0], path[h, 1] = x + share * dx, y + share * dy


@inlined
def _limit(plans: Array, c: int, max_speeds: Array) -> None:
    """Shorten the controls of a candidate to the speed limits (k,) of its UAVs."""
    for j in range(plans.shape[1]):
        for step in range(plans.shape[2]):
            speed = hypot(plans[c, j, step, 0], plans[c, j, step, 1])
            if speed > max_speeds[j]:
                plans[c, j, step, 0] *= max_speeds[j] / speed
                plans[c, j, step, 1] *= max_speeds[j] / speed


@compiled
def choose_distinct(plans: Array, order: Indices, most: int, apart: float, max_speeds: Array) -> Indices:
    """Indices of plans, taken in order, each with a path that is apart from the paths taken before.

    plans (N, k, H, 2) m/s are taken in `order` until there are `most`; apart: root mean square over UAVs and steps of
    the distance of two paths, in steps at maximum speed; max_speeds (k,) m/s.
    """
    _, k, H, _ = plans.shape
    chosen, count = np.empty(most, dtype=np.int64), 0
    paths = np.empty((most, 2 * k * H))
    for i in order:
        path = paths[count]
        _trace_paths(plans[i], max_speeds, path)
        alike = False
        for c in range(count):
            if _are_within(path, paths[c], k * H * apart * apart):
                alike = True
                break
        if not alike:
            chosen[count] = i
            count += 1
            if count == most:
                break
    return chosen[:count]


@inlined
def _trace_paths(plans: Array, max_speeds: Array, path: Array) -> None:
    """Set the paths (2 k H,) of plans (k, H, 2) m/s, in steps at maximum speed."""
    d = 0
    for j in range(plans.shape[0]):
        x = y = 0.0
        for h in range(plans.shape[1]):
            x += plans[j, h, 0] / max_speeds[j]
            y += plans[j, h, 1] / max_speeds[j]
            path[d], path[d + 1] = x, y
            d += 2


@inlined
def _are_within(one: Array, other: Array, square: float) -> bool:
    """True if the squared distance of points (D,) is below `square`; begins with the last coordinates."""
    total = 0.0
    for d in range(len(one) - 1, -1, -1):
        total += (one[d] - other[d]) * (one[d] - other[d])
        if total >= square:
            return False
    return True
