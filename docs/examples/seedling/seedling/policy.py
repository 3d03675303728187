"""The policy, compiled: of a UAV's tracks and moves, the best move; the same bits on every processor."""

import math
from typing import NamedTuple

import numpy as np

from planning.prediction.quadrangle import inside, shortest_move
from seedling.weights import MOVE_FEATURES, TRACK_FEATURES, Weights
from tracking.geometry.line_of_sight import Grid, unobstructed
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.exponential import exp

_ASIDE = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  # standard deviations from a track's mean
_NEAR = 10.0  # m: UAVs nearer than this to one another, and tracks in a group


class View(NamedTuple):
    """Knowledge of the UAV in row `own`: n UAVs, T tracks, a raster of people not found."""

    own: int
    views: Array  # (n, 5, 3) fields of view, see `view_quadrangle`
    positions: Array  # (n, 3) m
    nexts: Array  # (n, 3) m, where the others are expected after a step
    reach: float  # m, of a step at top speed
    step: float  # s
    tracks: Array  # (T, 6): position, velocity, standard deviation along each axis after a step
    known: Array  # (T, 4): trace of the covariance [m²], time since the last sighting [s], existence, last attention
    cylinders: Array
    grid: Grid
    unseen: Array  # (rows, columns)
    low: tuple[float, float]
    cell: tuple[float, float]


@compiled
def network(linear: Array, into: Array, out: Array, x: Array) -> Array:
    """Outputs of a network: a linear part and a hidden layer of x / (1 + |x|)."""
    y = np.zeros(len(linear))
    for o in range(len(linear)):
        for i in range(len(x)):
            y[o] += linear[o, i] * x[i]
    for h in range(len(into)):
        z = 0.0
        for i in range(len(x)):
            z += into[h, i] * x[i]
        z /= 1.0 + abs(z)
        for o in range(len(linear)):
            y[o] += out[o, h] * z
    return y


@compiled
def share_seen(view: View, uav: int, camera: tuple[float, float, float], t: int, ahead: float) -> float:
    """Share of five points of track t, so many seconds ahead, that a UAV sees from the camera's place."""
    track, seen = view.tracks[t], 0
    x, y = track[0] + ahead * track[2], track[1] + ahead * track[3]
    for a, b in _ASIDE:
        px, py = x + a * track[4], y + b * track[5]
        if inside(view.views, uav, px - camera[0], py - camera[1]):
            seen += unobstructed(camera, (px, py, TARGET_HEIGHT), view.cylinders, view.grid)
    return seen / len(_ASIDE)


@compiled
def gap(view: View, uav: int, x: float, y: float, place: tuple[float, float]) -> float:
    """Distance [m] by which a UAV at (x, y) has to move until its field of view covers a place."""
    dx, dy = shortest_move(view.views, uav, place[0] - x, place[1] - y)
    return math.sqrt(dx * dx + dy * dy)


@compiled
def goals(view: View, longest: float) -> Array:
    """Places (T, 2) m where the UAV can meet each track, at most `longest` s ahead."""
    found = np.empty((len(view.tracks), 2))
    x, y = view.positions[view.own, 0], view.positions[view.own, 1]
    for t in range(len(found)):
        track = view.tracks[t]
        far = gap(view, view.own, x, y, (track[0], track[1]))
        ahead = min(longest, view.step * max(1.0, far / max(view.reach, 1e-9)))
        found[t] = track[0] + ahead * track[2], track[1] + ahead * track[3]
    return found


