"""Fit of the constants of the camera's covariance to rendered people."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize

from helpers.rendered_people import ALTITUDES, LEVEL, TILTS, Sample, draw_pairs, draw_samples, draw_tilted_attitudes
from sim.scenario.environment import Area, Trees
from sim.world.forest import grow
from tracking.detection.blob_detector import locate_people
from tracking.detection.detection_errors import (
    LEAF,
    SPLIT,
    WHOLE,
    LeafError,
    SplitError,
    WholeError,
    pixel_footprints,
    sight_axes,
)
from tracking.detection.ground_measurement import detections_of, split_gaps
from tracking.detection.leaf_cover import are_behind_leaves, measure_parts
from tracking.detection.partial_visibility import PART_ERROR, PartError, Places, find_places
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array

_OTHERS = (12.0, 26.0, 34.0)  # m
_LEAVES = (0.1, 0.2, 0.4, 0.8, 1.5)  # m²/m³, leaf area densities


def fit_whole(seed: int, frames: int) -> WholeError:
    """Maximum-likelihood constants for people in plain view."""
    people: list[Sample] = []
    for k, (pixels, altitudes) in enumerate((p, a) for p in (96, 128, 192, 256) for a in (ALTITUDES, _OTHERS)):
        rng = np.random.default_rng([seed, 2, k])
        count = frames if (pixels, altitudes) == (128, ALTITUDES) else frames // 6
        people += draw_samples(rng, Forest(()), frames=count, pixels=pixels, altitudes=altitudes)
    tangent, footprints, errors = _find_sight_errors(people)
    gsd, (radial, tangential) = footprints[:, 0], errors.T  # level cameras have square pixels on the ground
    powers = tangent[:, None] ** np.arange(3)

    def surprise(x: Array) -> float:
        along, across = ((variances * powers).sum(axis=1) for variances in _make_whole_error(x).variances(gsd))
        slopes, curves = x[3::2], x[4::2]  # of factors that must stay positive at any angle
        positive = np.all(curves >= 0.0) and np.all((slopes >= 0.0) | (slopes**2 < 3.8 * curves))
        if not positive or min(along.min(), across.min()) <= 0.0:
            return math.inf
        return float(np.mean(np.log(along) + radial**2 / along + np.log(across) + tangential**2 / across))

    error = _make_whole_error(_minimise(surprise, np.hstack(WHOLE[:7]), 12000))
    along, across = ((variances * powers).sum(axis=1) for variances in error.variances(gsd))
    squares = radial**2 / along + tangential**2 / across
    return error._replace(excess=_fit_factors(_find_interpolation_weights(tangent, error.tangents), squares))


class _SightErrors(NamedTuple):
    """Errors of N detections along and across the line of sight."""

    tangents: Array  # (N,) of the angle off nadir
    footprints: Array  # (N, 2) m, of a pixel
    errors: Array  # (N, 2) m, along the axes from `sight_axes`


def _find_sight_errors(people: Sequence[Sample]) -> _SightErrors:
    """Errors of the people who are detected as whole."""
    rows = []
    for sample in people:
        if find_places(sample.frame, sample.blob, sample.forest) is None:
            lens = sample.frame.camera.lens(sample.frame.pose)
            ground = detections_of(sample.frame, [sample.blob]).ground
            axes, tangents = sight_axes(lens, ground)
            error_along = np.einsum("nij,ni->nj", axes, ground - sample.person)
            rows.append((tangents, pixel_footprints(lens, ground), error_along))
    return _SightErrors(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def fit_powers(error: WholeError, seed: int, frames: int) -> WholeError:
    """Constants that level images do not determine, from tilted images of people in plain view."""
    people: list[Sample] = []
    for k, (tilt, sway) in enumerate(TILTS):
        rng = np.random.default_rng([seed, 3, k])
        views = draw_tilted_attitudes(rng, tilt, frames, sway)
        people += draw_samples(rng, Forest(()), frames=frames, altitudes=ALTITUDES + _OTHERS, attitudes=views)
    tangents, pixels, errors = _find_sight_errors([sample for sample in people if len(sample.blobs) == 1])
    start = np.array([*WHOLE.powers, WHOLE.stretch])
    found = _minimise(
        lambda x: _compute_surprise(_replace_powers(error, x).detection_variances(tangents, pixels), errors),
        start,
        2000,
    )
    return _replace_powers(error, found)


def _replace_powers(error: WholeError, x: Array) -> WholeError:
    a, b, c, d, stretch = x.tolist()
    return error._replace(powers=(a, b, c, d), stretch=stretch)


def fit_split(seed: int, frames: int) -> SplitError:
    """Maximum-likelihood constants for people told apart; half of the cameras are level."""
    cases = []
    for k, (tilt, sway) in enumerate(((0.0, 0.0),) * len(TILTS) + TILTS):
        rng = np.random.default_rng([seed, 4, k])
        for pair in draw_pairs(rng, frames=frames, attitudes=draw_tilted_attitudes(rng, tilt, frames, sway)):
            found = locate_people(pair.frame, pair.blobs)
            lens = pair.frame.camera.lens(pair.frame.pose)
            axes, tangents = sight_axes(lens, found.ground)
            alone = np.einsum("nij,nik,nkj->nj", axes, found.covariances, axes)
            gaps = split_gaps(lens, found.pixels, pair.components)
            errors_along = np.einsum("nij,ni->nj", axes, found.ground - pair.people)
            cases.append((tangents, gaps, alone, errors_along, np.full(2, tilt == sway == 0.0)))
    tangents, gaps, alone, errors, level = (np.concatenate(column) for column in zip(*cases, strict=True))

    def added_by(x: Array) -> Array:
        return SplitError(*x.tolist()).variances(tangents, gaps)

    likeliest = _minimise(lambda x: _compute_surprise(alone + added_by(x), errors), np.array(SPLIT), 2000)
    added = added_by(likeliest)
    # A few errors are much larger, so that the likeliest constants underestimate the mean square of level cameras.
    base, more, squares = alone[level], added[level], errors[level] ** 2
    factor = brentq(lambda x: float(np.mean(squares / (base + x * more))) - 1.0, 0.1, 10.0)
    return SplitError(*(likeliest * [factor**0.5, factor**0.5, factor**0.5, 1.0]).tolist())


def _compute_surprise(variances: Array, errors: Array) -> float:
    """Twice the mean negative log-likelihood of Gaussian errors, without a constant."""
    return float(np.mean(np.log(variances) + errors**2 / variances))


def _make_whole_error(x: Array) -> WholeError:
    return WholeError(*x[:3].tolist(), *((a, b) for a, b in x[3:].reshape(-1, 2).tolist()))


def sample_forests(seed: int, frames: int, pixels: int = 128, attitudes: Sequence[Array] = (LEVEL,)) -> list[Sample]:
    """Rendered people with their true places, from `frames` frames over each of four random forests."""
    out: list[Sample] = []
    for k, (density, radius) in enumerate(((60.0, 1.5), (40.0, 2.5), (15.0, 5.0), (15.0, 5.0))):
        trees = Trees(density=density, canopy_radius=radius)
        forest = grow(trees, Area(80.0, 80.0), np.random.default_rng([seed, k]))
        rng = np.random.default_rng([seed, 1, k])
        out += draw_samples(rng, forest, frames=frames, pixels=pixels, attitudes=attitudes)
    return out


def sample_leafy(seed: int, frames: int) -> list[Sample]:
    """Samples of people behind leaves, from `frames` frames over each of ten forests."""
    out: list[Sample] = []
    for k, (density, radius) in enumerate(((30.0, 5.0), (120.0, 2.0)) * len(_LEAVES)):
        trees = Trees(density=density, canopy_radius=radius, leaf_area_density=_LEAVES[k // 2])
        forest = grow(trees, Area(80.0, 80.0), np.random.default_rng([seed, 7, k]))
        people = draw_samples(np.random.default_rng([seed, 8, k]), forest, frames=frames, leaves=seed)
        out += [s for s in people if are_behind_leaves(s.frame, s.person[None], forest)[0]]
    return out


def fit_leaves(seed: int, frames: int) -> LeafError:
    """Maximum-likelihood constants for people behind leaves."""
    rows = []
    for s in sample_leafy(seed, frames):
        found = detections_of(s.frame, [s.blob])
        axes = sight_axes(s.frame.camera.lens(s.frame.pose), found.ground)[0][0]
        whole = np.diag(axes.T @ found.covariances[0] @ axes)
        extents, lacking = measure_parts(s.frame, found, [s.blob])
        rows.append((*((found.ground[0] - s.person) @ axes), *whole, *extents[0], lacking[0]))
    errors, whole, extents, lacking = np.split(np.array(rows), [2, 4, 6], axis=1)

    def surprise(x: Array) -> float:
        added = _make_leaf_error(x).variances(extents, lacking[:, 0])
        return math.inf if np.min(x) < 0.0 else _compute_surprise(whole + added, errors)

    return _make_leaf_error(_minimise(surprise, np.hstack(LEAF[1:]), 4000))


def _make_leaf_error(x: Array) -> LeafError:
    radial, tangential = x.reshape(2, -1).tolist()
    return LEAF._replace(radial=tuple(radial), tangential=tuple(tangential))


def fit_part(seed: int, frames: int) -> PartError:
    """Maximum-likelihood constants for people seen in part, at four resolutions of equal weight."""
    people = [s for k in (256, 192, 128, 96) for s in sample_forests(seed + k, frames, k)]
    found = ((find_places(s.frame, s.blob, s.forest), s.person) for s in people)
    cases = [(places, person) for places, person in found if places is not None]

    def surprise(x: Array) -> float:
        return math.inf if np.min(x) < 0.0 else _fit_excess(x, cases[::5]).surprise

    start = np.array(PART_ERROR[:4])
    return _fit_excess(np.round(_minimise(surprise, start, 100), 3), cases).error


class _PartFit(NamedTuple):
    """Constants for people seen in part, and their negative log-likelihood."""

    error: PartError
    surprise: float


def _fit_excess(x: Array, cases: Sequence[tuple[Places, Array]]) -> _PartFit:
    """The constants with the likeliest factors of the covariance."""
    plain = ((1.0,) * len(PART_ERROR.hidden),) * len(PART_ERROR.pixel)
    error = PartError(*x.tolist())._replace(excess=plain)
    rows = []
    for places, person in cases:
        mean, covariance, share = places.posterior(error)
        rows.append((*(mean - person), *covariance.ravel(), share))
    u, v, uu, uv, _, vv, shares = np.array(rows).T
    volume = uu * vv - uv * uv
    squares = (vv * u * u - 2 * uv * u * v + uu * v * v) / volume
    pixel = _find_interpolation_weights([places.pixel for places, _ in cases], error.pixel)
    basis = (pixel[:, None] * _find_interpolation_weights(shares, error.hidden)).reshape(-1, len(cases))
    excess = _fit_factors(basis, squares)
    factor = np.array(excess) @ basis
    surprise = float(np.mean(squares / factor + np.log(volume) + 2 * np.log(factor)))
    table = tuple(tuple(row) for row in np.reshape(excess, (len(error.pixel), -1)).tolist())
    return _PartFit(error._replace(excess=table), surprise)


def _find_interpolation_weights(where: Array | Sequence[float], knots: Sequence[float]) -> Array:
    """Weights (K, N) of the knots at `where` (N,) in linear interpolation."""
    return np.array([np.interp(where, knots, unit) for unit in np.eye(len(knots))])


def _fit_factors(basis: Array, squares: Array) -> tuple[float, ...]:
    """The likeliest factors (K,) of covariances, where the square k (N,) has the covariance factors @ basis (K, N)."""
    excess = np.ones(len(basis))
    for _ in range(50):  # weighted least squares of squares / 2 on the factors
        weights = basis / (excess @ basis) ** 2
        excess = np.maximum(np.linalg.solve(weights @ basis.T, weights @ (squares / 2)), 0.1)
    return tuple(excess.tolist())


def _minimise(function: Callable[[Array], float], start: Array, calls: int) -> Array:
    found = minimize(function, start, method="Nelder-Mead", options={"maxfev": calls, "adaptive": True})
    return np.asarray(found.x)
