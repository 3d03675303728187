"""Hybrid consensus on measurements and information: it tends to the central filter and never knows more."""

import numpy as np
import pytest
from helpers.graphs import graph
from helpers.information import information_form, moment_form
from helpers.scenes import ABOVE, AWAY, CAMERA, MOTION, H, R, scan, track, tracker
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.fusion.consensus import fuse
from tracking.fusion.hcmci import HybridConsensus, largest_innovation, split_information
from tracking.fusion.rule import LocalBeliefs
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

# Association without doubt: whatever is measured is the person.
SURE = {"detection_probability": 1 - 1e-12, "gate_probability": 1 - 1e-12, "clutter_density": 1e-15}
START = track(3, 0, 0, 0.3, 0.1)


def fleet(count: int) -> list[Tracker]:
    parameters = TrackerParameters(MOTION, fusion="hcmci", **SURE)
    return [Tracker(u, CAMERA, parameters, [START]) for u in range(count)]


def noises(rng: np.random.Generator, count: int) -> np.ndarray:
    roots = rng.normal(size=(count, 2, 2)) * 0.3
    return roots @ np.swapaxes(roots, 1, 2) + 0.02 * np.eye(2)


def look(trackers: list[Tracker], k: int, truth: np.ndarray, sees: np.ndarray, rng) -> list[tuple]:
    """All UAVs take a scan of the person; what those that see the person measured, and its covariance."""
    measured = []
    for tracker_, seen, R_ in zip(trackers, sees, noises(rng, len(trackers)), strict=True):
        z = truth + np.linalg.cholesky(R_) @ rng.normal(size=2)
        if seen:
            measured.append((z, R_))
        points, covariances = (z[None], R_[None]) if seen else (np.zeros((0, 2)), np.zeros((0, 2, 2)))
        tracker_.step(Scan(tracker_.uav, 0.2 * k, ABOVE if seen else AWAY, points, covariances))
    return measured


class CentralFilter:
    """Information filter with all measurements."""

    def __init__(self) -> None:
        self.q, self.omega = information_form(START.belief.mean, START.belief.covariance)

    def predict(self) -> None:
        P = MOTION.F @ np.linalg.inv(self.omega) @ MOTION.F.T + MOTION.Q
        mean = MOTION.F @ np.linalg.solve(self.omega, self.q)
        self.omega = np.linalg.inv(P)
        self.q = self.omega @ mean

    def update(self, measured: list[tuple]) -> None:
        for z, R_ in measured:
            self.q = self.q + H.T @ np.linalg.solve(R_, z)
            self.omega = self.omega + H.T @ np.linalg.solve(R_, H)


def beliefs(trackers: list[Tracker]) -> tuple[np.ndarray, np.ndarray]:
    """Information form (n, 4), (n, 4, 4) of the only track of each."""
    held = [t.tracks for t in trackers]
    assert all(len(tracks) == 1 for tracks in held)
    own = [t.belief for (t,) in held]
    return information_form(np.array([b.mean for b in own]), np.array([b.covariance for b in own]))


def some(rng: np.random.Generator, count: int) -> np.ndarray:
    """Flags of UAVs with a detection: some of them, and none in one scan of ten."""
    return (rng.random(count) < 0.5) & (rng.random() < 0.9)


@pytest.mark.parametrize(("kind", "rounds"), [("complete", 40), ("ring", 100)])
def test_with_many_rounds_hcmci_is_the_central_filter(kind, rounds):
    rng, trackers, central = np.random.default_rng(0), fleet(5), CentralFilter()
    for k in range(30):
        if k:
            central.predict()
        central.update(look(trackers, k, np.array([0.06, 0.02]) * k, some(rng, 5), rng))
        fuse(trackers, graph(kind, 5), rounds)
        for t in trackers:
            (held,) = t.tracks
            np.testing.assert_allclose(held.belief.covariance, np.linalg.inv(central.omega), rtol=0, atol=1e-6)
            np.testing.assert_allclose(held.belief.mean, np.linalg.solve(central.omega, central.q), atol=1e-6)


@st.composite
def networks(draw) -> tuple[np.ndarray, np.random.Generator]:
    """Connected graphs of two to seven UAVs."""
    n, rng = draw(st.integers(2, 7)), np.random.default_rng(draw(st.integers(0, 2**32)))
    adjacency = rng.random((n, n)) < draw(st.floats(0, 1))
    for i in range(1, n):
        adjacency[i, rng.integers(i)] = True
    return (adjacency | adjacency.T) & ~np.eye(n, dtype=bool), rng


