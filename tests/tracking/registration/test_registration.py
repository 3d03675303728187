"""Registration of UAVs: closed forms in linear cases, and fleets judged by true errors that they do not know."""

import numpy as np
import pytest
from helpers.flights import fly_ideal, recording_of
from helpers.scenes import CAMERA, MOTION

from sim.facts.metrics.score import score
from sim.sensing.navigation import NavigationErrors
from tracking.filter.kalman import Gaussian
from tracking.fusion.consensus import step
from tracking.fusion.late_scans import FleetState, ScanLog
from tracking.geometry.camera import Pose
from tracking.metrics.nees import nees_interval
from tracking.navigation import ATTITUDE_TIME, NAVIGATION, POSITION_TIME, Navigation
from tracking.parameters import TrackerParameters
from tracking.registration.pose_errors import error_slopes, move_to_believed
from tracking.registration.registration import make_registration
from tracking.track import Beliefs, Scan, Track
from tracking.tracker import Tracker

ABOVE = Pose.level(0, 0, 20)
H = np.eye(2, 4)


def learn(registration, scan, means, covariances, posteriors, fleet=1):
    """Correct a scan whose measurements are those of the tracks, in order, and learn from it."""
    corrected, ids = registration.correct(scan), np.arange(len(means))
    gates = np.column_stack([ids, ids])
    registration.note(ids, Beliefs(means, covariances), corrected, gates, np.ones(len(ids)))
    registration.learn(ids, posteriors(corrected), fleet)
    return corrected


def test_errors_are_those_of_the_filter_of_people_and_errors_at_the_first_scan():
    """Also the cross-covariance, with the gains of the tracker, which takes the errors for noise."""
    rng, figures = np.random.default_rng(0), NAVIGATION["consumer"]
    registration = make_registration(figures, "estimate", known=True)
    B, points = registration.covariance.copy(), rng.uniform(-6, 6, (2, 2))
    roots = rng.normal(size=(2, 4, 4))
    P, R = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(4), np.array([0.2 * np.eye(2), [[0.3, 0.1], [0.1, 0.2]]])
    means = np.hstack([points + rng.normal(size=(2, 2)), np.zeros((2, 2))])
    noise = np.diag(np.square([*figures.noises, 0.0]))
    G = error_slopes(points, ABOVE, np.zeros(2))
    R_white = R + G @ noise @ G.swapaxes(1, 2)
    inflated = R_white + G @ B @ G.swapaxes(1, 2)

    def fuse(corrected):
        np.testing.assert_allclose(corrected.covariances, inflated, atol=1e-12)
        return np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(inflated) @ H)

    learn(registration, Scan(0, 0.0, ABOVE, points, R), means, P, fuse)
    # Errors of the two people (4 each), errors of the pose (7), and noises (2 each).
    joint = np.zeros((19, 19))
    for at, part in zip((0, 4, 8, 15, 17), (*P, B, *R_white), strict=True):
        joint[at : at + len(part), at : at + len(part)] = part
    rows = np.zeros((4, 19))
    for i in range(2):
        two = slice(2 * i, 2 * i + 2)
        rows[two, 4 * i : 4 * i + 2], rows[two, 8:15], rows[two, 15 + 2 * i : 17 + 2 * i] = np.eye(2), G[i], np.eye(2)
    K = joint[8:15] @ rows.T @ np.linalg.inv(rows @ joint @ rows.T)
    np.testing.assert_allclose(registration.errors, K @ (points - means[:, :2]).ravel(), rtol=1e-9, atol=1e-12)
    left = np.eye(19)[8:15] - K @ rows
    np.testing.assert_allclose(registration.covariance, left @ joint @ left.T, rtol=1e-9, atol=1e-12)
    for i, posterior in enumerate(fuse(Scan(0, 0.0, ABOVE, points, inflated))):
        L = posterior @ H.T @ np.linalg.inv(inflated[i])
        fused = np.zeros((4, 19))
        fused[:, 4 * i : 4 * i + 4], fused[:, 8:15] = posterior @ np.linalg.inv(P[i]), -L @ G[i]
        fused[:, 15 + 2 * i : 17 + 2 * i] = -L
        np.testing.assert_allclose(registration._crosses[i], fused @ joint @ left.T, rtol=1e-9, atol=1e-12)


