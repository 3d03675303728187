"""The filter against all hypotheses written out: existence, the measurement of each person, clutter and new people."""

import itertools
import math

import numpy as np
import pytest
from helpers.scenes import ABOVE, ALONE, AWAY, MOTION, H, tracker
from helpers.views import CAMERA

from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import fuse
from tracking.geometry.camera import ALL_ROUND, Camera
from tracking.geometry.visibility import Forest, Tree, at_target_height, visible_samples
from tracking.management.initiation import Tentative, initiate_tracks
from tracking.measurement_update import Measured, associate, predict_scan
from tracking.parameters import TrackerParameters
from tracking.settings import DAY
from tracking.track import Beliefs, Scan, Track

# No track is confirmed, deleted or joined to another: what is left is the filter.
FILTER = {
    "confirmation_threshold": 1 - 1e-12,
    "deletion_threshold": 1e-300,
    "max_variance": 1e8,
    "reacquire_after": DAY,
}
IN_VIEW = {"time": 0.0, "elapsed": 1, "forest": Forest(()), "lens": Camera(ALL_ROUND, 128).lens(ABOVE)}  # everything


def normal(x, covariance):
    return math.exp(-0.5 * x @ np.linalg.solve(covariance, x)) / math.sqrt(np.linalg.det(2 * math.pi * covariance))


class Person:
    """A Bernoulli component: a person of this label exists with probability r, and is where the belief says."""

    def __init__(self, label, r, mean, covariance):
        self.label, self.r, self.mean, self.covariance = label, r, mean, covariance

    def predicted(self, survival):
        return Person(
            self.label, self.r * survival, MOTION.F @ self.mean, MOTION.F @ self.covariance @ MOTION.F.T + MOTION.Q
        )

    def density(self, z, R, gate):
        """Of a measurement, zero outside the gate."""
        nu, S = z - self.mean[:2], self.covariance[:2, :2] + R
        return normal(nu, S) if nu @ np.linalg.solve(S, nu) <= -2 * math.log(1 - gate) else 0.0

    def updated(self, z, R):
        K = self.covariance @ H.T @ np.linalg.inv(self.covariance[:2, :2] + R)
        return self.mean + K @ (z - self.mean[:2]), self.covariance - K @ H @ self.covariance


def missed(people, visible, p):
    """Probabilities that each gives no measurement in its gate; two near each other may give one."""
    out = []
    for i, a in enumerate(people):
        near = [b.r * math.exp(-0.5 * np.sum((a.mean[:2] - b.mean[:2]) ** 2)) for k, b in enumerate(people) if k != i]
        alone = 1 - 0.12 * max(near, default=0.0)
        out.append(1 - p.settings.detection_probability * p.settings.gate_probability * visible * alone)
    return out


def hypotheses(people, scan, misses, p, lost=0.0, shares=1.0):
    """Each hypothesis as the measurement of each person, 0 for none and None for no such person, and its weight.

    lost (N,): density at each measurement of people without a track; any other is clutter. shares (N,): probability
    that leaves show a person there.
    """
    found = list(zip(scan.measurements, scan.covariances, strict=True))
    shares = shares * np.ones(len(found))
    others = p.settings.clutter_density + lost * shares
    for event in itertools.product((None, *range(len(found) + 1)), repeat=len(people)):
        given = [j for j in event if j]
        if len(set(given)) < len(given):
            continue
        weight = math.prod(others[j] for j in range(len(found)) if j + 1 not in given)
        for person, miss, j in zip(people, misses, event, strict=True):
            if j is None:
                weight *= 1 - person.r
            elif j == 0:
                weight *= person.r * miss
            else:
                weight *= (
                    person.r
                    * p.settings.detection_probability
                    * shares[j - 1]
                    * person.density(*found[j - 1], p.settings.gate_probability)
                )
        yield event, weight


def after(people, scan, misses, p, lost=0.0, shares=1.0):
    """People after a scan, each by the moments over all hypotheses with it, and the association probabilities."""
    every = list(hypotheses(people, scan, misses, p, lost, shares))
    total, out = math.fsum(weight for _, weight in every), []
    beta = np.zeros((len(people), len(scan.measurements) + 1))
    for i, person in enumerate(people):
        shares = np.zeros(len(scan.measurements) + 1)
        for event, weight in every:
            beta[i, event[i] or 0] += weight / total
            if event[i] is not None:
                shares[event[i]] += weight / total
        parts = [(person.mean, person.covariance)]
        parts += [person.updated(*row) for row in zip(scan.measurements, scan.covariances, strict=True)]
        mean = sum(w * m for w, (m, _) in zip(shares, parts, strict=True)) / shares.sum()
        moments = [w * (C + np.outer(m - mean, m - mean)) for w, (m, C) in zip(shares, parts, strict=True)]
        r = min(max(shares.sum(), 1e-9), 1 - 1e-9)  # as far as a fleet's log-odds go
        out.append(Person(person.label, r, mean, sum(moments) / shares.sum()))
    return out, beta


