"""Features of a UAV's moves, compiled: what each would do for each track, for the search and for its distances."""

import math
from typing import NamedTuple

import numpy as np

from seedling.weights import PAIR_FEATURES, PLACE_FEATURES
from understory import TARGET_HEIGHT, Array, Grid, compiled, detectability, inside, shortest_move

_ASIDE = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  # standard deviations from a track's mean
_NEAR = 10.0  # m: UAVs nearer than this to one another, and tracks in a group
_OF_TRACK = 15  # features of a track, before those of a move and it
_LOOKS = 3  # steps ahead


class View(NamedTuple):
    """Knowledge of the UAV in row `own`: n UAVs, T tracks, a raster of people not found."""

    own: int
    views: Array  # (n, 5, 3) fields of view, see `view_quadrangle`
    positions: Array  # (n, 3) m
    nexts: Array  # (n, 3) m, where the others are expected after a step
    last: Array  # (2,) m, what the own UAV flew in the last step
    reach: float  # m, of a step at top speed
    step: float  # s
    tracks: Array  # (T, 6): position, velocity, standard deviation along each axis after a step
    known: Array  # (T, 3): trace of the covariance [m²], time since the last sighting [s], existence
    cylinders: Array
    grid: Grid
    undetected: Array  # (rows, columns)
    low: tuple[float, float]
    cell: tuple[float, float]


@compiled
def share_seen(view: View, uav: int, camera: tuple[float, float, float], t: int, ahead: float) -> float:
    """Share of five points of track t, so many seconds ahead, that a UAV sees from the camera's place."""
    track, seen = view.tracks[t], 0.0
    x, y = track[0] + ahead * track[2], track[1] + ahead * track[3]
    for a, b in _ASIDE:
        px, py = x + a * track[4], y + b * track[5]
        if inside(view.views[uav], px - camera[0], py - camera[1]):
            seen += detectability(camera, (px, py, TARGET_HEIGHT), view.views[uav, 4, 2], view.cylinders, view.grid)
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
def of_tracks(view: View, aims: Array) -> Array:
    """Features (T, 15) of the tracks that do not depend on the move."""
    out = np.empty((len(aims), _OF_TRACK))
    n, own, T = len(view.views), view.own, len(aims)
    for t in range(T):
        place = aims[t, 0], aims[t, 1]
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
        trace, age, existence = view.known[t]
        row = out[t]
        row[0], row[1], row[2], row[3] = 1.0, trace / (trace + 1.0), trace / (trace + 25.0), age / (age + 5.0)
        row[4], row[5], row[6] = existence, mine / (mine + 10.0), theirs / (theirs + 10.0)
        row[7], row[8], row[9] = (theirs - mine) / (theirs + mine + 5.0), others, seen
        row[10], row[11], row[12], row[13] = nearer / n, trace / (trace + 5.0), T / (T + 3.0 * n), group / (group + 2.0)
        row[14] = claimed
    return out


@compiled
def of_pair(view: View, move: Array, t: int, about: tuple[Array, Array], row: Array) -> None:
    """Fill a row (12,) with the features of a move (2,) m and track t; about: features of tracks and their goals."""
    known, goal, own = about[0][t], (about[1][t, 0], about[1][t, 1]), view.own
    x, y, z = view.positions[own]
    before, after = gap(view, own, x, y, goal), gap(view, own, x + move[0], y + move[1], goal)
    track, seen = view.tracks[t], 0.0
    for k in range(_LOOKS):
        camera = x + (k + 1) * move[0], y + (k + 1) * move[1], z
        row[k] = share_seen(view, own, camera, t, (k + 1) * view.step)
        seen = max(seen, row[k])
    here = x + move[0], y + move[1], z
    row[3] = 0.5 * (share_seen(view, own, here, t, 2.0 * view.step) + share_seen(view, own, here, t, 3.0 * view.step))
    dx = track[0] + view.step * track[2] - here[0] - view.views[own, 4, 0]
    dy = track[1] + view.step * track[3] - here[1] - view.views[own, 4, 1]
    off = math.sqrt(dx * dx + dy * dy)
    row[4], row[5], row[6] = after / (after + 10.0), (before - after) / max(view.reach, 1e-9), off / (off + 10.0)
    row[7], row[8], row[9] = row[0] * (1.0 - known[8]), row[0] * known[1], row[5] * known[7]
    row[10], row[11] = max(seen, row[3]) * known[2], row[5] * known[2]


