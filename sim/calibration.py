"""Fits the constants of the camera's covariance to rendered people, and checks it: `python -m sim.calibration`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize
from scipy.stats import chi2

from sim.forest import grow
from sim.renderer import Renderer
from sim.scenario import DEFAULT_FLEET, Area, Scenario, Trees, Uav
from sim.world import World
from tracking.blob_detector import located
from tracking.camera import Camera, Pose
from tracking.compiled import Array
from tracking.detector import Frame, blobs_of, measured
from tracking.noise import WHOLE, WholeError
from tracking.partial import PART, PartError, Places, places_of
from tracking.visibility import TARGET_HEIGHT, Forest

ALTITUDES = tuple(uav.altitude for uav in DEFAULT_FLEET)
OFF_NADIR = (0.0, 10.0, 20.0, 30.0, 40.0)  # deg
HIDDEN = (0.0, 0.001, 0.2, 0.4, 0.6, 0.8, 1.0)  # by trees and the image's edge
_OTHERS = (12.0, 26.0, 34.0)  # m
_PEOPLE = 8
_GAP = 2.4  # m between people
_MARGIN = 0.5  # m beyond the image where people may stand
_PLAIN = 0.15  # of the people in plain view are kept: the others tell more
# Points of a body, to find people whom something hides in part.
_BODY = np.array(
    [
        (0.2 * math.cos(a), 0.2 * math.sin(a), h)
        for h in (0.1, 0.5, 0.9, 1.3, 1.6)
        for a in np.linspace(0.0, 2 * math.pi, 8, endpoint=False)
    ]
)


@dataclass(frozen=True, eq=False)
class Sample:
    """One detected person: what the camera saw of them, and the truth."""

    frame: Frame
    forest: Forest
    blob: Array  # (K, 2) pixels
    person: Array  # (2,) m
    hidden: float  # share of the silhouette that trees or the image's edge hide

    @property
    def tangent(self) -> float:
        """Tangent of the angle off nadir."""
        offset = self.person - self.frame.pose.position[:2]
        return float(np.linalg.norm(offset)) / (float(self.frame.pose.position[2]) - TARGET_HEIGHT)


def samples(
    rng: np.random.Generator, forest: Forest, *, frames: int, pixels: int = 128, altitudes: Sequence[float] = ALTITUDES
) -> Iterator[Sample]:
    """People detected in random level frames over one forest, as often near nadir as far from it."""
    scenario = Scenario(uavs=(Uav(start=(74.0, 49.0)),))
    camera = Camera(math.radians(60), pixels)
    margin = pixels // 8
    wide = Camera(2 * math.atan((pixels / 2 + margin) / camera.focal), pixels + 2 * margin)
    with World(scenario, forest, _PEOPLE) as world, World(scenario, Forest(()), _PEOPLE) as bare:
        full, alone = Renderer(world), Renderer(bare)
        for k in range(frames):
            x, y = rng.uniform(-30.0, 30.0, 2).tolist()
            pose = Pose.level(x, y, altitudes[k % len(altitudes)])
            people = _people(rng, camera, pose, forest)
            headings = rng.uniform(-math.pi, math.pi, _PEOPLE)
            for each in (world, bare):
                each.place_people(people, headings)
            rendered = full.render(camera, pose)
            frame = Frame(0, 0.0, camera, pose, rendered.image)
            whole = alone.render(wide, pose).people
            for blob in blobs_of(frame):
                owners = rendered.people[tuple((blob[:, ::-1] - 0.5).astype(int).T)]
                person = int(np.bincount(owners[owners >= 0]).argmax())
                hidden = 1.0 - np.sum(rendered.people == person) / np.sum(whole == person)
                yield Sample(frame, forest, blob, people[person], float(hidden))


def _people(rng: np.random.Generator, camera: Camera, pose: Pose, forest: Forest) -> Array:
    half = (pose.position[2] - TARGET_HEIGHT) * math.tan(camera.fov / 2) + _MARGIN
    people: list[Array] = []
    while len(people) < _PEOPLE:
        r, bearing = rng.uniform(0, half * math.sqrt(2)), rng.uniform(-math.pi, math.pi)
        offset = r * np.array([math.cos(bearing), math.sin(bearing)])
        place = pose.position[:2] + offset
        if np.abs(offset).max() > half or any(np.linalg.norm(place - other) < _GAP for other in people):
            continue
        share = forest.visible(pose.position, _BODY + np.append(place, 0.0)).mean() if forest.trees else 0.5
        if 0.0 < share < 1.0 or (share == 1.0 and rng.random() < _PLAIN):
            people.append(place)
    return np.array(people)


def forests(seed: int) -> Iterator[Forest]:
    """Forests of slender, middling and broad trees."""
    for k, (density, radius) in enumerate(((60.0, 1.5), (40.0, 2.5), (15.0, 5.0), (15.0, 5.0))):
        trees = Trees(density=density, canopy_radius=radius)
        yield Forest(grow(trees, Area(80.0, 80.0), np.random.default_rng([seed, k])).trees)


def people_in_forests(seed: int, frames: int, pixels: int = 128) -> list[Sample]:
    """Samples from `frames` frames over each of the `forests`."""
    return [
        sample
        for k, forest in enumerate(forests(seed))
        for sample in samples(np.random.default_rng([seed, 1, k]), forest, frames=frames, pixels=pixels)
    ]


def nees(population: Sequence[Sample]) -> Array:
    """Squared errors over variances (N,) of the samples as the detector gives them; two degrees of freedom."""
    out = []
    for sample in population:
        found = located(sample.frame, [sample.blob], sample.forest)
        error = found.ground[0] - sample.person
        out.append(float(error @ np.linalg.solve(found.covariances[0], error)))
    return np.array(out)


@dataclass(frozen=True)
class Bin:
    """Mean NEES of the samples of a bin, and the interval that holds it at 95 %."""

    name: str
    count: int
    mean: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the mean lies in its interval."""
        return self.low <= self.mean <= self.high


