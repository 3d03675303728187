"""Registration of two UAVs, judged by the true errors that they do not know."""

import numpy as np
import pytest
from helpers.flights import fly_ideal

from sim.mission.tracker_fleet import TrackerFleet
from sim.scenario.loading import load
from tracking.metrics.nees import nees_interval
from tracking.numerics.distances import squared_distance
from tracking.registration.pose_errors import ERRORS, error_slopes
from tracking.registration.registration import Registration

PAIR = (
    *("uavs=[{start=[-3,0],footprint=50,navigation='gnss'},{start=[3,1],footprint=50,navigation='gnss'}]",),
    *("trees.density=0", "people.count=1", "people.paths=[[[-4,-4],[4,-4],[4,4],[-4,4],[-4,-4]]]"),
)
MISSIONS = 40


def true_errors(mission):
    """The lasting errors (14,) of both UAVs."""
    return np.concatenate([np.append(errors._biases + errors._drift, errors.clock) for errors in mission._errors])


@pytest.fixture(scope="module")
def flown():
    """Of each mission of 10 s: the last snapshot, the registration of UAV 0, and the true errors."""
    found = []
    for seed in range(MISSIONS):
        kept = []

        def see(mission, kept=kept):
            kept[:] = [mission._knowledge.trackers._registration.of_uavs[0], true_errors(mission)]

        _, snapshots = fly_ideal(*PAIR, seed=seed, duration=10, see=see)
        found.append((snapshots[-1], *kept))
    return found


def mean_within(values, dof, *, wider=1.0):
    low, high = nees_interval(len(values), dof)
    return dof - wider * (dof - low) <= np.mean(values) <= dof + wider * (high - dof)


def test_the_relative_bias_of_uavs_that_share_a_track_is_known_within_its_deviation(flown):
    found, before, after = [], [], []
    for snapshot, registration, errors in flown:
        one, other = (error_slopes(snapshot.people, pose, np.zeros(2))[0] for pose in snapshot.believed)
        H = np.hstack([one, -other])
        relative = H @ registration.covariance @ H.T
        found.append(squared_distance(H @ (errors - registration.errors), relative))
        before.append(np.linalg.norm(H @ errors))
        after.append(np.linalg.norm(H @ (errors - registration.errors)))
    assert mean_within(found, 2, wider=1.3), np.mean(found)
    assert np.mean(after) < 0.15 * np.mean(before)


def test_tracks_tell_their_whole_errors(flown):
    found = []
    for snapshot, *_ in flown:
        errors = [track.belief.mean[:2] - snapshot.people[0] for track in snapshot.tracks[0]]
        best = int(np.argmin([np.hypot(*error) for error in errors]))
        found.append(squared_distance(errors[best], snapshot.tracks[0][best].belief.covariance[:2, :2]))
    assert mean_within(found, 2, wider=1.3), np.mean(found)


def test_exact_navigation_has_no_registration():
    setting = load("forest")
    assert TrackerFleet(setting, None, [])._registration is None


def test_without_learning_scans_keep_their_places_and_tracks_their_covariances():
    mission, snapshots = fly_ideal(*PAIR, "tracking.pose_errors=inflate", duration=0.4)
    fleet = mission._knowledge.trackers
    registration, scan = fleet._registration.of_uavs[0], snapshots[-1].scans[0]
    corrected = registration.correct(scan)
    np.testing.assert_array_equal(corrected.measurements, scan.measurements)
    assert (np.linalg.eigvalsh(corrected.covariances - scan.covariances) > 1.0).all()  # m², of a drift of 1.5 m
    assert fleet.tracks(0) == fleet[0].tracks


def test_errors_return_to_their_prior_without_measurements():
    setting = load("forest", PAIR)
    registration = Registration([uav.navigation_errors for uav in setting.uavs], [], 10.0)
    prior = registration.covariance.copy()
    registration.errors[:] = 1.0
    registration.covariance *= 0.01
    registration.observe(1e5, {}, [], None)
    assert registration.errors[0] == pytest.approx(0.0, abs=1e-9) and registration.errors[6] == 1.0
    for drift in (0, 1, 2, ERRORS):
        assert registration.covariance[drift, drift] == pytest.approx(prior[drift, drift], rel=1e-6)
