"""Track initiation by existence probabilities, as in JIPDA."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tracking.association.jipda import existence_association
from tracking.association.jpda import gated_likelihood, mixture_update
from tracking.filter.kalman import Gaussian
from tracking.management.initiation import Initiator, Tentative, VisibleSamples, coasted, tentative_track
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.exponential import power
from tracking.parameters import TrackerParameters

_PATIENCE = 1.0  # s without a measurement after which a tentative track ends: later ones could be another person's


def initiator(p: TrackerParameters) -> Initiator | IntegratedInitiator:
    """The initiator that the parameter `life` names."""
    if p.life == "existence":
        return IntegratedInitiator(p)
    return Initiator(p.motion, p.confirm, p.measurement_gate, p.max_speed)


@dataclass(frozen=True)
class IntegratedInitiator:
    """Initiator that confirms a track when its existence probability reaches `sure`.

    A track starts with birth_density / (birth_density + clutter_density), as a measurement that no track explains is
    of a new person or clutter. It ends below `doubt` times this. Source: [Musicki04].
    """

    parameters: TrackerParameters

    def step(
        self, tentative: list[Tentative], z: Array, R: Array, *, elapsed: int, visible: VisibleSamples
    ) -> tuple[list[Tentative], list[Tentative]]:
        """Confirmed and remaining tentative tracks after a scan, `elapsed` steps of motion later.

        z (N, 2) m, R (N, 2, 2) m²; visible: flags of the samples of each belief in view.
        """
        p = self.parameters
        grown, known = self._updated([self._predicted(t, elapsed) for t in tentative], z, R, visible)
        start = p.birth_density / (p.birth_density + p.clutter_density)
        grown += [
            replace(tentative_track(z[j], R[j], p.max_speed), existence=start) for j in np.flatnonzero(~known).tolist()
        ]
        limit = 1 + round(_PATIENCE / p.motion.dt)
        confirmed = [t for t in grown if t.existence >= p.sure]
        return confirmed, [t for t in grown if p.doubt * start <= t.existence < p.sure and t.scans <= limit]

    def _predicted(self, track: Tentative, elapsed: int) -> Tentative:
        """The track at the time of the scan; `scans` counts from its last measurement, which is the first."""
        p = self.parameters
        return Tentative(
            coasted(p.motion, track.belief, elapsed),
            scans=track.scans + elapsed,
            existence=track.existence * power(p.step_survival, elapsed),
        )

    def _updated(
        self, tentative: list[Tentative], z: Array, R: Array, visible: VisibleSamples
    ) -> tuple[list[Tentative], Flags]:
        """Tentative tracks after a scan, and flags (N,) of the measurements that they explain."""
        p = self.parameters
        means = np.array([t.belief.mean for t in tentative]).reshape(-1, 4)
        covariances = np.array([t.belief.covariance for t in tentative]).reshape(-1, 4, 4)
        likelihood = gated_likelihood(means, covariances, z, R, p.gate_probability)
        detection = p.detection(visible(means, covariances).mean(axis=1), len(z))
        before = np.array([t.existence for t in tentative], dtype=float)
        beta, given, after = existence_association(likelihood, detection, p.clutter_density, before)
        updated = mixture_update((means, covariances), (means, covariances), z, R, given)
        rows = zip(tentative, *updated, beta[:, 0], after.tolist(), strict=True)
        grown = [
            Tentative(Gaussian(mean, covariance), scans=1 if missed < 0.5 else t.scans, existence=r)
            for t, mean, covariance, missed, r in rows
        ]
        return grown, np.asarray(np.any(p.detection_probability * likelihood > p.clutter_density, axis=0))