def nees_bins(population: Sequence[Sample]) -> list[Bin]:
    """Mean NEES by angle off nadir and by share hidden."""
    values = nees(population)
    angles = np.degrees(np.arctan([sample.tangent for sample in population]))
    hidden = np.array([sample.hidden for sample in population])
    bins = [_bin(f"{a:.0f} to {b:.0f} deg", values[(angles >= a) & (angles < b)]) for a, b in pairwise(OFF_NADIR)]
    for a, b in pairwise(HIDDEN):
        name = "in plain view" if a == 0.0 else f"{a:.0%} to {b:.0%} hidden"
        bins.append(_bin(name, values[(hidden >= a) & (hidden < b)]))
    return [*bins, _bin("all", values)]


def _bin(name: str, values: Array) -> Bin:
    n = len(values)
    low, high = chi2.ppf((0.025, 0.975), 2 * n) / n
    return Bin(name, n, float(values.mean()), float(low), float(high))


def fit_whole(seed: int, frames: int) -> WholeError:
    """The constants of people in plain view under which their errors are likeliest."""
    rows = []
    for k, (pixels, altitudes) in enumerate((p, a) for p in (96, 128, 192, 256) for a in (ALTITUDES, _OTHERS)):
        rng = np.random.default_rng([seed, 2, k])
        count = frames if (pixels, altitudes) == (128, ALTITUDES) else frames // 6
        for sample in samples(rng, Forest(()), frames=count, pixels=pixels, altitudes=altitudes):
            if places_of(sample.frame, sample.blob, sample.forest) is None:
                rows.append(_errors(sample))
    gsd, tangent, radial, tangential = np.array(rows).T
    powers = tangent[:, None] ** np.arange(3)

    def surprise(x: Array) -> float:
        along, across = ((variances * powers).sum(axis=1) for variances in _whole(x).variances(gsd))
        if not _positive(x) or min(along.min(), across.min()) <= 0.0:
            return math.inf
        return float(np.mean(np.log(along) + radial**2 / along + np.log(across) + tangential**2 / across))

    error = _whole(_minimum(surprise, np.hstack(astuple(WHOLE)[:7]), 12000))
    along, across = ((variances * powers).sum(axis=1) for variances in error.variances(gsd))
    excess, _ = _excess(_between(tangent, error.tangents), radial**2 / along + tangential**2 / across)
    return replace(error, excess=excess)


def _errors(sample: Sample) -> tuple[float, float, float, float]:
    """Size of a pixel on the ground, tangent off nadir, radial and tangential error [m] of somebody seen whole."""
    pose, camera = sample.frame.pose, sample.frame.camera
    ground = measured(sample.frame, [sample.blob]).ground[0]
    height = float(pose.position[2]) - TARGET_HEIGHT
    offset, error = ground - pose.position[:2], ground - sample.person
    distance = max(float(np.linalg.norm(offset)), 1e-9)
    u, v = offset / distance
    return height / camera.focal, distance / height, float(error @ [u, v]), float(error @ [-v, u])


