"""What a belief becomes when its person was not detected: a place seen empty is evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.compiled import Array
from tracking.kalman import symmetric
from tracking.visibility import SAMPLE_VARIANCE, SAMPLES


def given_undetected(
    predicted: tuple[Array, Array], seen: NDArray[np.bool_], detection_probability: float, weight: float
) -> tuple[Array, Array]:
    """Moments of beliefs after a scan without a detection: Bayes' rule with the likelihood (1 - P_D(position))^weight.

    predicted: means (T, 4) and covariances (T, 4, 4); seen (T, K): at which of the positions
    `tracking.visibility.SAMPLES` a person would have been detected with `detection_probability`.
    Somebody who is not where they would be seen is where they would not: the mass moves behind the tree, or out of the
    field of view, and with it, by correlation, the velocity. The result is the Gaussian of equal moments.
    A weight below 1 makes up for what that Gaussian loses: its tails reach into the place just seen empty, and the
    next scan would count the same absence again. Source: [Koch04], with samples where it uses mixtures.
    """
    means, covariances = predicted
    partly = np.asarray(seen.any(axis=1) & ~seen.all(axis=1))
    if not partly.any():
        return means, covariances
    weights = (1.0 - detection_probability * seen) ** weight
    weights /= weights.sum(axis=1, keepdims=True)
    shift = weights @ SAMPLES
    spread = np.einsum("tk,ki,kj->tij", weights, SAMPLES, SAMPLES) - shift[:, :, None] * shift[:, None, :]
    spread += SAMPLE_VARIANCE * np.eye(2)
    # State = mean + G u + what position says nothing of, with u the standardised position.
    roots = np.linalg.cholesky(covariances[:, :2, :2])
    G = np.swapaxes(np.linalg.solve(roots, covariances[:, :2, :]), 1, 2)
    moved = means + (G @ shift[..., None])[..., 0]
    shrunk = symmetric(covariances - G @ (np.eye(2) - spread) @ np.swapaxes(G, 1, 2))
    return np.where(partly[:, None], moved, means), np.where(partly[:, None, None], shrunk, covariances)
