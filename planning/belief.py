"""The nominal belief over a horizon: where targets will be, who would see them, and what that does to P."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.planner import Situation, Vehicle
from planning.view import inside, quadrangle, reach
from tracking.compiled import Array, compiled
from tracking.noise import ground_covariance
from tracking.tracker import Track
from tracking.visibility import TARGET_HEIGHT, Forest, blocked


class Outlook(NamedTuple):
    """All that the compiled objective needs to know, as arrays: n UAVs, T targets, H steps.

    A tuple of arrays rather than a class, because that is what compiled code can take.
    """

    step: float  # s
    noise: Array  # (3,): process noise of one step on position, position-velocity and velocity
    nominal: Array  # (H, T, 3) m: where the targets are if nothing disturbs them, at the target's height
    covariances: Array  # (T, 4, 4): P now
    positions: Array  # (n, 3) m: UAVs now
    views: Array  # (n, 5, 3): fields of view at the target's height, see `planning.view.quadrangle`
    quality: Array  # (n, 7): coefficients of each UAV's noise model
    blockers: Array  # (B, 5): cylinders near each nominal point, point after point
    offsets: NDArray[np.int64]  # (H T + 1,): where each point's cylinders begin


def outlook(situation: Situation, horizon: int) -> Outlook:
    """What a UAV expects for the next `horizon` steps ([Li22] Algorithm 1, step 1)."""
    vehicles, motion = situation.vehicles, situation.motion
    nominal = nominal_positions(situation.tracks, motion.dt, horizon)
    blockers, offsets = _near(situation.forest, nominal, vehicles)
    covariances = [t.belief.covariance for t in situation.tracks]
    return Outlook(
        step=motion.dt,
        noise=np.array([motion.Q[0, 0], motion.Q[0, 2], motion.Q[2, 2]]),
        nominal=nominal,
        covariances=np.array(covariances, dtype=float).reshape(-1, 4, 4),
        positions=np.array([v.position for v in vehicles], dtype=float),
        views=np.array([quadrangle(v) for v in vehicles]),
        quality=np.array([v.noise.coefficients for v in vehicles]),
        blockers=blockers,
        offsets=offsets,
    )


def nominal_positions(tracks: Sequence[Track], step: float, horizon: int) -> Array:
    """Undisturbed positions (H, T, 3) m of the tracks after 1 to H steps of `step` s."""
    means = np.array([t.belief.mean for t in tracks], dtype=float).reshape(-1, 4)
    ahead = step * np.arange(1, horizon + 1)[:, None, None]
    planar = means[:, :2] + ahead * means[:, 2:]
    return np.concatenate([planar, np.full((*planar.shape[:2], 1), TARGET_HEIGHT)], axis=2)


def _near(forest: Forest, nominal: Array, vehicles: Sequence[Vehicle]) -> tuple[Array, NDArray[np.int64]]:
    """The cylinders that can hide each nominal point from any UAV that has it in its field of view.

    Seen from below, a line of sight leaves the height of the trees within a few metres, so that a point has a
    handful of candidates, however large the forest.
    """
    cylinders = forest.blockers
    points = nominal.reshape(-1, 3)
    farthest = np.zeros(len(cylinders))
    for v in vehicles:
        height = v.position[2] - TARGET_HEIGHT
        share = np.clip((cylinders[:, 4] - TARGET_HEIGHT) / height, 0.0, 1.0)
        farthest = np.maximum(farthest, share * reach(v))
    gap = np.hypot(points[:, None, 0] - cylinders[:, 0], points[:, None, 1] - cylinders[:, 1])
    rows, columns = np.nonzero(gap <= cylinders[:, 2] + farthest)
    offsets = np.searchsorted(rows, np.arange(len(points) + 1)).astype(np.int64)
    return np.ascontiguousarray(cylinders[columns]), offsets


@compiled
def add_information(outlook: Outlook, uav: int, camera: Array, cell: int, information: Array) -> None:
    """Add R⁻¹ (3,): xx, xy, yy to `information` if the UAV with its camera at (3,) m sees the nominal point `cell`.

    `cell` counts (step, target) pairs. Visibility is that of the nominal point: all or nothing.
    """
    targets = outlook.nominal.shape[1]
    point = outlook.nominal[cell // targets, cell % targets]
    dx, dy = point[0] - camera[0], point[1] - camera[1]
    if not inside(outlook.views, uav, dx, dy):
        return
    for k in range(outlook.offsets[cell], outlook.offsets[cell + 1]):
        if blocked(camera, point, outlook.blockers[k]):
            return
    xx, xy, yy = ground_covariance(dx, dy, outlook.quality[uav])
    determinant = xx * yy - xy * xy
    information[0] += yy / determinant
    information[1] -= xy / determinant
    information[2] += xx / determinant


@compiled
def transition(P: Array, step: float, noise: Array, information: Array) -> None:
    """Belief-state transition of P (4, 4), in place: predict one step, then take in the fused information (3,).

    [Li22] eq. (1) and the covariance part of the Kalman update; with no information P only grows.
    """
    for a in range(2):
        for b in range(2):
            P[a, b] += step * (P[a, b + 2] + P[a + 2, b]) + step * step * P[a + 2, b + 2]
    for a in range(2):
        for b in range(2):
            P[a, b + 2] += step * P[a + 2, b + 2]
            P[b + 2, a] = P[a, b + 2]
        P[a, a] += noise[0]
        P[a, a + 2] += noise[1]
        P[a + 2, a] = P[a, a + 2]
        P[a + 2, a + 2] += noise[2]
    jxx, jxy, jyy = information[0], information[1], information[2]
    if jxx == 0.0 and jyy == 0.0:
        return
    # S⁻¹ = (I + J P_pp)⁻¹ J, which needs no inverse of J.
    a, b = 1.0 + jxx * P[0, 0] + jxy * P[1, 0], jxx * P[0, 1] + jxy * P[1, 1]
    c, d = jxy * P[0, 0] + jyy * P[1, 0], 1.0 + jxy * P[0, 1] + jyy * P[1, 1]
    determinant = a * d - b * c
    sxx, sxy, syy = (
        (d * jxx - b * jxy) / determinant,
        (d * jxy - b * jyy) / determinant,
        (a * jyy - c * jxy) / determinant,
    )
    x0, x1, x2, x3 = P[0, 0], P[1, 0], P[2, 0], P[3, 0]
    y0, y1, y2, y3 = P[0, 1], P[1, 1], P[2, 1], P[3, 1]
    xs, ys = (x0, x1, x2, x3), (y0, y1, y2, y3)
    for i in range(4):
        gx, gy = xs[i] * sxx + ys[i] * sxy, xs[i] * sxy + ys[i] * syy
        for j in range(4):
            P[i, j] -= gx * xs[j] + gy * ys[j]
