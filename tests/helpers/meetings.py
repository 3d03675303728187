"""Messages of partitions of a fleet that meet."""

import numpy as np

from helpers.graphs import message

NOW = 7.0  # s


def told(uav: int, places, variances, ids, seen, **others):
    """Message of a UAV, two of which are a partition, on tracks in a row, standing still, last seen at these times."""
    means = [(x, 0.0, 0.0, 0.0) for x in places]
    covariances = [v * np.diag([1.0, 1.0, 4.0, 4.0]) for v in variances]
    others = {"partition": (uav // 2 * 2, NOW), "time": NOW, **others}
    return message(uav, ids, means, covariances, degree=0, seen=seen, **others)
