"""Covariances stay symmetric and positive definite, whatever happens to tracks, in whatever order."""

import numpy as np
import pytest
from helpers.information import information_form, moment_form

from tracking.association.jpda import mixture_update
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.filter.negative_information import negative_information_update
from tracking.geometry.visibility import SAMPLES

MOTIONS = [NearlyConstantVelocity(0.2, sigma) for sigma in (0.0, 0.5, 5.0)]


def predicted(rng: np.random.Generator, P: np.ndarray) -> np.ndarray:
    return MOTIONS[rng.integers(3)].predict_all(np.zeros((len(P), 4)), P)[1]


def updated(rng: np.random.Generator, P: np.ndarray) -> np.ndarray:
    """Mixtures of four measurements, from coincident ones to ones 10 m apart, from fair to precise to nearly exact."""
    z = rng.normal(size=(4, 2)) * 10 ** rng.uniform(-12, 1)
    roots = rng.normal(size=(4, 2, 2)) * 10 ** rng.uniform(-4, 0, (4, 1, 1))
    R = roots @ np.swapaxes(roots, 1, 2) + 1e-8 * np.eye(2)
    beta = rng.dirichlet(np.full(5, 0.2), len(P)) * (rng.random((len(P), 5)) < 0.7) + [1e-12, 0, 0, 0, 0]
    here = np.zeros((len(P), 4)), P
    return mixture_update(here, here, z, R, beta / beta.sum(axis=1, keepdims=True))[1]


def seen_empty(rng: np.random.Generator, P: np.ndarray) -> np.ndarray:
    """Edges of a view across the beliefs, from one sample seen to all but one."""
    normals = rng.normal(size=(len(P), 2))
    seen = normals @ SAMPLES.T > rng.normal(size=(len(P), 1))
    return negative_information_update(np.zeros((len(P), 4)), P, (1 - 0.99 * seen) ** rng.choice([0.3, 1.0]))[1]


def averaged(rng: np.random.Generator, P: np.ndarray) -> np.ndarray:
    """Of the information of two tracks of a person, with weights that differ by up to 1e9, and back."""
    q, omega = information_form(np.zeros((len(P), 4)), P)
    weight = 10 ** rng.uniform(-9, 0, (len(P), 1, 1))
    other = omega[rng.permutation(len(P))]
    return moment_form(q, (omega + weight * other) / (1 + weight))[1]


EVENTS = (predicted, updated, seen_empty, averaged)


def check(P: np.ndarray) -> None:
    np.testing.assert_array_equal(P, np.swapaxes(P, 1, 2))
    assert np.isfinite(np.linalg.cholesky(P)).all()  # raises where a matrix is not positive definite


def start(rng: np.random.Generator, tracks: int) -> np.ndarray:
    roots = rng.normal(size=(tracks, 4, 4))
    return roots @ np.swapaxes(roots, 1, 2) + 0.01 * np.eye(4)


@pytest.mark.parametrize("tracks", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_covariances_survive_a_thousand_random_steps_of_many_tracks(tracks):
    """A thousand tracks make a million steps."""
    rng = np.random.default_rng(tracks)
    P = start(rng, tracks)
    for _ in range(1000):
        P = EVENTS[rng.integers(4)](rng, P)
        check(P)