@compiled
def search_goal(view: View) -> tuple[float, float, float]:
    """Place [m] where most people not found are expected about a field of view, for its distance; and their number."""
    rows, columns = view.undetected.shape
    own, best, found = view.own, 0.0, (0.0, 0.0, 0.0)
    for r in range(rows):
        for c in range(columns):
            people = view.undetected[max(0, r - 2) : r + 3, max(0, c - 2) : c + 3]
            around = 0.0
            for a in range(people.shape[0]):
                for b in range(people.shape[1]):
                    around += people[a, b]
            x, y = view.low[0] + (c + 0.5) * view.cell[0], view.low[1] + (r + 0.5) * view.cell[1]
            mine = gap(view, own, view.positions[own, 0], view.positions[own, 1], (x, y))
            score = around / (1.0 + mine / 20.0)
            for j in range(len(view.views)):
                if j != own and gap(view, j, view.nexts[j, 0], view.nexts[j, 1], (x, y)) < mine:
                    score *= 0.6
            if score > best:
                best, found = score, (x, y, around)
    return found


@compiled
def of_place(view: View, move: Array, goal: tuple[float, float, float], row: Array) -> None:
    """Fill a row (8,) with the features of a move (2,) m that do not depend on tracks."""
    own, x, y = view.own, view.positions[view.own, 0], view.positions[view.own, 1]
    reach, expected, nearer, close = max(view.reach, 1e-9), 0.0, 0.0, 0.0
    if goal[2] > 0.0:
        for r in range(view.undetected.shape[0]):
            for c in range(view.undetected.shape[1]):
                dx = view.low[0] + (c + 0.5) * view.cell[0] - x - 2.0 * move[0]
                dy = view.low[1] + (r + 0.5) * view.cell[1] - y - 2.0 * move[1]
                if view.undetected[r, c] > 0.0 and inside(view.views[own], dx, dy):
                    expected += view.undetected[r, c]
        place = goal[0], goal[1]
        nearer = (gap(view, own, x, y, place) - gap(view, own, x + move[0], y + move[1], place)) / reach
    for j in range(len(view.views)):
        dx, dy = view.nexts[j, 0] - x - move[0], view.nexts[j, 1] - y - move[1]
        if j != own:
            close = max(close, 1.0 - math.sqrt(dx * dx + dy * dy) / _NEAR)
    ax, ay = (move[0] - view.last[0]) / reach, (move[1] - view.last[1]) / reach
    row[0], row[1], row[2] = 1.0, expected / (1.0 + expected), nearer
    row[3], row[4] = nearer * goal[2] / (1.0 + goal[2]), math.sqrt(move[0] * move[0] + move[1] * move[1]) / reach
    row[5], row[6] = close, math.sqrt(ax * ax + ay * ay)
    row[7] = len(view.tracks) / (len(view.tracks) + 3.0)


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
def described(view: View, rays: Array) -> tuple[Array, Array, Array]:
    """Moves (K, 2) m, their features with each track (K, T, 27) and without tracks (K, 8)."""
    aims = goals(view, 10.0)
    known, moves, goal = of_tracks(view, aims), candidates(view, aims, rays), search_goal(view)
    pairs = np.empty((len(moves), len(aims), PAIR_FEATURES))
    places = np.empty((len(moves), PLACE_FEATURES))
    for k in range(len(moves)):
        for t in range(len(aims)):
            pairs[k, t, :_OF_TRACK] = known[t]
            of_pair(view, moves[k], t, (known, aims), pairs[k, t, _OF_TRACK:])
        of_place(view, moves[k], goal, places[k])
    return moves, pairs, places
