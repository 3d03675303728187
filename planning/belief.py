"""The belief over a horizon: where targets may be, who would see them, and what that does to P."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planning.planner import Situation, Vehicle
from planning.view import inside, quadrangle, reach
from tracking.compiled import Array, compiled
from tracking.noise import ground_covariance
from tracking.visibility import TARGET_HEIGHT, Forest, Vector, blocked


class Outlook(NamedTuple):
    """All that the compiled objective needs to know, as arrays: n UAVs, T targets, H steps.

    A tuple of arrays rather than a class, because that is what compiled code can take.
    """

    step: float  # s
    noise: Array  # (3,): process noise of one step on position, position-velocity and velocity
    points: Array  # (H, T, K, 3) m: where the targets may be, equally probable, at their height; the first is the mean
    covariances: Array  # (T, 4, 4): P now
    positions: Array  # (n, 3) m: UAVs now
    views: Array  # (n, 5, 3): fields of view at the target's height, see `planning.view.quadrangle`
    quality: Array  # (n, 7): coefficients of each UAV's noise model
    blockers: Array  # (B, 5): cylinders near each of the points, one after another
    offsets: NDArray[np.int64]  # (H T K + 1,): where each point's cylinders begin


def outlook(situation: Situation, points: Array, covariances: Array) -> Outlook:
    """What a UAV expects of targets that may be at `points` (H, T, K, 3) m and have covariances (T, 4, 4) now."""
    vehicles, motion = situation.vehicles, situation.motion
    blockers, offsets = _near(situation.forest, points, vehicles, motion.dt * len(points))
    return Outlook(
        step=motion.dt,
        noise=np.array([motion.Q[0, 0], motion.Q[0, 2], motion.Q[2, 2]]),
        points=points,
        covariances=covariances,
        positions=np.array([v.position for v in vehicles], dtype=float),
        views=np.array([quadrangle(v) for v in vehicles]),
        quality=np.array([v.noise.coefficients for v in vehicles]),
        blockers=blockers,
        offsets=offsets,
    )


def _near(
    forest: Forest, points: Array, vehicles: Sequence[Vehicle], duration: float
) -> tuple[Array, NDArray[np.int64]]:
    """The cylinders that can hide each point (..., 3) m from any UAV that within `duration` s has it in view.

    Seen from below, a line of sight leaves the height of the trees within a few metres, so that a point has a
    handful of candidates, however large the forest.
    """
    cylinders = forest.blockers
    points = points.reshape(-1, 3)
    farthest = np.zeros(len(cylinders))
    for v in vehicles:
        height = v.position[2] - TARGET_HEIGHT
        share = np.clip((cylinders[:, 4] - TARGET_HEIGHT) / height, 0.0, 1.0)
        gap = np.linalg.norm(points[:, :2] - v.position[:2], axis=1).max(initial=0.0) + v.max_speed * duration
        farthest = np.maximum(farthest, share * min(reach(v), gap))
    gap = np.hypot(points[:, None, 0] - cylinders[:, 0], points[:, None, 1] - cylinders[:, 1])
    rows, columns = np.nonzero(gap <= cylinders[:, 2] + farthest)
    offsets = np.searchsorted(rows, np.arange(len(points) + 1)).astype(np.int64)
    return np.ascontiguousarray(cylinders[columns]), offsets


@compiled
def observe(outlook: Outlook, uav: int, path: Array, information: Array, seen: NDArray[np.bool_]) -> None:
    """Add R⁻¹ (3,): xx, xy, yy to rows of `information` (H T, 3) of targets that a UAV sees from its path (H, 3) m.

    Rows count (step, target) pairs; those of targets seen are marked in `seen` (H T,). Visibility is that of the
    points where a target may be, all or nothing for each; each adds its share.
    """
    points, views, blockers, offsets = outlook.points, outlook.views, outlook.blockers, outlook.offsets
    quality = outlook.quality[uav]
    steps, targets, count = points.shape[0], points.shape[1], points.shape[2]
    index = -1
    for step in range(steps):
        camera = path[step, 0], path[step, 1], path[step, 2]
        for t in range(targets):
            for k in range(count):
                index += 1
                point = points[step, t, k, 0], points[step, t, k, 1], points[step, t, k, 2]
                dx, dy = point[0] - camera[0], point[1] - camera[1]
                if not inside(views, uav, dx, dy) or _hidden(camera, point, blockers, offsets, index):
                    continue
                xx, xy, yy = ground_covariance(dx, dy, quality)
                determinant = (xx * yy - xy * xy) * count
                row = step * targets + t
                information[row, 0] += yy / determinant
                information[row, 1] -= xy / determinant
                information[row, 2] += xx / determinant
                seen[row] = True


@compiled
def _hidden(camera: Vector, point: Vector, blockers: Array, offsets: NDArray[np.int64], index: int) -> bool:
    for k in range(offsets[index], offsets[index + 1]):
        cylinder = blockers[k, 0], blockers[k, 1], blockers[k, 2], blockers[k, 3], blockers[k, 4]
        if blocked(camera, point, cylinder):
            return True
    return False


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
