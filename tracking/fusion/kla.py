"""Fusion by the weighted Kullback-Leibler average of beliefs."""

import numpy as np

from tracking.filter.information import information_form
from tracking.fusion.rule import Contribution, LocalBeliefs


class KullbackLeiblerAverage:
    """Average of information vectors and matrices, the rule of [Li22]. Source: [Battistelli14]."""

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """As `FusionRule.contribution`; nothing is added up."""
        q, omega = information_form(local.means, local.covariances)
        averaged = np.concatenate([q, omega.reshape(-1, 16)], axis=1)
        return Contribution(averaged, np.zeros((len(averaged), 0)), local.weights)