@compiled
def track_features(view: View, goals: Array) -> Array:
    """Features (T, 15) of the tracks."""
    out = np.empty((len(goals), TRACK_FEATURES))
    n, own, T = len(view.views), view.own, len(goals)
    for t in range(T):
        place = goals[t, 0], goals[t, 1]
        mine = gap(view, own, view.positions[own, 0], view.positions[own, 1], place)
        theirs, others, nearer, claimed = 1e9, 0.0, 0, 0.0
        for j in range(n):
            if j != own:
                x, y, z = view.nexts[j]
                far, before = gap(view, j, x, y, place), gap(view, j, view.positions[j, 0], view.positions[j, 1], place)
                theirs, nearer = min(theirs, far), nearer + (far < mine)
                claimed = max(claimed, (before - far) / (0.2 * far + view.reach + 1e-9))
                others = max(others, share_seen(view, j, (x, y, z), t, view.step))
        x, y, z = view.positions[own]
        seen, group = share_seen(view, own, (x, y, z), t, 0.0), 0
        for u in range(T):
            dx, dy = view.tracks[u, 0] - view.tracks[t, 0], view.tracks[u, 1] - view.tracks[t, 1]
            group += u != t and dx * dx + dy * dy < _NEAR * _NEAR
        trace, age, existence, last = view.known[t]
        row = out[t]
        row[0], row[1], row[2], row[3] = 1.0, trace / (trace + 1.0), trace / (trace + 25.0), age / (age + 5.0)
        row[4], row[5], row[6] = existence, mine / (mine + 10.0), theirs / (theirs + 10.0)
        row[7], row[8], row[9] = (theirs - mine) / (theirs + mine + 5.0), others, seen
        row[10], row[11], row[12], row[13] = nearer / n, last, T / (T + 3.0 * n), group / (group + 2.0)
        row[14] = claimed
    return out


@compiled
def worths(weights: Weights, features: Array) -> Array:
    """Worth of seeing each track, and the attention to it, which adds up to one (T, 2)."""
    out = np.empty((len(features), 2))
    for t in range(len(features)):
        out[t] = network(weights.track_linear, weights.track_in, weights.track_out, features[t])
        out[t, 0] += math.sqrt(out[t, 0] * out[t, 0] + 1.0)  # above zero
    if len(out):
        most, total = out[:, 1].max(), 0.0
        for t in range(len(out)):
            out[t, 1] = exp(4.0 * (out[t, 1] - most))
            total += out[t, 1]
        out[:, 1] /= total
    return out


@compiled
def value_of_pairs(weights: Weights, view: View, move: Array, worth: Array, about: tuple[Array, Array]) -> float:
    """Worth of a move (2,) m for all tracks; about: features and goals of the tracks."""
    features, aims, own, value = about[0], about[1], view.own, 0.0
    x, y, z = view.positions[own, 0] + move[0], view.positions[own, 1] + move[1], view.positions[own, 2]
    row = np.empty(MOVE_FEATURES)
    for t in range(len(aims)):
        track, goal = view.tracks[t], (aims[t, 0], aims[t, 1])
        before = gap(view, own, view.positions[own, 0], view.positions[own, 1], goal)
        after = gap(view, own, x, y, goal)
        dx = track[0] + view.step * track[2] - x - view.views[own, 4, 0]
        dy = track[1] + view.step * track[3] - y - view.views[own, 4, 1]
        off = math.sqrt(dx * dx + dy * dy)
        soon = share_seen(view, own, (x, y, z), t, view.step)
        row[0], row[1] = soon, share_seen(view, own, (x, y, z), t, 2.0 * view.step)
        row[2], row[3] = after / (after + 10.0), (before - after) / max(view.reach, 1e-9)
        row[4], row[5] = off / (off + 10.0), soon * (1.0 - features[t, 8])
        row[6], row[7] = soon * features[t, 1], soon * (1.0 - features[t, 9])
        done = network(weights.move_linear, weights.move_in, weights.move_out, row)
        value += worth[t, 0] * done[0] + worth[t, 1] * done[1]
    return float(value)


