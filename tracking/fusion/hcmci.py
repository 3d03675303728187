"""Novel information of a scan, apart from the prior: hybrid consensus on measurements and information (HCMCI)."""

import numpy as np

from tracking.fusion.message import INFORMATION
from tracking.fusion.rule import Contribution, LocalBeliefs
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import squared_distances
from tracking.numerics.factorisation import eigensystems, inverses
from tracking.numerics.matrices import products
from tracking.numerics.stacks import cholesky_factors, forward_solutions

# Gains of information below this share of the prior's are rounding.
_ROUNDING = 1e-9


class HybridConsensus:
    """Sums of what each UAV has learned in this scan, added to the average of what was known before.

    Source: [Battistelli15].
    Note: negative information is not added up, as that of UAVs with the same view is the same.
    The weights of prior beliefs fall with their uncertainty, as in [Niehsen02]: where partitions meet, UAVs that
    lost a person do not dilute the information of the others.
    """

    def contribution(self, local: LocalBeliefs) -> Contribution:
        """As `FusionRule.contribution`."""
        beliefs = np.ascontiguousarray(local.means), np.ascontiguousarray(local.covariances), local.weights
        return Contribution(*_parts(local.uav, beliefs, local.prior, (local.measurements, local.gates), local.detected))


@compiled
def _parts(
    uav: int,
    beliefs: tuple[Array, Array, Array],
    prior: tuple[Array, Array],
    measured: tuple[Array, Indices],
    seen: Indices,
) -> tuple[Array, Array, Array]:
    """Information (T, 20) to average, novel information (T, 20 + uav + 1), and weights (T,) of the average."""
    means, covariances, weights = beliefs
    omega = inverses(covariances)
    q = products(omega, means.reshape(-1, 4, 1))[:, :, 0].copy()
    averaged, novel = np.empty((len(means), INFORMATION)), np.zeros((len(means), INFORMATION + uav + 1))
    averaged[:, :4], averaged[:, 4:] = q, omega.reshape(-1, 16)
    spread = covariances[:, 0, 0] + covariances[:, 1, 1]
    if len(seen):
        reach = largest_innovation(*prior, *measured)[seen]
        before, spreads = prior[0][seen], prior[1][seen]
        held, gained = split_information((before, spreads), (q[seen], omega[seen]), reach)
        for k in range(len(seen)):
            t = seen[k]
            spread[t] = spreads[k, 0, 0] + spreads[k, 1, 1]
            averaged[t], novel[t, :INFORMATION] = held[k], gained[k]
            novel[t, -1] = 1.0 if np.any(gained[k] != 0.0) else 0.0
    return averaged, novel, weights / spread


@compiled
def largest_innovation(means: Array, covariances: Array, z: Array, gates: Indices) -> Array:
    """Largest distance in prior standard deviations of the measurements z (N, 2) m in the gates of beliefs (T,).

    means (T, 4), covariances (T, 4, 4), gates (G, 2): pairs of a track and a measurement in its gate.
    """
    nu, spreads = np.empty((len(gates), 2)), np.empty((len(gates), 2, 2))
    for g in range(len(gates)):
        t = gates[g, 0]
        nu[g], spreads[g] = z[gates[g, 1]] - means[t, :2], covariances[t, :2, :2]
    squared, most = squared_distances(nu, spreads), np.zeros(len(means))
    for g in range(len(gates)):
        most[gates[g, 0]] = max(most[gates[g, 0]], squared[g])
    return np.sqrt(most)


@compiled
def split_information(prior: tuple[Array, Array], posterior: tuple[Array, Array], reach: Array) -> tuple[Array, Array]:
    """Split posterior information into a prior and a novel part, as packed (q, Ω) (T, 20) each.

    prior: means (T, 4) and covariances (T, 4, 4); posterior: information vectors (T, 4) and matrices (T, 4, 4). The
    two parts add up to the posterior.
    With Ω⁻ = L Lᵀ and Ω⁺ = L diag(λ) Lᵀ the prior part is L diag(min(1, λ)) Lᵀ, the novel one L diag(max(λ - 1, 0)) Lᵀ.
    Neither is ever indefinite, though association may leave a posterior wider than the prior along some axis.
    The novel part takes the shift of the mean up to that of a measurement with this much information at the distance
    `reach` (T,), in prior standard deviations. The prior part takes the rest.

    Source: [Battistelli15], whose measurements have an information matrix of their own.
    Note: the bound on the shift is ours. The novel parts of UAVs are summed. Where doubt between measurements moves a
    mean without any gain of information, the sum of such shifts would be unbounded.
    """
    (means, covariances), (q, omega) = prior, posterior
    # With P⁻ = C Cᵀ and V the axes of Cᵀ Ω⁺ C, the inverse of L is Vᵀ Cᵀ.
    roots = cholesky_factors(covariances)
    upper = _transposed(roots)
    inner = products(products(upper, omega), roots)
    ratio, axes = eigensystems(0.5 * (inner + _transposed(inner)))
    inverse = forward_solutions(roots, np.zeros_like(covariances) + np.eye(4))
    back = _transposed(axes)
    L = products(_transposed(inverse), axes)
    # Along these axes the prior has unit information: q = L y with y the information vector there.
    before = products(back, products(inverse, means.reshape(-1, 4, 1)))[:, :, 0]
    after = products(back, products(upper, q.reshape(-1, 4, 1)))[:, :, 0]
    gain, novel = np.empty_like(ratio), np.empty_like(ratio)
    for t in range(len(ratio)):
        for i in range(4):
            g = ratio[t, i] - 1.0
            g = g if g >= _ROUNDING else 0.0
            most, shift = g * reach[t], after[t, i] - ratio[t, i] * before[t, i]
            gain[t, i], novel[t, i] = g, g * before[t, i] + min(max(shift, -most), most)
    return _packed(L, after - novel, ratio - gain), _packed(L, novel, gain)


@compiled
def _packed(L: Array, y: Array, weights: Array) -> Array:
    """Information (T, 20) with the vector L y and the matrix L diag(weights) Lᵀ."""
    out = np.empty((len(L), 20))
    out[:, :4] = products(L, y.reshape(-1, 4, 1))[:, :, 0]
    scaled = L.copy()
    for t in range(len(L)):
        scaled[t] *= weights[t]
    square = products(scaled, _transposed(L))
    out[:, 4:] = (0.5 * (square + _transposed(square))).reshape(-1, 16)
    return out


@compiled
def _transposed(matrices: Array) -> Array:
    return np.ascontiguousarray(matrices.transpose(0, 2, 1))