def scene(rng):
    """One to three people within some metres, and what a tracker assumes of them and of its camera."""
    people = []
    for label in rng.permutation(9)[: rng.integers(1, 4)].tolist():
        root = rng.normal(size=(4, 4)) * rng.uniform(0.1, 0.5)
        mean = np.concatenate([rng.uniform(-1.5, 1.5, 2), rng.normal(size=2)])
        people.append(Person(label, rng.choice([1.0, rng.uniform(0.05, 0.99)]), mean, root @ root.T + 0.02 * np.eye(4)))
    settings = {
        "detection_probability": rng.uniform(0.3, 0.99),
        "gate_probability": rng.choice([0.9, 0.9999]),
        "clutter_density": 10 ** rng.uniform(-4, 0),
        "survival": rng.uniform(0.8, 1.0),
    }
    return sorted(people, key=lambda person: person.label), settings


def measured(rng, k, people, pose, count=None):
    """A scan with up to four measurements, near people and elsewhere."""
    z = rng.uniform(-2, 2, (rng.integers(0, 5) if count is None else count, 2))
    for j, person in zip(range(len(z)), people, strict=False):
        z[j] = z[j] if rng.random() < 0.3 else person.mean[:2] + rng.normal(size=2) * 0.5
    roots = rng.normal(size=(len(z), 2, 2)) * 0.3
    return Scan(0, 0.2 * k, pose, z, roots @ np.swapaxes(roots, 1, 2) + 0.02 * np.eye(2))


def known(people):
    return [Track(a.label, Gaussian(a.mean, a.covariance), a.r) for a in people]


