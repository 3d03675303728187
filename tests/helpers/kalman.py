"""The textbook's update of a Kalman filter, an oracle for what missions call."""

import numpy as np

from helpers.scenes import H
from tracking.filter.kalman import Gaussian


def update(predicted: Gaussian, z: np.ndarray, R: np.ndarray) -> Gaussian:
    """Update a belief with a ground measurement z (2,) m of covariance R (2, 2) m², in Joseph's form."""
    P = predicted.covariance
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    left = np.eye(4) - K @ H
    return Gaussian(predicted.mean + K @ (z - H @ predicted.mean), left @ P @ left.T + K @ R @ K.T)