def test_above_people_who_are_known_it_is_the_kalman_filter_of_a_drift():
    figures, rng = Navigation(horizontal_drift=1.5, horizontal_noise=0.1), np.random.default_rng(1)
    registration, P, R = make_registration(figures, "estimate", known=True), 1e-15 * np.eye(4)[None], 0.04
    mean, variance, kept = np.zeros(2), 1.5**2, np.exp(-1 / POSITION_TIME)
    for k in range(30):
        if k:
            mean, variance = kept * mean, kept**2 * variance + 1.5**2 * (1 - kept**2)
        z = rng.normal(size=2)
        learn(registration, Scan(0, float(k), ABOVE, z[None], R * np.eye(2)[None]), np.zeros((1, 4)), P, lambda _: P)
        gain = variance / (variance + R + 0.01)
        mean, variance = mean + gain * (z - mean), (1 - gain) * variance
        np.testing.assert_allclose(registration.errors[:2], mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(registration.covariance[:2, :2], variance * np.eye(2), rtol=0, atol=1e-9)


def test_scans_within_a_second_teach_as_much_as_one_scan():
    """Four residuals at 4 Hz, each of another person, against the posterior by one residual, of their mean."""
    registration = make_registration(Navigation(horizontal_drift=1.5, horizontal_noise=0.1), "estimate", known=True)
    nobody, P, R = np.zeros((0, 2)), np.diag([0.7, 0.7, 0.5, 0.5]), 0.29
    registration.correct(Scan(0, 0.0, ABOVE, nobody, np.zeros((0, 2, 2))))
    residuals = np.array([[1.0, -2.0], [0.5, 0.0], [2.0, -1.0], [1.5, 1.0]])
    for k, offset in enumerate(residuals):
        corrected = registration.correct(Scan(0, 0.25 * (k + 1), ABOVE, offset[None], R * np.eye(2)[None]))
        mean = registration.errors[:2] + corrected.measurements[0] - offset  # so that the residual is the offset
        beliefs = Beliefs(np.array([[*mean, 0.0, 0.0]]), P[None])
        registration.note(np.array([k]), beliefs, corrected, np.zeros((1, 2), int), np.ones(1))
        registration.learn(np.array([k]), P[None], 1)
    left = 1.0 / (1.0 / 1.5**2 + 1.0 / (0.7 + R + 0.1**2))
    np.testing.assert_allclose(registration.covariance[:2, :2], left * np.eye(2), rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(registration.errors[:2], left * residuals.mean(axis=0), rtol=0.02)


@pytest.mark.parametrize("deviation", [0.1, 0.3, 0.5])
def test_measurements_in_a_turn_err_as_far_as_the_offset_of_the_clock_bends_the_way(deviation):
    """On a circle at 4 m/s and 4 m/s²; a quadrature that is exact for polynomials of fifth degree in the offset."""
    registration, R = make_registration(Navigation(clock_deviation=deviation), "inflate", known=True), 0.01 * np.eye(2)
    for angle in np.arange(0.0, 4.0, 0.02):  # rad, and s
        ahead, inwards = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        scan = Scan(0, angle, Pose.level(*(-4.0 * inwards), 20.0), np.zeros((1, 2)), R[None])
        found = registration.correct(scan).covariances[0] - R
    expected = np.zeros((2, 2))
    for offset, weight in ((-np.sqrt(3.0) * deviation, 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0) * deviation, 1 / 6)):
        moved = offset * (4.0 * ahead - offset * 4.0 * inwards)  # by the velocity at the scan's time
        expected += weight * np.outer(moved, moved)
    axes = np.column_stack([ahead, inwards])
    found, expected = axes.T @ found @ axes, axes.T @ expected @ axes
    np.testing.assert_allclose(np.diag(found), np.diag(expected), rtol=0.05)
    assert abs(found[0, 1]) < 0.05 * np.sqrt(expected[0, 0] * expected[1, 1])


def test_cross_covariances_move_with_the_people():
    registration = make_registration(Navigation(horizontal_drift=1.5), "estimate", known=True)
    scan, P = Scan(0, 0.0, ABOVE, np.ones((1, 2)), np.eye(2)[None]), np.diag([1.0, 1.0, 0.5, 0.5]) + 0.2
    learn(registration, scan, np.zeros((1, 4)), P[None], lambda _: P[None])
    before, F = registration._crosses[0], np.eye(4) + 0.5 * np.eye(4, k=2)
    registration.correct(Scan(0, 0.5, ABOVE, np.zeros((0, 2)), np.zeros((0, 2, 2))))
    kept = np.exp(-0.5 / POSITION_TIME)
    np.testing.assert_allclose(registration._crosses[0][:, :2], kept * F @ before[:, :2], rtol=1e-12, atol=1e-12)
    assert np.abs(before[2:, :2]).max() > 0.01


@pytest.mark.parametrize(("seconds", "least"), [(40, 0.97), (300, 0.55)])
def test_angles_with_a_bias_and_a_drift_are_forgotten_no_later_than_they_change(seconds, least):
    """And in a mission of 40 s hardly sooner."""
    figures = NAVIGATION["consumer"]
    registration = make_registration(figures, "estimate", known=True)
    registration.correct(Scan(0, 0.0, ABOVE, np.zeros((0, 2)), np.zeros((0, 2, 2))))
    registration.errors = np.ones(7)
    for k in range(1, 5 * seconds + 1):
        registration.correct(Scan(0, k / 5, ABOVE, np.zeros((0, 2)), np.zeros((0, 2, 2))))
    stay, vary = np.square(figures.biases)[3:], np.square(figures.drifts)[3:]
    exact = (stay + vary * np.exp(-seconds / ATTITUDE_TIME)) / (stay + vary)
    assert np.all(registration.errors[3:6] <= exact) and np.all(registration.errors[3:6] >= least * exact)


def test_an_offset_of_the_clock_is_known_in_turns_of_the_flight():
    """What is not linear in the offset counts: at 4 m/s² and an offset of 0.3 s, a third of a metre."""
    found = []
    for offset in (-0.3, -0.1, 0.2, 0.4):
        registration, P = make_registration(Navigation(clock_deviation=0.3), "estimate", known=True), 1e-9 * np.eye(4)
        rate = 4.0 / 4.0  # rad/s, of a circle at 4 m/s
        for k in range(26):
            angle = 0.2 * k * rate
            place, ahead = (
                4.0 / rate * np.array([np.sin(angle), -np.cos(angle)]),
                np.array([np.cos(angle), np.sin(angle)]),
            )
            true = Pose.level(*place, 20.0)
            believed = Pose(true.position + 4.0 * offset * np.append(ahead, 0.0), true.quaternion)
            z = move_to_believed(np.zeros((1, 2)), true, believed)
            scan = Scan(0, 0.2 * k, believed, z, 0.01 * np.eye(2)[None])
            learn(registration, scan, np.zeros((1, 4)), P[None], lambda _, P=P: P[None])
        found.append((offset, registration.errors[6], np.sqrt(registration.covariance[6, 6])))
    for offset, known, deviation in found:
        assert abs(known - offset) < 4 * deviation + abs(offset) ** 3 * rate**2, found  # of third order


def test_measurements_that_a_correction_takes_above_the_horizon_stay():
    registration = make_registration(NAVIGATION["consumer"], "estimate", known=True)
    registration.errors[3:5] = 0.2  # rad; seen from 20 m, these are 4 degrees below the horizon
    points = np.array([[300.0, 0.0], [0.0, 300.0], [-300.0, 0.0], [0.0, -300.0], [1.0, 2.0]])
    found = registration.correct(Scan(0, 0.0, ABOVE, points, np.tile(np.eye(2), (5, 1, 1)))).measurements
    kept = (found == points).all(axis=1)
    assert np.isfinite(found).all() and kept.any() and not kept[-1]


def test_exact_navigation_has_nothing_to_register():
    assert make_registration(Navigation(), "estimate", known=True) is None
    assert make_registration(NAVIGATION["gnss"], "ignore", known=True) is None


def share(seed, uavs=2, scans=51, figures=Navigation(horizontal_drift=1.0, horizontal_noise=0.05)):  # noqa: B008
    """Scans of UAVs that see the same two people, scan by scan, and the true errors of their positions at the end."""
    rng, errors = (
        np.random.default_rng(seed),
        [NavigationErrors(figures, np.random.default_rng([seed, i])) for i in range(uavs)],
    )
    state = [np.array([x, y, *rng.normal(0.0, 1.0, 2)]) for x, y in rng.uniform(-4, 4, (2, 2))]
    initial = [Track(i, Gaussian(s + rng.normal(0.0, 0.5, 4), 0.25 * np.eye(4))) for i, s in enumerate(state)]
    parameters, made = TrackerParameters(MOTION, navigation=figures), []
    for k in range(scans):
        if k:
            for e in errors:
                e.advance(0.2)
            state = [rng.multivariate_normal(MOTION.F @ s, MOTION.Q) for s in state]
        centre, now = np.mean([s[:2] for s in state], axis=0), []
        for i, e in enumerate(errors):
            true = Pose.level(centre[0] + 6.0 * i - 3.0, centre[1], 20.0)
            believed = e.mislead(true)
            z = np.array([s[:2] + 0.3 * rng.standard_normal(2) for s in state])
            now.append(
                Scan(i, 0.2 * k, believed, move_to_believed(z, true, believed), np.tile(0.09 * np.eye(2), (2, 1, 1)))
            )
        made.append(now)
    fleet = [Tracker(i, CAMERA, parameters, initial) for i in range(uavs)]
    return fleet, made, [e._drift[:2] for e in errors]


def test_a_lone_uavs_tracks_err_at_least_as_far_as_its_position_drifts_however_often_people_are_seen():
    """Nobody else shows the error; a person who stands still is as near to the truth as the position is."""
    parameters = TrackerParameters(MOTION, navigation=Navigation(horizontal_drift=1.5, horizontal_noise=0.1))
    subject = Tracker(0, CAMERA, parameters)
    for k in range(40):
        step([subject], [Scan(0, 0.2 * k, ABOVE, np.array([[2.0, 1.0]]), 0.05 * np.eye(2)[None])])
    (told,) = subject.tracks
    spread, own = told.belief.covariance[:2, :2], subject._table.covariances[0, :2, :2]
    assert np.all(np.linalg.eigvalsh(own) < 0.5)
    assert np.all(np.linalg.eigvalsh(spread - own) > 1.5**2) and np.all(np.linalg.eigvalsh(spread) < 2 * 1.5**2)


@pytest.mark.parametrize("missions", [20, pytest.param(60, marks=pytest.mark.slow)])
def test_the_relative_error_of_two_uavs_that_share_tracks_for_ten_seconds_is_known_within_its_deviation(missions):
    found, before = [], []
    for seed in range(missions):
        fleet, scans, errors = share(seed)
        for now in scans:
            step(fleet, now)
        left = [e - t._registration.errors[:2] for e, t in zip(errors, fleet, strict=True)]
        found.append((left[0] - left[1], sum(t._registration.covariance[:2, :2] for t in fleet)))
        before.append(errors[0] - errors[1])
    nees = np.mean([d @ np.linalg.solve(P, d) for d, P in found])
    assert nees < nees_interval(missions, 2)[1], nees  # smaller, as people in both views tell more than is counted
    assert np.sqrt(np.mean([d @ d for d, _ in found])) < 0.2 * np.sqrt(np.mean([d @ d for d in before]))


def test_scans_that_come_late_leave_the_tracks_and_errors_of_scans_in_time():
    fleet, scans, _ = share(0, scans=20)
    log = ScanLog(0, FleetState(fleet), 30)
    in_time = FleetState([tracker.copy() for tracker in fleet])
    for k, (own, other) in enumerate(scans):
        if k >= 4:
            log.add(k - 4, scans[k - 4][1])
        if k == len(scans) - 1:
            for n in range(k - 4, k):
                log.add(n, scans[n][1])
        log.step(0.2 * k, own)
        in_time = in_time.step(0.2 * k, {0: own, 1: other} if k < len(scans) - 1 else {0: own})
    held, expected = log.tracker, in_time.find(0)
    assert held._registration.errors.tobytes() == expected._registration.errors.tobytes() != np.zeros(7).tobytes()
    for a, b in zip(held.tracks, expected.tracks, strict=True):
        np.testing.assert_array_equal(a.belief.covariance, b.belief.covariance)
    assert not fleet[0]._registration.errors.any()  # of the state before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "delay", "missions"), [("consumer", 0.0, 30), ("gnss", 0.0, 30), ("consumer", 1.0, 10)]
)
def test_tracks_of_missions_tell_their_errors(name, delay, missions):
    """Missions of 40 s in a forest, whose tracks have a NEES of 0.9 with exact poses."""
    keys, found = [f"uavs.{i}.navigation={name}" for i in range(3)], []
    for seed in range(8000, 8000 + missions):
        mission, snapshots = fly_ideal(*keys, f"network.delay={delay}", planner="greedy", seed=seed, duration=40)
        recording = recording_of(mission, snapshots, seed=seed)
        found.append(np.mean(np.concatenate([score(recording, i).position_nees for i in range(3)])) / 2)
    assert 0.6 < np.mean(found) < 1.3, np.mean(found)