@settings(max_examples=25, deadline=None, derandomize=True)
@given(networks(), st.integers(0, 5), st.sampled_from([0.0, 0.5, 0.9]))
def test_hcmci_never_knows_more_than_the_central_filter(network, rounds, loss):
    adjacency, rng = network
    trackers, central = fleet(len(adjacency)), CentralFilter()
    for k in range(12):
        if k:
            central.predict()
        central.update(look(trackers, k, np.array([0.06, 0.02]) * k, some(rng, len(adjacency)), rng))
        fuse(trackers, adjacency, rounds, rng.random((rounds, *adjacency.shape)) < loss)
        excess = np.linalg.eigvalsh(central.omega - beliefs(trackers)[1])
        assert excess.min() > -1e-9 * np.linalg.norm(central.omega)


def test_information_of_uavs_that_see_reaches_all_without_dilution():
    rng = np.random.default_rng(3)
    trackers, central = fleet(2), CentralFilter()
    trackers += [tracker(uav=u, fusion="hcmci", **SURE) for u in (2, 3, 4)]
    central.update(look(trackers, 0, np.zeros(2), np.array([1, 1, 0, 0, 0], bool), rng))
    fuse(trackers, graph("complete", 5), 2)
    q, omega = beliefs(trackers)
    np.testing.assert_allclose(omega, np.tile(central.omega, (5, 1, 1)), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(q, np.tile(central.q, (5, 1)), rtol=1e-9, atol=1e-9)
    rng, trackers, central = np.random.default_rng(4), fleet(9), CentralFilter()
    central.update(look(trackers, 0, np.zeros(2), np.arange(9) == 4, rng))
    fuse(trackers, graph("line", 9), 4)
    np.testing.assert_allclose(beliefs(trackers)[1], np.tile(central.omega, (9, 1, 1)), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("distance", [0.3, 0.6, 0.9, 1.0, 1.1, 1.2, 1.3])
def test_doubt_shared_by_all_uavs_does_not_carry_the_mean_away(distance):
    """Twenty UAVs with a measurement that may be a false alarm never go beyond it."""
    trackers = [tracker(track(3, 0, 0, 0, 0), uav=u, fusion="hcmci", clutter_density=0.05) for u in range(20)]
    for t in trackers:
        t.step(scan(0, (distance, 0.0), uav=t.uav))
    fuse(trackers, graph("complete", 20), 5)
    fused = trackers[0].tracks[0].belief
    assert 0.0 < fused.mean[0] < distance and np.linalg.eigvalsh(fused.covariance).min() > 0


def test_a_kalman_update_is_split_into_prior_and_measurement():
    rng = np.random.default_rng(5)
    for R_ in noises(rng, 50):
        root = rng.normal(size=(4, 4))
        prior = information_form(rng.normal(size=4), root @ root.T + 0.01 * np.eye(4))
        gain = H.T @ np.linalg.solve(R_, H)
        S = H @ np.linalg.inv(prior[1]) @ H.T + R_
        z = H @ np.linalg.solve(prior[1], prior[0]) + np.linalg.cholesky(S) @ rng.normal(size=2)
        seen = H.T @ np.linalg.solve(R_, z)
        covariance = np.linalg.inv(prior[1])
        before = (covariance @ prior[0])[None], covariance[None]
        reach = largest_innovation(*before, z[None], np.array([[0, 0]]))
        held, novel = split_information(before, ((prior[0] + seen)[None], (prior[1] + gain)[None]), reach)
        scale = 1e-9 * np.linalg.norm(prior[1] + gain)
        np.testing.assert_allclose(held[0], np.concatenate([prior[0], prior[1].ravel()]), atol=scale)
        np.testing.assert_allclose(novel[0], np.concatenate([seen, gain.ravel()]), atol=scale)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.integers(0, 2**32), st.floats(-2, 2), st.floats(0, 30))
def test_prior_and_novel_parts_add_up_and_are_never_indefinite(seed, scale, reach):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(2, 3, 4, 4)) * np.array([1.0, 10.0**scale])[:, None, None, None]
    matrices = roots @ np.swapaxes(roots, 2, 3) + 1e-3 * np.eye(4)
    vectors = rng.normal(size=(2, 3, 4)) * 10
    held, novel = split_information(moment_form(vectors[0], matrices[0]), (vectors[1], matrices[1]), np.full(3, reach))
    total = np.concatenate([vectors[1], matrices[1].reshape(3, 16)], axis=1)
    np.testing.assert_allclose(held + novel, total, rtol=1e-8, atol=1e-8 * np.abs(total).max())
    for t in range(3):
        largest = np.linalg.norm(matrices[1][t])
        assert np.linalg.eigvalsh(held[t, 4:].reshape(4, 4)).min() > 0
        assert np.linalg.eigvalsh(novel[t, 4:].reshape(4, 4)).min() > -1e-10 * largest
        assert np.linalg.eigvalsh(matrices[0][t] - held[t, 4:].reshape(4, 4)).min() > -1e-8 * max(
            largest, np.linalg.norm(matrices[0][t])
        )


