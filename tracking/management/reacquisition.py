"""Re-acquisition: lost people away from their tracks, and new tracks that continue lost ones."""

import math

import numpy as np

from tracking.numerics.arrays import Array, Indices
from tracking.numerics.assignment import most_pairs
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import gaussian_costs, length
from tracking.numerics.exponential import exp
from tracking.parameters import LossRule, TrackerParameters
from tracking.track import SIGHTED_AT

# m, largest sum of the errors of the last and the present measurement.
_MARGIN = 1.0
_TURN = 10.0  # s, mean time until people turn or change speed as no motion model predicts; 3 to 20 s work as well
# Standard deviation of people's velocities after a turn along each axis, as a share of their largest speed.
TURNED_SPEED = 0.5


def find_lost_tracks(sightings: Array, time: float, p: TrackerParameters) -> Indices:
    """Rows of the tracks that were last surely detected more than `reacquire_after` s before `time` s.

    sightings (T, 3): position [m] and time [s] of the last sure detection of each.
    """
    unseen = time - sightings[:, SIGHTED_AT]  # inf for tracks that were never detected surely
    return np.flatnonzero((unseen > p.loss.after) & (unseen < np.inf))


@compiled
def turned_density(
    sightings: Array, existence: Array, z: Array, R: Array, times: tuple[float, float], loss: LossRule
) -> Array:
    """Density (N,) 1/m² of lost people after a turn, at measurements.

    After a turn a person walks straight on from the last place, at velocities of `TURNED_SPEED`. `Escapes` has these
    people as planners need them: at up to 3 m/s, and where no frame has ruled them out.
    Source: [Williams15], recycling, here by the time since the last detection.
    Note: the track keeps its existence probability, and a person after a turn is taken to be detected for certain.

    sightings (T, 3) as in `find_lost_tracks`; existence (T,): probabilities; z (N, 2) m and R (N, 2, 2) m²:
    measurements and their covariances; times: of the scan before and of this one [s]; loss: `TrackerParameters.loss`.
    """
    density = np.zeros(len(z))
    for t in range(len(sightings)):
        if not loss.after < times[0] - sightings[t, SIGHTED_AT] < np.inf:
            continue
        unseen = times[1] - sightings[t, SIGHTED_AT]
        turned, reach = existence[t] * (1.0 - exp(-unseen / _TURN)), TURNED_SPEED * loss.max_speed * unseen
        for j in range(len(z)):
            x, y = z[j, 0] - sightings[t, 0], z[j, 1] - sightings[t, 1]
            xx, xy, yy = reach * reach + R[j, 0, 0], R[j, 0, 1], reach * reach + R[j, 1, 1]
            det = xx * yy - xy * xy
            d2 = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / det
            density[j] += turned * exp(-0.5 * d2) / (2.0 * math.pi * math.sqrt(det))
    return density


def farthest(unseen: Array, max_speed: float) -> Array:
    """Largest distances (...) [m] that people can move from their last detections in `unseen` (...) s."""
    return max_speed * unseen + _MARGIN


def match_lost_tracks(
    new: tuple[Array, Array], lost: tuple[Array, Array], seen: Array, *, now: float, max_speed: float
) -> list[tuple[int, int]]:
    """Pairs (n, l) of new tracks and the lost ones that they most probably continue.

    A lost person can have moved from the last sighting at no more than `max_speed`. Among the pairs within reach, one
    assignment finds the likeliest ones, even if they are unlikely, because beliefs predict no turns behind trees.
    new: means (N, 4) and covariances (N, 4, 4) of new tracks; lost: the same of L lost tracks; seen (L, 3): their
    sightings; now: time [s] of the beliefs; max_speed: largest speed of people [m/s].
    """
    cost = gaussian_costs(new[0][:, None, :2] - lost[0][:, :2], new[1][:, None, :2, :2] + lost[1][:, :2, :2])
    gaps = length(seen[None, :, :2] - new[0][:, None, :2])
    return most_pairs(gaps <= farthest(now - seen[:, 2], max_speed), cost)
