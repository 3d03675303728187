"""Scans that arrive late, out of order or never: each UAV's tracks are those of a central filter with what it has."""

from copy import deepcopy

import numpy as np
import pytest
from helpers.information import information_form
from helpers.scenes import ABOVE, CAMERA, MOTION, H, track
from helpers.scenes import scan as scan_of

from tracking.fusion.consensus import fuse
from tracking.fusion.late_scans import FleetState, ScanLog, average_reports
from tracking.parameters import TrackerParameters
from tracking.track import Scan
from tracking.tracker import Tracker

SURE = {"detection_probability": 1 - 1e-12, "gate_probability": 1 - 1e-12, "clutter_density": 1e-15}
START = track(3, 0, 0, 0.3, 0.1)


def fleet(count, *initial, **settings):
    parameters = TrackerParameters(MOTION, **settings)
    return FleetState(tuple(Tracker(u, CAMERA, parameters, initial) for u in range(count)))


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
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
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


def test_a_message_agreed_upon_changes_the_next_state_and_not_what_follows_otherwise():
    """A step from one state is made once for all UAVs with the same scans."""
    scans = {u: scan_of(1, (0.4, 0.1), uav=u) for u in range(2)}
    agreed = fleet(2, track(3, 5, 5, 0, 0)).step(0.2, {}).pooled
    plain, start = fleet(2, START).step(0.2, scans), fleet(2, START)
    accepted = start.step(0.2, scans, agreed)
    found = start.step(0.2, scans)
    assert found is start.step(0.2, scans)
    for one, same, other in zip(plain.trackers, found.trackers, accepted.trackers, strict=True):
        np.testing.assert_array_equal(one.tracks[0].belief.mean, same.tracks[0].belief.mean)
        assert abs(other.tracks[0].belief.mean[0] - one.tracks[0].belief.mean[0]) > 4


def test_pooled_messages_are_those_of_a_round_in_which_all_hear_each_other():
    """From nothing, with false alarms, so that tracks begin, join and end; pooling has one sum in place of four."""
    rng = np.random.default_rng(3)
    people, velocities = rng.uniform(-7, 7, (5, 2)), rng.normal(0, 0.7, (5, 2))
    members = [Tracker(u, CAMERA, TrackerParameters(MOTION, clutter_density=1e-3)) for u in range(4)]
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


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_uavs_that_lacked_scans_for_longer_than_the_hold_agree_on_tracks_and_ids_again(seed):
    """Two pairs of UAVs find the same and other people during 6 s apart; six holds later no track is double."""
    rng, hold, heard = np.random.default_rng(seed), 4, {}
    logs = [ScanLog(u, fleet(4), hold) for u in range(4)]
    people, velocities = rng.uniform(-7, 7, (6, 2)), rng.normal(0, 0.5, (6, 2))
    people[:3] = [[-6, -6], [0, 6], [6, -2]]  # apart from one another
    apart = np.kron(np.eye(2), np.ones((2, 2))).astype(bool)
    scans = {}
    for k in range(30 + 6 * hold):
        places = people + 0.2 * (k - 40) * velocities
        for u, log in enumerate(logs):
            # During the time apart the first pair sees people 0 to 3, the other one 2 to 5; then all see all.
            seen = places[:4] if u < 2 else places[2:]
            seen = seen if k < 30 else places
            scans[k, u] = scan_of(k, *(seen + rng.normal(0, 0.2, seen.shape)), uav=u)
            for j in range(4):
                if k >= 2 and j != u and (k - 2 >= 30 or apart[u, j]):
                    log.add(k - 2, scans[k - 2, j])
                for n, report in heard.get((k - 2, j), ()):
                    if j != u and (k - 2 >= 30 or apart[u, j]):
                        log.add_report(n, j, report)
        for u, log in enumerate(logs):
            log.step(0.2 * k, scans[k, u])
            if log.report:
                heard[k, u] = [log.report]
    ids = [sorted(t.id for t in log.tracker.tracks if t.reported) for log in logs]
    assert ids[0] == ids[1] == ids[2] == ids[3] and len(ids[0]) == 6
    for log in logs:
        found = np.array([t.belief.mean[:2] for t in log.tracker.tracks if t.reported])
        gaps = np.linalg.norm(found[:, None] - places, axis=2)
        assert sorted(gaps.argmin(axis=1)) == list(range(6)) and gaps.min(axis=1).max() < 1.0


def test_agreement_counts_no_information_twice_and_equal_reports_change_nothing():
    """Two histories share a past and one scan, and each has one of its own: the central filter is never less sure."""
    common, used, rng = fleet(3, START, **SURE), {}, np.random.default_rng(1)
    for k in range(6):
        used[k, 0] = scan_of(k, rng.normal(0, 0.2, 2), uav=0)
        common = common.step(0.2 * k, {0: used[k, 0]})
    last = {u: scan_of(6, rng.normal(0, 0.2, 2), uav=u) for u in range(3)}
    known = [{0: last[0], 1: last[1]}, {0: last[0], 2: last[2]}]
    ones = [common.step(0.2 * 6, scans) for scans in known]
    agreed = average_reports({u: state.pooled for u, state in enumerate(ones)}, 3.0)
    _, best = filter_centrally(used | {(6, u): scan for u, scan in last.items()}, 6)
    _, without = filter_centrally(used | {(6, 0): last[0]}, 6)
    for scans in known:
        for tracker in common.step(0.2 * 6, scans, agreed).trackers:
            (held,) = tracker.tracks
            assert np.linalg.eigvalsh(held.belief.covariance - best).min() > -1e-12
            assert np.linalg.eigvalsh(without - held.belief.covariance)[-2:].min() > 1e-3  # what each has alone counts
    assert average_reports({u: common.pooled for u in range(2)}, 3.0) is None


def test_a_scan_ahead_of_the_log_is_refused_in_one_line():
    log = ScanLog(0, fleet(2), 4)
    for k in range(12):
        for ahead in (0, 1, 30):
            with pytest.raises(
                ValueError, match=f"^k: scan {k + ahead} is ahead of this log, whose last scan is {k - 1}"
            ):
                log.add(k + ahead, Scan(1, 0.2 * k, ABOVE, np.zeros((0, 2)), np.zeros((0, 2, 2))))
        log.step(0.2 * k)
