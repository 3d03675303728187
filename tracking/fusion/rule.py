"""Fusion rules: the information of a UAV that consensus averages, and what it adds up."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.importing import imported
from tracking.plugins.spelling import did_you_mean

if TYPE_CHECKING:  # checking a name needs no arithmetic
    from tracking.numerics.arrays import Array, Indices

FUSION_RULES = {
    "kla": "tracking.fusion.kla:KullbackLeiblerAverage",
    "hcmci": "tracking.fusion.hcmci:HybridConsensus",
}


class LocalBeliefs(NamedTuple):
    """Beliefs of one UAV after its scan, before fusion; `prior` and `gates` count rows from the same first track."""

    uav: int
    means: Array  # (T, 4)
    covariances: Array  # (T, 4, 4)
    weights: Array  # (T,) in an average: the probability of a detection, or little where there was none
    prior: tuple[Array, Array]  # means (K, 4) and covariances (K, 4, 4) before the scan; later rows are new tracks
    measurements: Array  # (N, 2) m
    gates: Indices  # (G, 2) pairs of a track and a measurement in its gate
    detected: Indices  # rows of the tracks that were detected


class Contribution(NamedTuple):
    """Part of a UAV in consensus, for each of its T tracks."""

    averaged: Array  # (T, 20) information vector and matrix
    summed: Array  # (T, 0), or as `Message.novel`
    weights: Array  # (T,) of the average


class FusionRule(Protocol):
    """A rule is made without arguments; all UAVs of a fleet have the same."""

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """Part of a UAV in the averages and sums that consensus forms; the fleet's belief is average plus sum."""
        ...


def check_fusion_rule(name: str, field: str = "fusion") -> None:
    """ValueError unless a rule is built in or may be an import string, "package.module:Class"."""
    if name not in FUSION_RULES and ":" not in name:
        raise ValueError(f"{field}: {name!r} is unknown; {did_you_mean(name, FUSION_RULES)} (or package.module:Class)")


def fusion_rule(name: str) -> FusionRule:
    """The rule of that name or import string; ValueError says what is wrong."""
    check_fusion_rule(name)
    try:
        make = imported(FUSION_RULES.get(name, name))
        with contained():
            rule = make()
            usable = callable(getattr(rule, "contribution", None))
    except ImportError as error:
        raise ValueError(f"network.fusion: {name!r} cannot be imported: {error}") from error
    except ForeignError as error:
        raise ValueError(f"network.fusion: {name!r} cannot be made: {error.explained}") from error
    if not usable:
        raise ValueError(f"network.fusion: {name!r} has no method contribution(local)")
    return rule  # type: ignore[no-any-return]
