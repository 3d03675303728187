"""Fusion by the weighted Kullback-Leibler average of beliefs."""

import numpy as np

from tracking.fusion.rule import Contribution, LocalBeliefs
from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import apply


class KullbackLeiblerAverage:
    """Average of information vectors and matrices, the rule of [Li22]. Source: [Battistelli14]."""

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """As `FusionRule.contribution`; nothing is added up."""
        omega = inverses(np.ascontiguousarray(local.covariances))
        averaged = np.concatenate([apply(omega, local.means), omega.reshape(-1, 16)], axis=1)
        return Contribution(averaged, np.zeros((len(averaged), 0)), local.weights)
