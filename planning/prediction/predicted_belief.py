"""Belief predicted over a horizon: positions of targets, their visibility and the transition of P."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planning.planner import Situation, Vehicle
from planning.prediction.field_of_view import view_quadrangle, viewing_range
from planning.prediction.quadrangle import inside
from tracking.filter.kalman import Transition
from tracking.geometry.leaf_gaps import lower_detectabilities
from tracking.geometry.line_of_sight import Raster, Vector
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, inlined
from tracking.numerics.exponential import replace_by_logs

LANES = 64  # cameras or covariances that compiled code works on side by side, with the processor's vector instructions


class PredictedBelief(NamedTuple):
    """Belief on T targets, predicted over H steps, and the n UAVs with their sensors.

    It is a tuple of arrays, because compiled code takes no classes.
    """

    step: float  # s
    transition: Transition  # of velocities over one step, see `NearlyConstantVelocity.transition`
    noise: Array  # (3,): process noise of one step on position, position-velocity and velocity
    points: Array  # (H, T, K, 3) m: K equally probable trajectories of each target at its height; the first is the mean
    covariances: Array  # (T, 4, 4): P now
    positions: Array  # (n, 3) m: UAVs now
    views: Array  # (n, 5, 3): fields of view at the target's height, see `field_of_view.view_quadrangle`
    quality: Array  # (n, 7): coefficients of each UAV's noise model
    blockers: Array  # (B, 6 or 7): cylinders near each of the points, one after another
    offsets: Indices  # (H T K + 1,): index of each point's first cylinder
    weights: Array  # (T,): weight of each target in the objective
    unknown: Raster  # number per m² of unknown trees around each place, see `Forest.unknown`


def predict_belief(situation: Situation, points: Array, covariances: Array) -> PredictedBelief:
    """Predicted belief of targets at `points` (H, T, K, 3) m with covariances (T, 4, 4) now.

    Each target has weight one.
    """
    vehicles, motion = situation.vehicles, situation.motion
    blockers, offsets = _find_hiding_cylinders(situation.forest, points, vehicles, motion.dt * len(points))
    return PredictedBelief(
        step=motion.dt,
        transition=motion.transition,
        noise=np.array([motion.Q[0, 0], motion.Q[0, 2], motion.Q[2, 2]]),
        points=points,
        covariances=covariances,
        positions=np.array([v.position for v in vehicles], dtype=float),
        views=np.array([view_quadrangle(v) for v in vehicles]),
        quality=np.array([v.noise.coefficients for v in vehicles]),
        blockers=blockers,
        offsets=offsets,
        weights=np.ones(len(covariances)),
        unknown=situation.forest.unknown_around,
    )


def _find_hiding_cylinders(
    forest: Forest, points: Array, vehicles: Sequence[Vehicle], duration: float
) -> tuple[Array, Indices]:
    """Cylinders that can hide each point (..., 3) m from a UAV that has it in view within `duration` s.

    A few metres from the target a line of sight is above the trees, so each point has few such cylinders.
    """
    sights = np.array([(*v.position, viewing_range(v), v.max_speed * duration) for v in vehicles])
    points, order = points.reshape(-1, 3), forest.from_west
    reach = forest.reach + _compute_reach(forest.blockers, points, sights.reshape(-1, 5))
    columns, offsets = _find_cylinders_within(points, forest.blockers, reach, order)
    return forest.blockers[columns], offsets


@compiled
def _compute_reach(cylinders: Array, points: Array, sights: Array) -> Array:
    """Largest distance (B,) m from a cylinder's side at which it hides any of N points from any of n UAVs.

    sights (n, 5): position, viewing range and distance flown [m].
    """
    reach = np.zeros(len(cylinders))
    for v in range(len(sights)):
        far = 0.0
        for n in range(len(points)):
            x, y = points[n, 0] - sights[v, 0], points[n, 1] - sights[v, 1]
            far = max(far, x * x + y * y)
        far = min(sights[v, 3], math.sqrt(far) + sights[v, 4])
        for b in range(len(cylinders)):
            share = (cylinders[b, 4] - TARGET_HEIGHT) / (sights[v, 2] - TARGET_HEIGHT)
            reach[b] = max(reach[b], min(max(share, 0.0), 1.0) * far)
    return reach


@compiled
def _find_cylinders_within(points: Array, cylinders: Array, reach: Array, order: Indices) -> tuple[Indices, Indices]:
    """Indices of the cylinders (B, 6 or 7) within `reach` (B,) m of the points (N, 3) m, and where each point's begin.

    order (B,): the cylinders from west to east.
    """
    columns, offsets = [0], np.zeros(len(points) + 1, np.int64)  # the first entry only tells Numba the list's type
    east, widest = cylinders[order, 0], reach.max() if len(reach) else 0.0
    for n in range(len(points)):
        for m in range(np.searchsorted(east, points[n, 0] - widest), len(order)):
            b = order[m]
            x, y = points[n, 0] - cylinders[b, 0], points[n, 1] - cylinders[b, 1]
            if x < -widest:
                break
            if x * x + y * y <= reach[b] * reach[b]:
                columns.append(b)
        offsets[n + 1] = len(columns) - 1
    return np.array(columns)[1:], offsets


@compiled
def possibly_visible(belief: PredictedBelief, uavs: Indices, boxes: Array, targets: Flags) -> Flags:
    """Mask (H T K,) of points of marked `targets` (T,) that any of k UAVs may see from somewhere in its boxes.

    boxes (k, H, 4) m: x0, x1, y0, y1. False is certain; True is only possible, because the bound is a cheap one.
    """
    points, views = belief.points, belief.views
    steps, count = points.shape[0], points.shape[2]
    may = np.zeros(steps * points.shape[1] * count, dtype=np.bool_)
    for j in range(len(uavs)):
        for step in range(steps):
            x0, x1, y0, y1 = boxes[j, step]
            wide = views[uavs[j]].copy()
            for side in range(4):
                a, b = wide[side, 0], wide[side, 1]
                wide[side, 2] = wide[side, 2] + max(a * x0, a * x1) + max(b * y0, b * y1)
            for t in range(len(targets)):
                for k in range(count if targets[t] else 0):
                    row = (step * points.shape[1] + t) * count + k
                    may[row] |= inside(wide, points[step, t, k, 0], points[step, t, k, 1])
    return may


@inlined
def add_information(
    belief: PredictedBelief, uav: int, cameras: Array, row: int, information: Array, free: Array
) -> bool:
    """Add the R⁻¹ of a point to the information in lanes where cameras see it; True if any camera sees it.

    Under porous trees it is weighted with the probability of detection. The trace after this expected information is
    a lower bound of the expected trace (Jensen's inequality).
    uav: its row; cameras (2, LANES) m: places of its camera; row: index of the (step, target, trajectory) triple;
    information (3 LANES,): xx, xy, yy; free (LANES,): a workspace.
    """
    points, quality, offsets = belief.points, belief.quality[uav], belief.offsets
    targets, count, height = points.shape[1], points.shape[2], belief.positions[uav, 2]
    c0, c1, c2, c3, c4, c5 = quality[0], quality[1], quality[2], quality[3], quality[4], quality[5]
    east, north, least = cameras[0], cameras[1], quality[6]
    p = points[row // (targets * count), row // count % targets, row % count]
    x, y = p[0], p[1]
    blockers = belief.blockers[offsets[row] : offsets[row + 1]]
    if not _find_visible_shares((x, y, p[2]), height, cameras, belief.views[uav], blockers, belief.unknown, free):
        return False
    for lane in range(LANES):
        # R⁻¹ of `NoiseModel.covariance` in closed form, with the eigenvalues of R along and across the line of sight.
        dx, dy = x - east[lane], y - north[lane]
        square = dx * dx + dy * dy
        r = max(math.sqrt(square), least)
        dx, square = (dx, square) if square > 0.0 else (1.0, 1.0)
        along, across = c0 + r * (c1 + r * c2), c3 + r * (c4 + r * c5)
        share = free[lane] / (along * across * square)
        information[lane] += (across * dx * dx + along * dy * dy) * share
        information[LANES + lane] += (across - along) * dx * dy * share
        information[2 * LANES + lane] += (along * dx * dx + across * dy * dy) * share
    return True


@inlined
def _find_visible_shares(
    point: Vector, height: float, cameras: Array, view: Array, blockers: Array, unknown: Raster, free: Array
) -> bool:
    """Set `free` (LANES,) to the detectability of a point for cameras (2, LANES) m at a height; True if any sees it.

    view (5, 3): field of view of the cameras, with a pixel's edge; blockers (B, 6 or 7): cylinders that may hide the
    point.
    """
    east, north, some = cameras[0], cameras[1], 0
    for lane in range(LANES):
        near = inside(view, point[0] - east[lane], point[1] - north[lane])
        free[lane] = 1.0 if near else 0.0
        some += near
    return some > 0 and some > lower_detectabilities(free, cameras, height, point, view[4, 2], blockers, unknown)


@inlined
def advance_belief(P: Array, transition: Transition, noise: Array, information: Array) -> None:
    """Belief-state transition of P in each lane, in place: predict one step, then update with the fused information.

    P (10 LANES,) holds the upper triangle of the covariance, all lanes of one element after another: xx, xy, xu, xv,
    yy, yu, yv, uu, uv, vv with the velocity (u, v); information J (3 LANES,): xx, xy, yy. Without information P is only
    predicted.
    Source: [Li22] eq. (1), and the covariance part of the Kalman update.
    """
    drift, both, wander, (way, left) = noise[0], noise[1], noise[2], transition
    for k in range(LANES):
        xx, xy, xu, xv, yy = P[k], P[LANES + k], P[2 * LANES + k], P[3 * LANES + k], P[4 * LANES + k]
        yu, yv, uu = P[5 * LANES + k], P[6 * LANES + k], P[7 * LANES + k]
        uv, vv = P[8 * LANES + k], P[9 * LANES + k]
        xx += way * (2 * xu + way * uu) + drift
        yy += way * (2 * yv + way * vv) + drift
        xy += way * (xv + yu + way * uv)
        xu, xv = left * (xu + way * uu) + both, left * (xv + way * uv)
        yu, yv = left * (yu + way * uv), left * (yv + way * vv) + both
        uu, uv, vv = left * left * uu + wander, left * left * uv, left * left * vv + wander
        # S⁻¹ = (I + J P_pp)⁻¹ J, which needs no inverse of J and is 0 without information.
        jxx, jxy, jyy = information[k], information[LANES + k], information[2 * LANES + k]
        a, b = 1.0 + jxx * xx + jxy * xy, jxx * xy + jxy * yy
        c, d = jxy * xx + jyy * xy, 1.0 + jxy * xy + jyy * yy
        one = 1.0 / (a * d - b * c)
        sxx, sxy, syy = (d * jxx - b * jxy) * one, (d * jxy - b * jyy) * one, (a * jyy - c * jxy) * one
        gx0, gx1, gy0, gy1 = xx * sxx + xy * sxy, xx * sxy + xy * syy, xy * sxx + yy * sxy, xy * sxy + yy * syy
        gu0, gu1, gv0, gv1 = xu * sxx + yu * sxy, xu * sxy + yu * syy, xv * sxx + yv * sxy, xv * sxy + yv * syy
        P[k], P[LANES + k] = xx - gx0 * xx - gx1 * xy, xy - gx0 * xy - gx1 * yy
        P[2 * LANES + k], P[3 * LANES + k] = xu - gx0 * xu - gx1 * yu, xv - gx0 * xv - gx1 * yv
        P[4 * LANES + k] = yy - gy0 * xy - gy1 * yy
        P[5 * LANES + k], P[6 * LANES + k] = yu - gy0 * xu - gy1 * yu, yv - gy0 * xv - gy1 * yv
        P[7 * LANES + k], P[8 * LANES + k] = uu - gu0 * xu - gu1 * yu, uv - gu0 * xv - gu1 * yv
        P[9 * LANES + k] = vv - gv0 * xv - gv1 * yv


@compiled
def advance_with_gains(P: Array, transition: Transition, noise: Array, information: Array, costs: Array) -> None:
    """Apply `advance_belief` to P, and set costs to minus the information gained.

    The gain is the mutual information [nats] between a state one step later and its measurements, ½ log det(I + J P_pp)
    with the predicted position block and the measurements' information J. By the chain rule, the sum over steps is
    the mutual information between the path and all measurements. This sum is monotone and submodular in the
    measurements, because they are independent given the path [Krause05].
    P (10 LANES,), noise (3,) and information (3 LANES,) are those of `advance_belief`; costs (LANES,) are overwritten.
    """
    way, _ = transition
    for k in range(LANES):
        # Summed in another order than in `advance_belief`, by which recorded flights were planned.
        xx = P[k] + way * (2 * P[2 * LANES + k] + way * P[7 * LANES + k]) + noise[0]
        yy = P[4 * LANES + k] + way * (2 * P[6 * LANES + k] + way * P[9 * LANES + k]) + noise[0]
        xy = P[LANES + k] + way * (P[3 * LANES + k] + P[5 * LANES + k] + way * P[8 * LANES + k])
        jxx, jxy, jyy = information[k], information[LANES + k], information[2 * LANES + k]
        a, b = 1.0 + jxx * xx + jxy * xy, jxx * xy + jxy * yy
        c, d = jxy * xx + jyy * xy, 1.0 + jxy * xy + jyy * yy
        costs[k] = a * d - b * c
    replace_by_logs(costs)
    for k in range(LANES):
        costs[k] *= -0.5
    advance_belief(P, transition, noise, information)
