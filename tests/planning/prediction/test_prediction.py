"""Planners predict people exactly as trackers let beliefs coast: scan by scan."""

import dataclasses

import numpy as np
import pytest
from helpers.nominal import nominal, team_cost
from helpers.teams import Spy, planned, refitted

from planning.composed import Composed
from planning.prediction.propagation import MonteCarlo, Nominal
from sim.mission.mission import Mission
from sim.mission.tracker_setup import make_planned_motion, make_tracker_parameters
from sim.scenario.loading import load_scenario
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.geometry.camera import Camera
from tracking.tracker import Tracker


def coasting(tracks, scenario, seconds):
    """Means (T, 4) and covariances (T, 4, 4) of a tracker of the scenario without detections for so long."""
    tracker = Tracker(0, Camera(1.0, 64), make_tracker_parameters(scenario), tracks)
    for k in range(seconds * scenario.rates.sensing + 1):
        tracker.coast(k / scenario.rates.sensing)
    return (np.array([t.belief.mean for t in tracker.tracks]), np.array([t.belief.covariance for t in tracker.tracks]))


@pytest.mark.parametrize(
    "settings", [[], ["rates.sensing=10"], ["tracking.sigma_a=1.0", "rates.planning=5"], ["tracking.motion=ncv"]]
)
@pytest.mark.parametrize("seconds", [1, 5, 10])
def test_planners_predict_as_trackers_coast(random_team, settings, seconds):
    """Mean, covariance, the points of expected visibility and the cost of plans without a target in view."""
    scenario = load_scenario("forest", settings)
    motion = make_planned_motion(scenario)
    team = [dataclasses.replace(s, motion=motion) for s in random_team(3)]
    situation = team[0]
    means, covariances = coasting(situation.tracks, scenario, seconds)
    steps = seconds * scenario.rates.planning
    beliefs = [t.belief for t in situation.tracks]
    ahead = np.array([b.mean for b in beliefs]), np.array([b.covariance for b in beliefs])
    for _ in range(steps):
        ahead = motion.predict_all(*ahead)
    np.testing.assert_allclose(ahead[0], means, rtol=1e-12)
    np.testing.assert_allclose(ahead[1], covariances, rtol=1e-12, atol=1e-13)
    points = Nominal(expected=True).predict(situation, steps, np.random.default_rng(0)).points[-1, :, :, :2]
    np.testing.assert_allclose(points[:, 0], means[:, :2], rtol=1e-12)
    np.testing.assert_allclose(points.mean(axis=1), means[:, :2], rtol=1e-9)
    blind = refitted(team, lambda v: dataclasses.replace(v, position=v.position + np.array([9e3, 0.0, 0.0])))[0]
    rest = team_cost(nominal(blind, steps), np.zeros((3, steps, 2)), 0.0)
    if steps > 1:
        rest -= team_cost(nominal(blind, steps - 1), np.zeros((3, steps - 1, 2)), 0.0)
    assert rest == pytest.approx(np.trace(covariances[:, :2, :2], axis1=1, axis2=2).sum(), rel=1e-9)


def test_a_mission_tells_planners_how_its_trackers_predict():
    scenario = load_scenario("forest", ["duration=1", "sensing.mode=ideal", "dynamics=kinematic", "trees.density=0"])
    planner = Spy()
    list(Mission(scenario, planner, 0).fly())
    assert make_tracker_parameters(scenario).motion == MeanRevertingVelocity(0.2, 0.75, walking_speed=1.75)
    first = planner.teams[0][0]  # after the first scan, at which all tracks that are given count as seen
    seen = np.array([track.belief.mean[2:] for track in first.tracks])
    assert first.motion == MeanRevertingVelocity(1.0, 0.75, walking_speed=1.75, scans=5).learn(seen)
    assert planner.teams[-1][0].motion.learned_in > first.motion.learned_in
    plain = load_scenario("forest", ["tracking.motion=ncv", "tracking.sigma_a=0.5"])
    assert make_planned_motion(plain) == NearlyConstantVelocity(1.0, 0.5, scans=5)
    assert make_planned_motion(load_scenario("forest", ["tracking.motion=mymodels:Standing"])).transition == (1.0, 1.0)


@pytest.mark.parametrize("motion", ["ncv", "mean-reverting"])
def test_monte_carlo_trajectories_spread_as_trackers_coast(random_team, motion):
    scenario = load_scenario("forest", [f"tracking.motion={motion}"])
    situation = dataclasses.replace(random_team(2, targets=1)[0], motion=make_planned_motion(scenario))
    points = MonteCarlo(40_000).predict(situation, 5, np.random.default_rng(0)).points[:, :, 0, :2]
    for seconds in (1, 5):
        means, covariances = coasting(situation.tracks, scenario, seconds)
        spread = np.sqrt(np.trace(covariances[0, :2, :2]))
        np.testing.assert_allclose(points[seconds - 1].mean(axis=0), means[0, :2], atol=4 * spread / 200)
        np.testing.assert_allclose(np.cov(points[seconds - 1].T), covariances[0, :2, :2], atol=0.03 * spread**2)
    # From step to step, too: how a trajectory goes on depends on the velocity that it has come to.
    ways = np.diff(points[:, :, 0], axis=0)
    F, Q = situation.motion.F, situation.motion.Q
    later = F @ situation.tracks[0].belief.covariance @ F.T + Q
    expected = F[0, 2] * (F[2, 2] * F[0, 2] * later[2, 2] + Q[0, 2])  # covariance of the second and the third way
    assert np.cov(ways[0], ways[1])[0, 1] == pytest.approx(expected, rel=0.05)


def test_prediction_by_one_step_is_an_option(random_team):
    team = random_team(1)
    single = [dataclasses.replace(s, motion=NearlyConstantVelocity(1.0, 0.5)) for s in team]
    for name in ("sma-nbo-mwtp(evaluations=256", "mcr(samples=5, evaluations=256"):
        option = planned(f"{name}, prediction=step)", team)
        np.testing.assert_array_equal(option, planned(f"{name})", single))
        assert not np.array_equal(option, planned(f"{name})", team))
    assert Composed().prediction == "scans"
