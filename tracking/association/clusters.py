"""Independent gating clusters of a scan, with which a scan's cost is linear, not quadratic, in the number of people."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tracking.numerics.arrays import Array, Indices

_TRACKS = 64  # number of tracks to collect in a cluster: for smaller clusters calls cost more than arithmetic
_ROOM = 1.001  # factor by which boxes exceed gates, for rounding


def gating_clusters(
    means: Array, covariances: Array, measurements: Array, noise: Array, gate: float
) -> list[tuple[Indices, Indices]]:
    """Indices of tracks and of measurements, ascending, of clusters that have no measurement in common.

    means (T, 4), covariances (T, 4, 4), measurements (N, 2) m, noise (N, 2, 2) m², N > 0; gate: largest squared
    Mahalanobis distance. Each track is in one cluster; a measurement near no track is in none. A cluster consists of
    whole connected components of the graph of boxes around gates.
    """
    count, order = len(means), np.argsort(measurements[:, 0])
    reach = _ROOM * np.sqrt(gate * (covariances[:, 0, 0] + noise[:, 0, 0].max()))
    firsts, ends = np.searchsorted(measurements[order, 0], means[:, 0] + np.array([-reach, reach]))
    i = np.repeat(np.arange(count), ends - firsts)
    j = np.concatenate([order[first:end] for first, end in zip(firsts, ends, strict=True)])
    near = np.square(measurements[j, 1] - means[i, 1]) <= _ROOM * gate * (covariances[i, 1, 1] + noise[j, 1, 1])
    edges, nodes = (i[near], count + j[near]), count + len(measurements)
    found = connected_components(coo_array((near[near], edges), (nodes, nodes)), directed=False)[1]
    component = np.unique(found, return_index=True)[1][found]  # named by its first node, not by the library's order
    sizes = np.bincount(component[:count], minlength=nodes)  # number of tracks in each component
    cluster = np.where(sizes > 0, (np.cumsum(sizes) - sizes) // _TRACKS, -1)[component]  # whole ones, one by one
    tracks, others = cluster[:count], cluster[count:]
    return [(np.flatnonzero(tracks == k), np.flatnonzero(others == k)) for k in np.unique(tracks).tolist()]