def _whole(x: Array) -> WholeError:
    return WholeError(*x[:3].tolist(), *((a, b) for a, b in x[3:].reshape(-1, 2).tolist()))


def _positive(x: Array) -> bool:
    """Whether the growths (after the first three) stay positive at any angle off nadir."""
    slopes, curves = x[3::2], x[4::2]
    return bool(np.all(curves >= 0.0) and np.all((slopes >= 0.0) | (slopes**2 < 3.8 * curves)))


def fit_part(seed: int, frames: int) -> PartError:
    """The constants of people seen in part under which their places are likeliest, at four resolutions alike."""
    cases = [case for k in (256, 192, 128, 96) for case in _parts(people_in_forests(seed + k, frames, k))]

    def surprise(x: Array) -> float:
        return math.inf if np.min(x) < 0.0 else _with_excess(x, cases[::5])[1]

    start = np.array(PART.constants)
    return _with_excess(np.round(_minimum(surprise, start, 100), 3), cases)[0]


def _parts(population: Sequence[Sample]) -> list[tuple[Places, Array]]:
    """Those of whom something seems hidden: where they may be, and where they are."""
    found = ((places_of(s.frame, s.blob, s.forest), s.person) for s in population)
    return [(places, person) for places, person in found if places is not None]


def _with_excess(x: Array, cases: Sequence[tuple[Places, Array]]) -> tuple[PartError, float]:
    """The constants with the likeliest factors of the covariance, and how unlikely they are."""
    plain = ((1.0,) * len(PART.hidden),) * len(PART.pixel)
    error = replace(PART, **dict(zip(("posture", "rounding", "fringe", "limb"), x.tolist(), strict=True)), excess=plain)
    rows = []
    for places, person in cases:
        mean, covariance, share = places.posterior(error)
        rows.append((*(mean - person), *covariance.ravel(), share))
    u, v, uu, uv, _, vv, shares = np.array(rows).T
    volume = uu * vv - uv * uv
    squares = (vv * u * u - 2 * uv * u * v + uu * v * v) / volume
    pixel = _between([places.pixel for places, _ in cases], error.pixel)
    basis = (pixel[:, None] * _between(shares, error.hidden)).reshape(-1, len(cases))
    excess, factor = _excess(basis, squares)
    surprise = float(np.mean(squares / factor + np.log(volume) + 2 * np.log(factor)))
    table = tuple(tuple(row) for row in np.reshape(excess, (len(error.pixel), -1)).tolist())
    return replace(error, excess=table), surprise


def _between(where: Array | Sequence[float], knots: Sequence[float]) -> Array:
    """Shares (K, N) that each knot has in what is linear between knots, at `where` (N,)."""
    return np.array([np.interp(where, knots, unit) for unit in np.eye(len(knots))])


def _excess(basis: Array, squares: Array) -> tuple[tuple[float, ...], Array]:
    """The likeliest factors (K,) of covariances, and those (N,) of the squares (N,): factors @ basis (K, N)."""
    excess = np.ones(len(basis))
    for _ in range(50):  # weighted least squares of squares / 2 on the factors
        weights = basis / (excess @ basis) ** 2
        excess = np.maximum(np.linalg.solve(weights @ basis.T, weights @ (squares / 2)), 0.1)
    return tuple(excess.tolist()), excess @ basis


def _minimum(function: Callable[[Array], float], start: Array, calls: int) -> Array:
    found = minimize(function, start, method="Nelder-Mead", options={"maxfev": calls, "adaptive": True})
    return np.asarray(found.x)


def _rounded(constants: WholeError | PartError) -> str:
    numbers = [np.round(value, 3).tolist() for value in astuple(constants)]
    return "\n".join(f"  {field.name} = {value}" for field, value in zip(fields(constants), numbers, strict=True))


def main() -> None:
    """Print constants fitted anew, and the NEES of those in force on 5000 other detections."""
    console = Console()
    console.print("tracking.noise.WholeError\n" + _rounded(fit_whole(0, 1200)))
    console.print("tracking.partial.PartError\n" + _rounded(fit_part(1, 500)))
    table = Table("bin", "detections", "mean NEES", "95 % interval", "")
    for row in nees_bins(people_in_forests(2, 165)):
        interval = f"{row.low:.2f} to {row.high:.2f}"
        table.add_row(row.name, str(row.count), f"{row.mean:.2f}", interval, "" if row.holds else "outside")
    console.print(table)


if __name__ == "__main__":
    main()
