"""Scans that arrive late, out of order or never: each UAV's tracks are those of a central filter with what it has."""

from copy import deepcopy

import numpy as np
import pytest
from helpers.information import information_form
from helpers.scenes import ABOVE, CAMERA, MOTION, OPEN, H, track
from helpers.scenes import scan as scan_of

from tracking.fusion.consensus import fuse
from tracking.fusion.late_scans import FleetState, ScanLog
from tracking.tracker import Scan, Tracker, TrackerParameters

SURE = {"detection_probability": 1 - 1e-12, "gate_probability": 1 - 1e-12, "clutter_density": 1e-15}
START = track(3, 0, 0, 0.3, 0.1)


def fleet(count, *initial, **settings):
    parameters = TrackerParameters(MOTION, **settings)
    return FleetState(tuple(Tracker(u, CAMERA, OPEN, parameters, initial) for u in range(count)))


def filter_centrally(scans, until):
    """Mean and covariance at scan `until` of a Kalman filter that takes scans, by number and UAV, in their order."""
    mean, P = START.belief.mean, START.belief.covariance
    for k in range(until + 1):
        if k:
            mean, P = MOTION.F @ mean, MOTION.F @ P @ MOTION.F.T + MOTION.Q
        q, omega = information_form(mean, P)
        for (n, _), scan in scans.items():
            if n == k and len(scan.measurements):
                weight = np.linalg.inv(scan.covariances[0])
                q, omega = q + H.T @ weight @ scan.measurements[0], omega + H.T @ weight @ H
        P = np.linalg.inv(omega)
        mean = P @ q
    return mean, P


@pytest.mark.parametrize("hold", [4, 9])
@pytest.mark.parametrize("seed", range(3))
def test_late_scans_give_the_central_filter_with_the_same_delays(seed, hold):
    """Delays are drawn up to 7 scans, so that with a hold of 4 some scans are too late; a tenth is lost."""
    rng, uavs, scans = np.random.default_rng(seed), 4, {}
    logs = [ScanLog(u, fleet(uavs, START, **SURE), hold) for u in range(uavs)]
    coming, used, orders = {}, [{} for _ in range(uavs)], 0
    for k in range(40):
        truth, late = np.array([0.06, 0.02]) * k, coming.pop(k, [])
        for u in range(uavs):
            root = rng.normal(size=(2, 2)) * 0.3
            R = root @ root.T + 0.02 * np.eye(2)
            z = truth + np.linalg.cholesky(R) @ rng.normal(size=2)
            scans[k, u] = Scan(u, 0.2 * k, ABOVE, z[None], R[None])
            for receiver in range(uavs):
                if receiver != u and rng.random() > 0.1:
                    coming.setdefault(k + int(rng.integers(1, 8)), []).append((receiver, k, u))
        for u, log in enumerate(logs):
            arrived = [(n, j) for receiver, n, j in late if receiver == u]
            arrived = [arrived[i] for i in rng.permutation(len(arrived))]
            orders += arrived != sorted(arrived)
            for n, j in arrived:
                assert log.add(n, scans[n, j]) == (n >= k - hold)
                if n >= k - hold:
                    used[u][n, j] = scans[n, j]
                assert not log.add(n, scans[n, j])  # another copy
            used[u][k, u] = scans[k, u]
            log.step(0.2 * k, scans[k, u])
            ((held,), (mean, P)) = log.tracker.tracks, filter_centrally(used[u], k)
            np.testing.assert_allclose(held.belief.mean, mean, rtol=0, atol=1e-9)
            np.testing.assert_allclose(held.belief.covariance, P, rtol=0, atol=1e-9)
    assert orders > 5
    assert all(len(of) < 4 * 40 for of in used)


def test_uavs_with_the_same_scans_have_the_same_bits_whatever_their_order():
    rng, logs = np.random.default_rng(0), [ScanLog(u, fleet(3), 6) for u in (0, 2)]
    people = rng.uniform(-8, 8, (4, 2))
    scans = [[scan_of(k, *(people + rng.normal(0, 0.2, people.shape)), uav=u) for u in range(3)] for k in range(15)]
    for k, (a, _, c) in enumerate(scans):
        if k >= 3:
            logs[0].add(k - 3, scans[k - 3][1])
            logs[0].add(k - 3, scans[k - 3][2])
            if k % 2:
                logs[1].add(k - 2, scans[k - 2][0])
                logs[1].add(k - 3, scans[k - 3][0])
                for n in (k - 2, k - 3):
                    logs[1].add(n, scans[n][1])
        logs[0].step(0.2 * k, a)
        logs[1].step(0.2 * k, c)
    for log in logs:
        for n in range(9, 15):
            for scan in scans[n]:
                log.add(n, scan)
        log.step(3.0)
    one, two = (log.tracker.tracks for log in logs)
    assert len(one) == 4
    for a, b in zip(one, two, strict=True):
        assert a.id == b.id and a.belief.mean.tobytes() == b.belief.mean.tobytes()


def test_pooled_messages_are_those_of_a_round_in_which_all_hear_each_other():
    """From nothing, with false alarms, so that tracks begin, join and end; pooling has one sum in place of four."""
    rng = np.random.default_rng(3)
    people, velocities = rng.uniform(-7, 7, (5, 2)), rng.normal(0, 0.7, (5, 2))
    members = [Tracker(u, CAMERA, OPEN, TrackerParameters(MOTION, clutter_density=1e-3)) for u in range(4)]
    state, begun = FleetState(deepcopy(members)), set()
    for k in range(40):
        places = people + 0.2 * k * velocities
        scans = {}
        for u in range(4):
            seen = places[rng.random(5) < 0.8] + rng.normal(0, 0.2, (1, 2))
            scans[u] = scan_of(k, *seen, *rng.uniform(-9, 9, (rng.poisson(0.5), 2)), uav=u)
        for member in members:
            member.step(scans[member.uav])
        fuse(members, ~np.eye(4, dtype=bool), 1)
        state = state.step(0.2 * k, scans)
        for one, other in zip(members, state.trackers, strict=True):
            assert [t.id for t in one.tracks] == [t.id for t in other.tracks]
            for a, b in zip(one.tracks, other.tracks, strict=True):
                np.testing.assert_allclose(a.belief.mean, b.belief.mean, rtol=0, atol=1e-9)
                assert a.existence == pytest.approx(b.existence, abs=1e-9)
            begun |= {t.id for t in one.tracks}
    assert len(begun) >= 5 and len(state.trackers[0].tracks) >= 4
