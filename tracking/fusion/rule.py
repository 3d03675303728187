"""Fusion rules: the information of a UAV that consensus averages, and the information that it adds up."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from tracking.fusion.message import INFORMATION
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.factorisation import inverses
from tracking.numerics.matrices import apply
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.registry import Registry
from tracking.plugins.result_check import COVARIANCES, Form
from tracking.track import Beliefs

FUSION_RULES = Registry(
    "network.fusion",
    {"kla": "tracking.fusion.rule:KullbackLeiblerAverage", "hcmci": "tracking.fusion.hcmci:HybridConsensus"},
    ("contribution(local)",),
)

_LEAST, _LARGEST = 1e-100, 1e100  # bounds of weights, beyond which products leave the range of floats


class LocalBeliefs(NamedTuple):
    """Beliefs of one UAV after its scan, before fusion; the first K of its T tracks have a `prior` and `gates`.

    Attributes:
        uav: number of the UAV.
        means: (T, 4) m and m/s.
        covariances: (T, 4, 4).
        weights: (T,) above 0, in averages: probability of a detection, or a small value without one.
        prior: beliefs of the K tracks before the scan; later rows are new tracks.
        measurements: (N, 2) m.
        gates: (G, 2) pairs of a track and a measurement in its gate.
        detected: rows of the tracks that were detected.
    """

    uav: int
    means: Array
    covariances: Array
    weights: Array
    prior: Beliefs
    measurements: Array
    gates: Indices
    detected: Indices


class Contribution(NamedTuple):
    """Information that a UAV contributes to consensus, for each of its T tracks.

    Attributes:
        averaged: (T, 20) information vector and matrix.
        summed: (T, 0), or as `Message.novel`: information to add up, and in column 20 + u the share of UAV u in it.
        weights: (T,) of the average, all of them positive.
    """

    averaged: Array
    summed: Array
    weights: Array


class FusionRule(Protocol):
    """Rule of fusion, made without arguments; all UAVs of a fleet have the same rule.

    Example:
        ```python
        from understory import KullbackLeiblerAverage

        class EqualWeights(KullbackLeiblerAverage):
            def contribution(self, local):
                return super().contribution(local)._replace(weights=local.weights**0)
        ```
    """

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """Contribution of a UAV to the fleet's averages and sums; the fleet's belief is the average plus the sum."""


class KullbackLeiblerAverage:
    """Average of information vectors and matrices, the rule of [Li22]. Source: [Battistelli14]."""

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """As `FusionRule.contribution`; nothing is added up."""
        omega = inverses(np.ascontiguousarray(local.covariances))
        averaged = np.concatenate([apply(omega, local.means), omega.reshape(-1, 16)], axis=1)
        return Contribution(averaged, np.zeros((len(averaged), 0)), local.weights)


def make_fusion_rule(name: str) -> FusionRule:
    """The rule of that name or import string; InputError if there is none, or later if its results are unusable."""
    rule: FusionRule = FUSION_RULES.make(name)
    return rule if name in FUSION_RULES.built_in else _CheckedRule(name, rule)


def check_novel(name: str, given: Any, count: int) -> Array:  # noqa: ANN401 - not ours
    """Novel information from outside about `count` tracks, as `Message.novel`; `Unusable` for anything else."""
    width = np.shape(given)[-1:] or (0,)
    if 0 < width[0] <= INFORMATION:
        raise Unusable(f"{name} of {width[0]} columns; allowed are 0, or more than {INFORMATION}")
    found: Array = Form(width).check(name, given, count)
    return found


@dataclass(frozen=True)
class _CheckedRule:
    """A fusion rule from outside; InputError if it fails, or if its contribution is no information."""

    name: str
    rule: FusionRule

    def contribution(self, local: LocalBeliefs) -> Contribution:
        count = len(local.means)
        with FUSION_RULES.errors(self.name, "contribute", self.rule, "contribution"):
            averaged, summed, weights = self.rule.contribution(deepcopy(local))
            averaged = Form((INFORMATION,)).check("averaged", averaged, count)
            summed = check_novel("summed", summed, count)
            if 0 < summed.shape[1] <= INFORMATION + local.uav:
                raise Unusable(f"summed of {summed.shape[1]} columns lacks that of UAV {local.uav}")
            weights = Form().check("weights", weights, count)
            if not summed.shape[1]:  # other UAVs may add up
                summed = np.zeros((count, INFORMATION + local.uav + 1))
            information = averaged[:, 4:] + summed[:, 4:INFORMATION]  # only the sum has to be definite
            COVARIANCES.check("matrices of averaged, with summed,", information.reshape(-1, 4, 4), count)
            if count and not _LEAST <= weights.min() <= weights.max() <= _LARGEST:
                allowed = f"weights must be positive, from {_LEAST:g} to {_LARGEST:g}"
                raise Unusable(f"{allowed}; give little, as 1e-9, where a UAV saw nothing of a track")
            return Contribution(averaged, summed, weights)
