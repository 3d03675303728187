"""Reporting: the tracks that are given as estimates, by their probability of existence."""

from collections.abc import Iterable, Sequence

import numpy as np

from tracking.numerics.arrays import Array
from tracking.track import Track

# Probability of existence up to which a track is not reported. For its existence r, the square e of its error and the
# cut-off c, to report it costs GOSPA r e + (1 - r) c² / 2, to leave it out r c² / 2.
UNLIKELY = 0.5


def is_reported(track: Track) -> bool:
    """Test if the track's person more likely exists than not.

    Less likely tracks are hypotheses still: planners weigh them, and a measurement may confirm them.
    Source: [GarciaFernandez18], the first of its estimators, with the threshold that GOSPA implies for small errors.
    """
    return track.existence > UNLIKELY


def reported(tracks: Iterable[Track]) -> list[Track]:
    """The tracks that are reported, in their order."""
    return [track for track in tracks if is_reported(track)]


def positions_of(tracks: Sequence[Track]) -> Array:
    """Mean positions (T, 2) m of tracks."""
    return np.array([track.belief.mean[:2] for track in tracks]).reshape(-1, 2)
