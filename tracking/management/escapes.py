"""Escapes: where people of lost tracks are if they turned out of sight."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Look
from tracking.geometry.visibility import Forest, at_target_height
from tracking.management.reacquisition import TURNED_SPEED
from tracking.numerics.arrays import Array
from tracking.numerics.exponential import exp, exp_each
from tracking.numerics.matrices import product
from tracking.numerics.trigonometry import cos_each, sin_each
from tracking.track import Track

_DIRECTIONS, _SPEEDS, _SECTORS = 36, 6, 6
_ANGLES = np.repeat((np.arange(_DIRECTIONS) + 0.5) * math.tau / _DIRECTIONS, _SPEEDS)
_FASTEST = 3.0  # m/s; nobody walks faster
_PACES = _FASTEST * np.tile((np.arange(_SPEEDS) + 0.5) / _SPEEDS, _DIRECTIONS)  # m/s
_VELOCITIES = np.column_stack([cos_each(_ANGLES), sin_each(_ANGLES)]) * _PACES[:, None]
_VELOCITIES = _VELOCITIES.reshape(_SECTORS, -1, 2)  # m/s
# A ring's area grows with its radius.
_LIKELY = _PACES * exp_each(-0.5 * np.square(_PACES / (TURNED_SPEED * _FASTEST)))
_LIKELY = (_LIKELY / _LIKELY.cumsum()[-1]).reshape(_SECTORS, -1)  # probabilities of the velocities
TURN_TIME = 20.0  # s, time of turns; with `_WITHOUT_TURNS` beliefs are calibrated
_HELD = 0.3  # s since the last detection, up to which a person is not lost
_DETECTION = 0.99  # probability that a person in plain view is detected
_NEARLY_ONE = 1.0 - 1e-6  # largest probability of existence
_LEAST = 0.01  # least probability of a part
# Share of a track's covariance that people have who do not turn; the rest stands for turns. Chosen with `TURN_TIME` in
# `forest` with λ = 75 (seeds 8100-8119, 8200-8239) and in `crowd` (8100-8107, 8200-8214).
_WITHOUT_TURNS = 0.5


class _Lost(NamedTuple):
    """A lost track; relative probabilities are ratios to the probability that the person does not exist."""

    since: float  # s, time of the last detection
    place: Array  # (2,) m, of the last detection
    left: Array  # (_SECTORS, M): probability of each velocity, and that no frame showed the person
    time: float  # s
    odds: float  # relative probability that the person is there, had nobody turned
    turned: float  # relative probability that the person has turned, without what frames show


class Escapes:
    """Knowledge of one UAV about people who turned, or changed their speed, where nobody looked.

    People out of sight turn at a rate of 1 / `time`, and walk straight on from where they were last detected, to all
    places that no frame at a decision has shown. Their velocities have the distribution of `turned_density` in
    `tracking.management.reacquisition`, up to 3 m/s. Frames that show the belief of the track lower its probability of
    existence, and so raise the probability that the person has turned.

    Source: [Williams15], recycling, with the time since the last detection for the probability of existence.
    Note: people are assumed to turn right after they were last detected, to walk at 3 m/s at most, and not to turn
    where the area ends. A person in plain view is found with probability 0.99, whatever the tracker's setting. Odds
    that fall by `tracking.survival` count as turning, too, so people of sure tracks turn sooner than after `time`: with
    `TURN_TIME` four in ten within 6 s. Without this, no single time fits both `forest` and `crowd`.
    """

    def __init__(self, time: float = TURN_TIME) -> None:
        """`time` s: mean time until people turn as no motion model predicts, survival aside (see the note)."""
        self._time = time
        self._lost = dict[int, _Lost]()

    def split(
        self, time: float, tracks: Sequence[Track], looks: Sequence[Look], forest: Forest, area: tuple[float, float]
    ) -> list[Track]:
        """Tracks; tracks of lost people are split into the predicted part and six directions of escape.

        The parts keep the id of their track. The existence of a part is the probability that the person is there; these
        add up to at most one.
        time [s] of the tracks, which are one UAV's; looks: frames at this time; area: width and height [m], in which
        people stay.
        """
        lost = [track for track in tracks if _HELD < time - track.sighting[2] < math.inf]
        self._lost = {track.id: self._follow(track, time) for track in lost}
        for id, one in self._lost.items():
            seen = _find_seen(one.place + (time - one.since) * _VELOCITIES, looks, forest, area)
            self._lost[id] = one._replace(left=one.left * (1.0 - _DETECTION * seen))
        parts = list[Track]()
        for track in tracks:
            parts += self._divide(track, self._lost[track.id]) if track.id in self._lost else [track]
        return parts

    def _follow(self, track: Track, now: float) -> _Lost:
        """A lost track now, from its earlier state."""
        x, y, since = track.sighting
        existence = min(track.existence, _NEARLY_ONE)
        odds = existence / (1.0 - existence)
        before = self._lost.get(track.id)
        if before is None or before.since != since:
            before = _Lost(since, np.array([x, y]), _LIKELY, since, odds, 0.0)
        # Those who have turned since: the integral if the odds are constant.
        share = exp((since - before.time) / self._time) - exp((since - now) / self._time)
        turned = before.turned + 0.5 * (before.odds + odds) * share
        return before._replace(time=now, odds=odds, turned=turned)

    def _divide(self, track: Track, lost: _Lost) -> list[Track]:
        """Parts of a lost track: the person moves as predicted, or has gone in one of the likely directions."""
        elapsed = lost.time - lost.since
        kept = lost.odds * exp(-elapsed / self._time)
        sums = lost.left.cumsum(axis=1)[:, -1]  # in order
        shares = lost.turned * sums
        whole = kept + float(shares.cumsum()[-1]) + 1.0
        states = np.concatenate([lost.place + elapsed * _VELOCITIES, _VELOCITIES], axis=2)
        # Between neighbouring directions and speeds there are others; and nobody is located to the centimetre.
        spread = np.diag([0.3 + 0.01 * elapsed * elapsed] * 2 + [0.1] * 2)
        belief = Gaussian(track.belief.mean, _WITHOUT_TURNS * track.belief.covariance)
        parts = [replace(track, belief=belief, existence=kept / whole)]
        for share, total, weights, state in zip(shares, sums, lost.left, states, strict=True):
            if share / whole > _LEAST:
                mean = product(weights[None], state)[0] / total
                away = state - mean
                covariance = product(away.T, weights[:, None] * away) / total + spread
                parts.append(Track(track.id, Gaussian(mean, covariance), float(share / whole), track.sighting))
        return parts


def _find_seen(places: Array, looks: Sequence[Look], forest: Forest, area: tuple[float, float]) -> Array:
    """Flags (S, M) of places (S, M, 2) m that a frame shows, or that are outside the area."""
    points = at_target_height(places.reshape(-1, 2))
    seen = np.any(np.abs(points[:, :2]) > np.array(area) / 2.0, axis=1)
    for camera, pose in looks:
        shown = np.flatnonzero(~seen & camera.sees(pose, points))
        seen[shown] = forest.visible(pose.position, points[shown])[0]
    return np.asarray(seen.reshape(places.shape[:2]))
