"""Reporting: the tracks that are told as estimates, by their probability of existence."""

from collections.abc import Sequence

import numpy as np

from tracking.numerics.arrays import Array
from tracking.track import Track

# Probability of existence up to which a track is not reported. A track that is reported costs GOSPA (1 - r) c² / 2 and
# its error, one that is not r c² / 2, for its existence r and the cut-off c.
UNLIKELY = 0.5


def reported(tracks: Sequence[Track]) -> Array:
    """Positions (N, 2) m of the people that a tracker reports: those of tracks that rather exist than not.

    Less likely ones are hypotheses still: planners weigh them, and a measurement may confirm them.
    Source: [GarciaFernandez18], the first of its estimators, with the threshold that GOSPA implies.
    """
    return np.array([t.belief.mean[:2] for t in tracks if t.existence > UNLIKELY]).reshape(-1, 2)