def same(tracks, people):
    assert len(tracks) == len(people)
    for t, a in zip(tracks, people, strict=True):
        assert t.existence == pytest.approx(a.r, rel=0, abs=1e-9)
        np.testing.assert_allclose(t.belief.mean, a.mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(t.belief.covariance, a.covariance, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_association_probabilities_are_those_of_all_hypotheses(seed):
    rng = np.random.default_rng([1, seed])
    for _ in range(40):
        people, settings = scene(rng)
        p, visible, scan = TrackerParameters(MOTION, **settings), rng.integers(0, 2), measured(rng, 0, people, ABOVE)
        beliefs = Beliefs(np.array([a.mean for a in people]), np.array([a.covariance for a in people]))
        seen = np.full((len(people), 36), bool(visible))
        empty = 1 - p.settings.detection_probability * seen
        existence, whose = np.array([a.r for a in people]), np.array([0, len(people)])
        before = predict_scan(beliefs, existence, seen.mean(axis=1), empty, p.scan, whose)
        lost = 10 ** rng.uniform(-6, 0, len(scan.measurements))
        shares = rng.uniform(0.0, 1.0, len(scan.measurements)) if rng.random() < 0.5 else np.ones(len(lost))
        found = Measured(scan.measurements, scan.covariances, shares, lost)
        _, beta, given, existence = associate(before, found, p.association)
        people, expected = after(people, scan, missed(people, visible, p), p, lost, shares)
        np.testing.assert_allclose(beta, expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(existence, [a.r for a in people], rtol=0, atol=1.1e-9)
        assert np.all(given[expected < 1e-15] < 1e-9)


@pytest.mark.parametrize("fusion", ["kla", "hcmci"])
@pytest.mark.parametrize("seed", range(4))
def test_tracks_after_one_to_three_scans_are_the_moments_of_all_hypotheses(seed, fusion, monkeypatch):
    """Labels, existence and beliefs; a Gaussian and independence after each scan are part of the definition."""
    monkeypatch.setattr("tracking.tracker.SEEN", 1 - 1e-12)
    rng = np.random.default_rng([2, seed])
    for _ in range(15):
        people, settings = scene(rng)
        subject = tracker(*known(people), **settings, **FILTER, fusion=fusion)
        for k in range(rng.integers(1, 4)):
            pose = AWAY if rng.random() < 0.2 else ABOVE
            people = [a.predicted(settings["survival"] ** 0.2) for a in people] if k else people
            scan = measured(rng, k, people, pose)
            people, _ = after(people, scan, missed(people, pose is ABOVE, subject.parameters), subject.parameters)
            subject.step(scan)
            fuse([subject], ALONE, 5)
            assert [t.id for t in subject.tracks] == [a.label for a in people]
            same(subject.tracks, people)


@pytest.mark.parametrize("count", range(1, 5))
def test_a_measurement_without_a_track_is_new_by_the_poisson_intensities(count):
    """All ways to call each measurement clutter or a new person; velocities are spread over a disc."""
    rng = np.random.default_rng(count)
    scan = measured(rng, 0, [], ABOVE, count)
    p = TrackerParameters(MOTION, clutter_density=10 ** rng.uniform(-6, -1), birth_density=10 ** rng.uniform(-6, -1))
    weights = {
        kinds: math.prod(p.settings.birth_density if new else p.settings.clutter_density for new in kinds)
        for kinds in itertools.product((False, True), repeat=count)
    }
    spread = np.diag([0.0, 0.0, p.settings.max_speed**2 / 4, p.settings.max_speed**2 / 4])
    people = []
    for j, (z, R) in enumerate(zip(scan.measurements, scan.covariances, strict=True)):
        r = math.fsum(w for kinds, w in weights.items() if kinds[j]) / math.fsum(weights.values())
        people.append(Person(j, r, H.T @ z, H.T @ R @ H + spread))
    _, born = initiate_tracks([], scan.measurements, scan.covariances, **IN_VIEW, p=p)
    same(born, people)


@pytest.mark.parametrize("seed", range(4))
def test_new_people_are_followed_as_all_hypotheses_say_until_confirmed(seed):
    """Over three scans; a measurement beyond all gates is a further one, none other is taken for one here."""
    rng = np.random.default_rng([3, seed])
    for _ in range(15):
        people, settings = scene(rng)
        p = TrackerParameters(MOTION, **settings, **FILTER)
        tentative = [Tentative(Gaussian(a.mean, a.covariance), (), a.r) for a in people]
        for k in range(1, 4):
            people, scan = [a.predicted(settings["survival"] ** 0.2) for a in people], measured(rng, k, people, ABOVE)
            misses = [1 - p.settings.detection_probability * p.settings.gate_probability] * len(people)
            people, _ = after(people, scan, misses, p)
            measurements = scan.measurements, scan.covariances
            _, tentative = initiate_tracks(tentative, *measurements, **IN_VIEW, p=p)
            same(tentative[: len(people)], people)
            tentative = tentative[: len(people)]


def test_a_track_half_under_leaves_is_as_probable_as_its_person_wherever_it_is_measured():
    """Of a person who exists with probability 1/2, the mean posterior is the share of draws with a person."""
    rng, draws = np.random.default_rng(4), 20000
    p = TrackerParameters(MOTION, clutter_density=0.02, gate_probability=0.9999)
    forest, lens = Forest((Tree(20.0, 0.0, 20.0, leaf_area_density=1.5),)), CAMERA.lens(ABOVE)  # leaves to the east
    beliefs = Beliefs(np.zeros((1, 4)), np.diag([1.0, 1.0, 0.1, 0.1])[None])
    seen = visible_samples(forest, *beliefs, lens)[:, 0]
    empty = 1.0 - p.settings.detection_probability * seen
    before = predict_scan(beliefs, np.array([0.5]), seen.mean(axis=1), empty, p.scan, np.array([0, 1]))
    places = rng.normal(size=(draws, 2))
    shown = forest.detectabilities(lens, at_target_height(places)) * p.settings.detection_probability
    exists, errors = rng.random(draws) < 0.5, {"leaves": [], "open": [], "none": []}
    for place, real, there in zip(places, exists, exists & (rng.random(draws) < shown), strict=True):
        z = rng.uniform(-4.0, 4.0, (rng.poisson(64 * p.settings.clutter_density), 2))
        z = np.vstack([z, place + 0.1 * rng.normal(size=(1, 2))]) if there else z
        shares = forest.detectabilities_through_leaves(lens, at_target_height(z))
        found = Measured(z, np.tile(0.01 * np.eye(2), (len(z), 1, 1)), shares, np.zeros(len(z)))
        *_, existence = associate(before, found, p.association)
        if len(z) < 2:
            errors["none" if len(z) == 0 else "leaves" if z[0, 0] > 0.0 else "open"].append(real - existence[0])
    for kind, of in errors.items():
        assert abs(np.mean(of)) < 0.02 + 3 * np.std(of) / math.sqrt(len(of)), kind
        assert len(of) > 1000
