"""Messages of parts of a fleet that meet."""

from dataclasses import replace

import numpy as np

from helpers.graphs import message
from tracking.management.deletion import DetectionHistory

NOW = 7.0  # s


def told(uav: int, places, variances, ids, aliases, seen):
    """Message of a UAV on tracks in a row, standing still, last seen at these times."""
    means = [(x, 0.0, 0.0, 0.0) for x in places]
    covariances = [v * np.diag([1.0, 1.0, 4.0, 4.0]) for v in variances]
    said = message(uav, ids, means, covariances, degree=0, aliases=np.array(aliases), partition=(uav // 2 * 2, NOW))
    return replace(
        said, history=DetectionHistory(np.repeat(np.array(seen)[:, None], 3, axis=1), *np.zeros((2, len(ids)), int))
    )
