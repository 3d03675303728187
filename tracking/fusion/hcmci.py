"""Novel information of a scan, apart from the prior: hybrid consensus on measurements and information (HCMCI)."""

import math

import numpy as np

from tracking.fusion.message import INFORMATION
from tracking.fusion.rule import Contribution, LocalBeliefs
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.factorisation import eigensystems, inverses
from tracking.numerics.matrices import products, symmetrise, transpose
from tracking.numerics.stacks import cholesky_factors, triangular_inverses

# Gains of information below this share of the prior's are rounding.
_ROUNDING = 1e-9


class HybridConsensus:
    """Fusion rule that adds the sum of all UAVs' novel information of this scan to the average of prior information.

    Source: [Battistelli15].
    Note: negative information is averaged, because UAVs with the same view have the same. An exception is its part in
    the posterior of a track with a measurement in its gate.
    The weights of prior beliefs fall with their uncertainty, as in [Niehsen02], so that UAVs that lost a person do not
    dilute the information of the others when partitions meet.
    """

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """As `FusionRule.contribution`."""
        return contribute(local, np.full(len(local.means), local.uav))


@compiled
def contribute(local: LocalBeliefs, owners: Indices) -> Contribution:
    """Contribution of several UAVs, of which `local.uav` has the largest number; owners (T,): the UAV of each track."""
    P, weights, seen = local.covariances, local.weights, local.detected
    means, covariances = local.prior
    omega = inverses(P)
    q = products(omega, local.means.reshape(-1, 4, 1))
    averaged, novel = np.empty((len(P), INFORMATION)), np.zeros((len(P), INFORMATION + local.uav + 1))
    shares = np.empty(len(P))
    for t in range(len(P)):
        shares[t] = weights[t] / (P[t, 0, 0] + P[t, 1, 1])
        for i in range(4):
            averaged[t, i] = q[t, i, 0]
            for j in range(4):
                averaged[t, 4 + 4 * i + j] = omega[t, i, j]
    if len(seen):
        reach = largest_innovation(means, covariances, local.measurements, local.gates)[seen]
        spreads = covariances[seen]
        kept, gained = split_information((means[seen], spreads), (q[seen], omega[seen]), reach)
        for k in range(len(seen)):  # loops, because assigning to arrays at indices takes 4 s to compile
            t = seen[k]
            shares[t] = weights[t] / (spreads[k, 0, 0] + spreads[k, 1, 1])
            for i in range(INFORMATION):
                averaged[t, i], novel[t, i] = kept[k, i], gained[k, i]
                if gained[k, i] != 0.0:
                    novel[t, INFORMATION + owners[t]] = 1.0
    return Contribution(averaged, novel, shares)


@compiled
def largest_innovation(means: Array, covariances: Array, z: Array, gates: Indices) -> Array:
    """Largest distance (T,), in prior standard deviations, from each belief to the measurements z (N, 2) m in its gate.

    means (T, 4), covariances (T, 4, 4), gates (G, 2): pairs of a track and a measurement in its gate.
    """
    most = np.zeros(len(means))
    for g in range(len(gates)):
        t, j = gates[g, 0], gates[g, 1]
        one = math.sqrt(covariances[t, 0, 0])  # Cholesky factor of the position block: one, 0; across, two
        across = covariances[t, 1, 0] / one
        two = math.sqrt(covariances[t, 1, 1] - across * across)
        x = (z[j, 0] - means[t, 0]) / one
        y = (z[j, 1] - means[t, 1] - across * x) / two
        most[t] = max(most[t], math.sqrt(x * x + y * y))
    return most


@compiled
def split_information(prior: tuple[Array, Array], posterior: tuple[Array, Array], reach: Array) -> tuple[Array, Array]:
    """Split posterior information into a prior and a novel part, which add up to it, each a packed (q, Ω) (T, 20).

    prior: means (T, 4) and covariances (T, 4, 4); posterior: information vectors (T, 4, 1) and matrices (T, 4, 4).
    With Ω⁻ = L Lᵀ and Ω⁺ = L diag(λ) Lᵀ the prior part is L diag(min(1, λ)) Lᵀ, the novel one L diag(max(λ - 1, 0)) Lᵀ.
    The novel part gets the shift of the mean, up to the shift by a measurement with this much information at the
    distance `reach` (T,), in prior standard deviations. The prior part gets the rest.
    Source: [Battistelli15]; there, measurements have an information matrix of their own.
    Note: the bound on the shift is ours. Ambiguity between measurements moves a mean without any gain of information,
    and the sum of such shifts over UAVs would be unbounded.
    """
    (means, covariances), (q, omega) = prior, posterior
    # With P⁻ = C Cᵀ and V the axes of Cᵀ Ω⁺ C, the inverse of L is Vᵀ Cᵀ.
    roots = cholesky_factors(covariances)
    upper = transpose(roots)
    inner = products(products(upper, omega), roots)
    symmetrise(inner)
    ratio, axes = eigensystems(inner)
    inverse = triangular_inverses(roots)
    L, turned = products(transpose(inverse), axes), transpose(axes)
    # Along these axes the prior has unit information: q = L y, where y is the information vector along them.
    before = products(turned, products(inverse, means.reshape(-1, 4, 1)))
    after = products(turned, products(upper, q.reshape(-1, 4, 1)))
    kept, gain, novel = np.empty_like(ratio), np.empty_like(ratio), np.empty_like(ratio)
    for t in range(len(ratio)):
        for i in range(4):
            g = ratio[t, i] - 1.0
            g = g if g >= _ROUNDING else 0.0
            most, shift = g * reach[t], after[t, i, 0] - ratio[t, i] * before[t, i, 0]
            gain[t, i], novel[t, i] = g, g * before[t, i, 0] + min(max(shift, -most), most)
            ratio[t, i], kept[t, i] = ratio[t, i] - g, after[t, i, 0] - novel[t, i]
    return _pack(L, kept, ratio), _pack(L, novel, gain)


@compiled
def _pack(L: Array, y: Array, weights: Array) -> Array:
    """Information (T, 20) with the vector L y and the matrix L diag(weights) Lᵀ."""
    out = np.zeros((len(L), INFORMATION))
    for t in range(len(L)):
        for i in range(4):
            for k in range(4):
                out[t, i] += L[t, i, k] * y[t, k]
            for j in range(4):
                one = other = 0.0
                for k in range(4):
                    one += L[t, i, k] * weights[t, k] * L[t, j, k]
                    other += L[t, j, k] * weights[t, k] * L[t, i, k]
                out[t, 4 + 4 * i + j] = 0.5 * (one + other)
    return out