def test_the_largest_innovation_is_that_of_all_measurements_in_the_gate():
    rng = np.random.default_rng(7)
    z, roots = rng.normal(size=(3, 2)), rng.normal(size=(6, 4, 4))
    means, covariances = rng.normal(size=(6, 4)), roots @ np.swapaxes(roots, 1, 2)
    orders = [(0, 1), (1, 0), (0, 1, 2), (2, 1, 0), (2,), ()]
    gates = np.array([(t, j) for t, order in enumerate(orders) for j in order])
    offsets, inverse = z - means[:, None, :2], np.linalg.inv(covariances[:, :2, :2])
    distances = np.sqrt(np.einsum("tji,tik,tjk->tj", offsets, inverse, offsets))
    expected = [max((distances[t, j] for j in order), default=0.0) for t, order in enumerate(orders)]
    np.testing.assert_allclose(largest_innovation(means, covariances, z, gates), expected)


def test_a_posterior_that_is_the_prior_up_to_rounding_has_no_novel_part():
    rng = np.random.default_rng(6)
    roots = rng.normal(size=(50, 4, 4))
    means, covariances = rng.normal(size=(50, 4)), roots @ np.swapaxes(roots, 1, 2) + 0.01 * np.eye(4)
    q, omega = information_form(means, covariances)
    _, novel = split_information((means, covariances), (q[..., None], omega), np.full(50, 3.0))
    assert not novel.any()


def test_priors_are_weighed_by_their_uncertainty_and_only_gains_have_a_share():
    """The first track is measured, the second detected without any gain, the third not detected."""
    P = np.stack([np.diag([1.0, 3.0, 1.0, 1.0]), np.diag([2.0, 2.0, 1.0, 1.0]), np.diag([4.0, 1.0, 1.0, 1.0])])
    prior, gain = information_form(np.zeros((3, 4)), P), H.T @ np.linalg.inv(R) @ H
    means, covariances = moment_form(prior[0], prior[1] + gain * np.array([1.0, 0.0, 0.0])[:, None, None])
    weights, gates, seen = np.array([1.0, 0.5, 0.1]), np.array([[0, 0]]), np.array([0, 1])
    before = np.zeros((3, 4)), P
    local = LocalBeliefs(1, means, covariances, weights, before, np.zeros((1, 2)), gates, seen)
    averaged, novel, shares = HybridConsensus().contribution(local)
    np.testing.assert_allclose(shares, weights / np.array([4.0, 4.0, 5.0]))
    np.testing.assert_allclose(averaged[:, 4:], prior[1].reshape(3, 16), atol=1e-12)
    np.testing.assert_allclose(novel[0, 4:20], gain.ravel(), atol=1e-12)
    assert novel[:, 20:].tolist() == [[0, 1], [0, 0], [0, 0]] and not novel[1:].any()


def test_the_bytes_of_a_message_are_those_of_its_numbers():
    sizes = {}
    for fusion in ("kla", "hcmci"):
        trackers = [tracker(START, track(4, 0, 5, 0, 0), uav=u, fusion=fusion) for u in range(3)]
        trackers[0].step(scan(0, (0.0, 0.0)))
        sizes[fusion] = trackers[0].message(2).size
    # UAV, degree, scan, time, partition; two tracks; of the one seen, novel q and Ω, and one UAV with its share.
    assert sizes == {"kla": 8 * (6 + 2 * 29), "hcmci": 8 * (6 + 2 * 29 + 14 + 2)}
