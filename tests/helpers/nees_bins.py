"""Mean NEES of the camera's covariance on rendered people, by angle, hidden share and mount."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from helpers.rendered_people import TILTS, Pair, Sample, draw_pairs, draw_samples, draw_tilted_attitudes
from tracking.detection.blob_detector import locate_people
from tracking.detection.partial_visibility import find_places
from tracking.geometry.visibility import Forest
from tracking.metrics.nees import nees_interval
from tracking.numerics.arrays import Array
from tracking.numerics.distances import squared_distance

OFF_NADIR = (0.0, 10.0, 20.0, 30.0, 40.0)  # deg
HIDDEN = (0.0, 0.001, 0.2, 0.4, 0.6, 0.8, 1.0)  # shares that trees and the image's edge hide


def compute_nees(population: Sequence[Sample]) -> Array:
    """NEES (N,) of the samples with the detector's covariances; two degrees of freedom."""
    found = [locate_people(s.frame, s.blobs, np.zeros(len(s.blobs), dtype=np.int64)) for s in population]
    errors = np.array([f.ground[0] - s.person for f, s in zip(found, population, strict=True)]).reshape(-1, 2)
    return squared_distance(errors, np.array([f.covariances[0] for f in found]).reshape(-1, 2, 2))


def _compute_nees_of_pairs(population: Sequence[Pair]) -> Array:
    """NEES (2 N,) of people in pairs told apart."""
    found = [locate_people(p.frame, p.blobs, p.components) for p in population]
    errors = np.concatenate([f.ground - p.people for f, p in zip(found, population, strict=True)])
    return squared_distance(errors, np.concatenate([f.covariances for f in found]))


@dataclass(frozen=True)
class Bin:
    """Mean NEES of the samples of a bin, and its 95 % interval for a consistent covariance."""

    name: str
    count: int
    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, name: str, values: Array) -> "Bin":
        """The bin of the NEES (N,) of samples."""
        return cls(name, len(values), float(values.mean()), *nees_interval(len(values), 2))

    @property
    def holds(self) -> bool:
        """True if the mean lies in its interval."""
        return self.low <= self.mean <= self.high


def bin_nees(population: Sequence[Sample]) -> list[Bin]:
    """Mean NEES by angle off nadir and by hidden share."""
    values = compute_nees(population)
    angles = np.degrees(np.arctan([sample.tangent for sample in population]))
    hidden = np.array([sample.hidden for sample in population])
    bins = [Bin.of(f"{a:.0f} to {b:.0f} deg", values[(angles >= a) & (angles < b)]) for a, b in pairwise(OFF_NADIR)]
    for a, b in pairwise(HIDDEN):
        name = "in plain view" if a == 0.0 else f"{a:.0%} to {b:.0%} hidden"
        bins.append(Bin.of(name, values[(hidden >= a) & (hidden < b)]))
    return [*bins, Bin.of("all", values)]


def bin_leaves(population: Sequence[Sample]) -> list[Bin]:
    """Mean NEES of people behind leaves, by the share of them that does not show."""
    values, hidden = compute_nees(population), np.array([sample.hidden for sample in population])
    bins = [
        Bin.of(f"behind leaves, {a:.0%} to {b:.0%} hidden", values[(hidden >= a) & (hidden < b)])
        for a, b in pairwise((0.0, *HIDDEN[2:]))
    ]
    return [*bins, Bin.of("behind leaves, all", values)]


def bin_tilts(seed: int, frames: int) -> list[Bin]:
    """Mean NEES of whole people in the open and within the image, by the camera's mount."""
    bins = []
    for tilt, sway in ((0.0, 0.0), *TILTS):
        rng = np.random.default_rng([seed, 5, int(tilt), int(sway)])
        views = draw_tilted_attitudes(rng, tilt, frames, sway)
        people = (s for s in draw_samples(rng, Forest(()), frames=frames, attitudes=views) if s.hidden == 0.0)
        whole = [s for s in people if find_places(s.frame, s.blob, s.forest) is None]
        mount = f"tilt {tilt:.0f} deg" + (f", body sways {sway:.0f}" if sway else "")
        bins.append(Bin.of(f"whole, {mount}", compute_nees(whole)))
    return bins


def bin_pairs(seed: int, frames: int) -> list[Bin]:
    """Mean NEES of people told apart, for level cameras and for all tilted ones."""
    bins = []
    for name, mounts in (("level", ((0.0, 0.0),)), ("tilted", TILTS)):
        population: list[Pair] = []
        for tilt, sway in mounts:
            rng = np.random.default_rng([seed, 6, int(tilt), int(sway)])
            count = frames // len(mounts)
            population += draw_pairs(rng, frames=count, attitudes=draw_tilted_attitudes(rng, tilt, count, sway))
        bins.append(Bin.of(f"told apart, {name}", _compute_nees_of_pairs(population)))
    return bins
