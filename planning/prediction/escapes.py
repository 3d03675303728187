"""Escapes: where people of lost tracks are if they turned out of sight, as further targets of planning."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planning.planner import Situation
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp
from tracking.numerics.matrices import product
from tracking.numerics.trigonometry import cos_each, sin_each
from tracking.track import Track

_DIRECTIONS, _SECTORS = 36, 6
_SPEEDS = np.arange(0.25, 3.0, 0.5)  # m/s; nobody walks at more than 3
_ANGLES = np.repeat((np.arange(_DIRECTIONS) + 0.5) * math.tau / _DIRECTIONS, len(_SPEEDS))
# (_SECTORS, M, 2) m/s
_VELOCITIES = (
    np.column_stack([cos_each(_ANGLES), sin_each(_ANGLES)]) * np.tile(_SPEEDS, _DIRECTIONS)[:, None]
).reshape(_SECTORS, -1, 2)
_HELD = 0.3  # s since the last detection, up to which a person is not lost
_LONGEST = 60.0  # s out of sight, after which a person may be anywhere
_DETECTION = 0.99  # probability that a person in plain view is detected
_NEARLY_ONE = 1.0 - 1e-6  # largest probability of existence
_LEAST = 0.01  # least probability of a target
# Share of a track's covariance that people have who do not turn; the rest stands for turns. Chosen with a mean time of
# 40 s until people turn, so that beliefs are about calibrated in `forest` with λ = 75 and in `crowd` (seeds 8100-8119).
_WITHOUT_TURNS = 0.7


class _Lost(NamedTuple):
    """A lost track: what is relative is to the probability that the person does not exist."""

    since: float  # s, time of the last detection
    place: Array  # (2,) m, of the last detection
    left: Array  # (_SECTORS, M): likelihood of each velocity, given that no frame showed the person
    time: float  # s
    kept: float  # relative probability that the person moves as predicted
    turned: float  # relative probability that the person has turned, without what frames show


class Escapes:
    """What one UAV knows of people who turned, or changed their speed, where nobody looked.

    People out of sight turn at a rate of 1 / `time`, and walk straight on from where they were last detected: in any
    direction and at any speed up to 3 m/s, as far as no frame at a decision has shown them. Frames that show the belief
    of the track lower its probability of existence, and so raise the probability that the person has turned.

    Source: [Williams15], recycling, with the time since the last detection for the probability of existence.
    Note: people are taken to turn right after they were last detected; only frames at decisions count, and every UAV
    that is heard is taken to have one, which is too much of slow cameras. Where messages come late, all people are out
    of sight to the planner. After `_LONGEST` only the track is left.
    """

    def __init__(self, time: float) -> None:
        """`time` s: mean time until people turn as no motion model predicts."""
        self._time, self._lost = time, dict[int, _Lost]()

    def split(self, situation: Situation) -> tuple[Track, ...]:
        """Tracks of a situation, with those of lost people split into what is predicted and six directions of escape.

        The probabilities of existence of the parts, at most one in all, are those of the person to be there.
        """
        lost = [track for track in situation.tracks if _HELD < situation.time - track.sighting[2] < _LONGEST]
        self._lost = {track.id: self._follow(track, situation) for track in lost}
        parts = list[Track]()
        for track in situation.tracks:
            parts += _split(track, self._lost[track.id]) if track.id in self._lost else [track]
        return tuple(part.renumber(n) for n, part in enumerate(parts))

    def _follow(self, track: Track, situation: Situation) -> _Lost:
        """A lost track at the present decision, after that before."""
        x, y, since = track.sighting
        now = situation.time
        existence = min(track.existence, _NEARLY_ONE)
        odds = existence / (1.0 - existence)
        kept = odds * exp((since - now) / self._time)
        before = self._lost.get(track.id)
        if before is None or before.since != since:
            before = _Lost(since, np.array([x, y]), np.ones(_VELOCITIES.shape[:2]), since, odds, 0.0)
        turned = before.turned + 0.5 * (before.kept + kept) * (now - before.time) / self._time
        left = before.left * (1.0 - _DETECTION * _find_seen(before.place + (now - since) * _VELOCITIES, situation))
        return before._replace(left=left, time=now, kept=kept, turned=turned)


def _find_seen(places: Array, situation: Situation) -> Array:
    """Flags (S, M) of places (S, M, 2) m that a frame of the UAV shows, or of one from which it hears, or outside."""
    points = at_target_height(places.reshape(-1, 2))
    seen = np.any(np.abs(points[:, :2]) > np.array(situation.area) / 2.0, axis=1)
    for vehicle in situation.vehicles:
        if vehicle.id == situation.own.id or situation.receives(vehicle.id):
            shown = np.flatnonzero(~seen & vehicle.camera.sees(Pose(vehicle.position, vehicle.attitude), points))
            seen[shown] = situation.forest.visible(vehicle.position, points[shown])[0]
    return np.asarray(seen.reshape(places.shape[:2]))


def _split(track: Track, lost: _Lost) -> list[Track]:
    """A lost track with the probability that the person moves as predicted, and those of the likely directions."""
    elapsed = lost.time - lost.since
    sums = lost.left.cumsum(axis=1)[:, -1]  # in order
    shares = lost.turned * sums / lost.left.size
    whole = lost.kept + float(shares.cumsum()[-1]) + 1.0
    states = np.concatenate([lost.place + elapsed * _VELOCITIES, _VELOCITIES], axis=2)
    # Between neighbouring directions and speeds there are others; and nobody is located to the centimetre.
    spread = np.diag([0.3 + 0.01 * elapsed * elapsed] * 2 + [0.1] * 2)
    belief = Gaussian(track.belief.mean, _WITHOUT_TURNS * track.belief.covariance)
    parts = [replace(track, belief=belief, existence=lost.kept / whole)]
    for share, total, weights, state in zip(shares, sums, lost.left, states, strict=True):
        if share / whole > _LEAST:
            mean = product(weights[None], state)[0] / total
            away = state - mean
            covariance = product(away.T, weights[:, None] * away) / total + spread
            parts.append(Track(track.id, Gaussian(mean, covariance), float(share / whole), track.sighting))
    return parts