@compiled
def search_goal(view: View, scalars: Array) -> tuple[float, float, float]:
    """Place [m] where most people not found are expected about a field of view, for its distance; and their number."""
    rows, columns = view.unseen.shape
    own, best, found = view.own, 0.0, (0.0, 0.0, 0.0)
    for r in range(rows):
        for c in range(columns):
            people = view.unseen[max(0, r - 2) : r + 3, max(0, c - 2) : c + 3]
            around = 0.0
            for a in range(people.shape[0]):
                for b in range(people.shape[1]):
                    around += people[a, b]
            x, y = view.low[0] + (c + 0.5) * view.cell[0], view.low[1] + (r + 0.5) * view.cell[1]
            mine = gap(view, own, view.positions[own, 0], view.positions[own, 1], (x, y))
            score = around / (1.0 + mine / (abs(scalars[3]) * 10.0 + 1.0))
            for j in range(len(view.views)):
                if j != own and gap(view, j, view.nexts[j, 0], view.nexts[j, 1], (x, y)) < mine:
                    score /= 1.0 + abs(scalars[4])
            if score > best:
                best, found = score, (x, y, around)
    return found


@compiled
def value_of_place(view: View, move: Array, scalars: Array, goal: tuple[float, float, float]) -> float:
    """Worth of a move (2,) m for the search, less what it costs to fly and to be near to other UAVs."""
    own, x, y = view.own, view.positions[view.own, 0], view.positions[view.own, 1]
    u, v, expected, value = x + move[0], y + move[1], 0.0, 0.0
    if goal[2] > 0.0:
        for r in range(view.unseen.shape[0]):
            for c in range(view.unseen.shape[1]):
                dx = view.low[0] + (c + 0.5) * view.cell[0] - u
                dy = view.low[1] + (r + 0.5) * view.cell[1] - v
                if view.unseen[r, c] > 0.0 and inside(view.views, own, dx, dy):
                    expected += view.unseen[r, c]
        place = goal[0], goal[1]
        nearer = (gap(view, own, x, y, place) - gap(view, own, u, v, place)) / max(view.reach, 1e-9)
        value += abs(scalars[0]) * 4.0 * expected / (1.0 + expected)
        value += abs(scalars[1]) * 4.0 * nearer * goal[2] / (goal[2] + abs(scalars[2]) + 1e-3)
    value -= abs(scalars[5]) * math.sqrt(move[0] * move[0] + move[1] * move[1]) / max(view.reach, 1e-9)
    for j in range(len(view.views)):
        dx, dy = view.nexts[j, 0] - u, view.nexts[j, 1] - v
        off = math.sqrt(dx * dx + dy * dy)
        if j != own and off < _NEAR:
            value -= scalars[7] * (1.0 - off / _NEAR)
    return float(value)


@compiled
def candidates(view: View, aims: Array, rays: Array) -> Array:
    """Moves (K, 2) m to choose from: `rays` (R, 2) times the reach, and to cover and to centre each track."""
    own, reach = view.own, view.reach
    moves = np.empty((len(rays) + 2 * len(aims), 2))
    moves[: len(rays)] = reach * rays
    for t in range(len(aims)):
        x, y = aims[t, 0] - view.positions[own, 0], aims[t, 1] - view.positions[own, 1]
        cover = shortest_move(view.views, own, x, y)
        centre = x - view.views[own, 4, 0], y - view.views[own, 4, 1]
        for k, (dx, dy) in enumerate((cover, centre)):
            slower = min(1.0, reach / max(math.sqrt(dx * dx + dy * dy), 1e-300))
            moves[len(rays) + 2 * t + k] = dx * slower, dy * slower
    return moves


@compiled
def choose(weights: Weights, view: View, rays: Array) -> tuple[Array, Array]:
    """The best move (2,) m of a UAV, and its attention (T,) to each track."""
    aims = goals(view, abs(weights.scalars[6]) * 10.0)
    features = track_features(view, aims)
    worth = worths(weights, features)
    moves, best = candidates(view, aims, rays), -np.inf
    goal, chosen = search_goal(view, weights.scalars), moves[0]
    for k in range(len(moves)):
        value = value_of_pairs(weights, view, moves[k], worth, (features, aims))
        value += value_of_place(view, moves[k], weights.scalars, goal)
        if value > best:
            best, chosen = value, moves[k]
    return chosen, worth[:, 1]
