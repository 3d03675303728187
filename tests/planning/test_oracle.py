"""The oracle alone sees the truth, and its results are marked."""

import dataclasses
import itertools
import json
import pickle
import struct

import numpy as np
from helpers.flights import mission_of
from helpers.studies import task_of
from helpers.teams import Spy

from planning.catalogue import PLANNERS
from planning.objective.nbo import make_objective
from planning.oracle import _UNKNOWN, FoundOracle, _TruePaths, correct_tracks, make_true_tracks
from planning.planner_loading import load_planner
from planning.prediction.propagation import Nominal
from sim.facts.metrics.summary import make_results_table
from sim.mission.archive import load_recording
from sim.mission.mission import Mission
from sim.mission.trial import Trial
from sim.running import pictures
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.study.analysis.labels import find_baseline
from sim.study.report.comparison import About
from sim.study.report.terminal import show
from sim.study.trial_flight import fly_trial
from sim.terminal.console import console
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.geometry.person import TARGET_HEIGHT
from tracking.track import Track

SHORT = ("duration=1", "sensing.mode=ideal", "dynamics=kinematic")
MARK = "sees the truth"


def test_situations_hold_no_truth_even_when_an_oracle_flies():
    """No number of a person's true position, now or at the next steps, is anywhere in what the mission makes."""

    class Seer(Spy):
        def knowing(self, people):
            self.people = people
            return self

    spy = Seer()
    mission = Mission(load_scenario("forest", [*SHORT, "duration=4", "tracking.initial_tracks=none"]), spy, 0)
    snapshots = list(mission.fly())
    assert mission.sees_truth and len(spy.teams) == 5 and len(snapshots[-1].tracks[0])
    for k, team in enumerate(map(pickle.dumps, spy.teams)):
        for ahead in range(3):
            truth = spy.people(float(k + ahead))  # after the end as at the end
            np.testing.assert_array_equal(truth, mission.people.at(float(min(k + ahead, 4)))[0])
            assert truth.shape == (4, 2)
            assert not any(struct.pack("<d", x) in team for x in truth.ravel().tolist())
        held = snapshots[5 * k].tracks[0]
        assert all(struct.pack("<d", t.belief.mean[0]) in team for t in held)  # as one that is there would be found
    for name, spec in PLANNERS.items():
        assert hasattr(load_planner(name), "knowing") == spec.upper_bound, name
    assert not mission_of(load_scenario("forest", [*SHORT]), "sma-nbo-mwtp", 0).sees_truth


def test_a_persons_second_moment_is_of_the_track_at_the_least_total_distance(random_team):
    situation = random_team(1)[0]
    means = np.array([t.belief.mean for t in situation.tracks])

    def people(time):  # the third has no track, the fifth is not there
        here = np.vstack([means[[1, 0], :2] + [3.0, -4.0], [[500.0, 0.0]], means[[2], :2], [[np.nan, np.nan]]])
        return here + 2.0 * time

    situation = dataclasses.replace(situation, tracks=situation.tracks[:3])
    found = make_true_tracks(situation, people, 0)
    assert [t.id for t in found] == [0, 1, 2, 3]
    for person, track, error in ((0, 1, (3.0, -4.0)), (1, 0, (3.0, -4.0)), (3, 2, (0.0, 0.0))):
        truth = np.concatenate([people(0.0)[person], [2.0, 2.0]])
        np.testing.assert_allclose(found[person].belief.mean, truth, atol=1e-12)
        moment = situation.tracks[track].belief.covariance + np.outer((*error, 0.0, 0.0), (*error, 0.0, 0.0))
        np.testing.assert_allclose(found[person].belief.covariance, moment, rtol=1e-12)
    np.testing.assert_array_equal(found[2].belief.covariance, _UNKNOWN)


def test_tracks_are_assigned_by_place_alone_and_velocities_are_per_second(random_team):
    """Two people who walk as the track at the other's place does; steps of half a second."""
    means = np.array([[0.0, 0.0, 40.0, 0.0], [10.0, 0.0, -40.0, 0.0]])
    tracks = tuple(Track(k, Gaussian(mean, (k + 1.0) * np.eye(4))) for k, mean in enumerate(means))
    situation = dataclasses.replace(random_team(0)[0], tracks=tracks, motion=NearlyConstantVelocity(0.5, 1.0))
    found = make_true_tracks(situation, lambda time: means[::-1, :2] + time * means[:, 2:], 0)
    for person, track in ((0, 1), (1, 0)):
        np.testing.assert_array_equal(found[person].belief.covariance, tracks[track].belief.covariance)
        np.testing.assert_allclose(found[person].belief.mean, [*means[track, :2], *means[person, 2:]], atol=1e-12)


def test_the_oracle_plans_along_true_paths_which_end_where_a_person_leaves(random_team):
    situation = dataclasses.replace(random_team(0)[0], time=3.0)
    circle = lambda t: np.array([[10 * np.cos(t), 10 * np.sin(t)], [t, 1.0] if t < 5.5 else [np.nan] * 2])  # noqa: E731
    situation = dataclasses.replace(situation, tracks=make_true_tracks(situation, circle, 4))
    view = _TruePaths(circle).predict(situation, 4, np.random.default_rng(0))
    np.testing.assert_array_equal(view.points[:, 0, 0, :2], [circle(3.0 + k)[0] for k in range(1, 5)])
    np.testing.assert_array_equal(view.points[:, 1, 0, :2], [[4, 1], [5, 1], [5, 1], [5, 1]])
    np.testing.assert_array_equal(view.points[..., 2], TARGET_HEIGHT)
    believed = Nominal().predict(situation, 4, np.random.default_rng(0))
    np.testing.assert_array_equal(view.covariances, believed.covariances)
    about = view.points[..., :2] - view.points[:, :, :1, :2]  # five places, 0.5 m about the true one along each axis
    np.testing.assert_allclose(about.mean(axis=2), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        np.swapaxes(about, -1, -2) @ about / 5, np.broadcast_to(0.25 * np.eye(2), (4, 2, 2, 2)), atol=1e-9
    )


def test_the_oracle_foresees_people_that_appear_and_leave(random_team):
    """A person 14 m east of a UAV whose image is 20 m wide, that appears or leaves at some step."""
    (situation,) = random_team(0, uavs=1, targets=0, trees=0)
    place, oracle = situation.own.position[:2] + np.array([14.0, 0.0]), load_planner("oracle")
    for first, last in itertools.product(range(7), range(7)):
        people = lambda t: np.array([place if first <= round(t) <= last else [np.nan] * 2])  # noqa: B023, E731
        (plan,) = oracle.knowing(people).plan([situation], np.random.default_rng(0))
        known = dataclasses.replace(situation, tracks=make_true_tracks(situation, people, 5))
        assert len(known.tracks) == (first <= min(last, 5))
        belief = _TruePaths(people).predict(known, 5, np.random.default_rng(0))
        values = make_objective(belief, np.zeros((1, 5, 2)), [0], 0.0)(
            np.array([np.zeros((1, 5, 2)), plan.controls[None]])
        )
        in_time = len(known.tracks) > 0 and max(first, 1) <= last  # at some step of the horizon the person is there
        assert (values[1] < 0.9 * values[0]) == in_time and np.isfinite(values).all()


def test_an_oracle_of_the_people_found_corrects_their_tracks_and_keeps_all_others(random_team):
    """Person 0 has a wrong track, 1 none, 2 is unknown, 3 absent; the nearest track to 2 is nobody's."""
    situation = random_team(1)[0]
    first = situation.tracks[0]
    far = Gaussian(first.belief.mean + np.array([60.0, 0.0, 0.0, 0.0]), np.eye(4))
    other = dataclasses.replace(first, id=5, belief=far, existence=0.7)
    turn = 0.25  # s after now, at which person 0 turns back
    wrong, unknown = first.belief.mean[:2] + np.array([6.0, -8.0]), other.belief.mean[:2]
    here = np.array([wrong, [300.0, 0.0], unknown, [np.nan] * 2])

    def people(time):
        step = time - situation.time
        return here + np.array([[2.0, 1.0]]) * min(step, 2 * turn - step)

    found = correct_tracks(dataclasses.replace(situation, tracks=(other, first)), people, {0, 1, 3})
    assert [track.id for track in found] == [0, 1, 2]
    np.testing.assert_allclose(found[0].belief.mean, [*here[0], 2.0, 1.0], atol=1e-9)
    moment = first.belief.covariance + np.outer([6.0, -8.0, 0.0, 0.0], [6.0, -8.0, 0.0, 0.0])
    np.testing.assert_allclose(found[0].belief.covariance, moment, rtol=1e-12)
    np.testing.assert_array_equal(found[1].belief.covariance, _UNKNOWN)
    assert found[2].belief is far and found[2].existence == 0.7
    assert [t.belief for t in correct_tracks(situation, people, set())] == [t.belief for t in situation.tracks]


def test_a_person_counts_as_found_from_the_first_track_of_any_uav_within_a_metre(random_team):
    team = random_team(2, uavs=2)
    places = np.array([track.belief.mean[:2] for track in team[0].tracks])
    planner = FoundOracle(evaluations=64).knowing(lambda time: places + np.array([0.8, 0.0]))
    nothing = [dataclasses.replace(s, tracks=()) for s in team]
    planner.plan(nothing, np.random.default_rng(0))
    assert planner.found == set()
    one = [nothing[0], dataclasses.replace(team[1], tracks=team[1].tracks[1:2])]
    planner.plan(one, np.random.default_rng(0))
    planner.plan(nothing, np.random.default_rng(0))
    assert planner.found == {1}
    planner.reset(0)
    assert planner.found == set()
    planner = FoundOracle(evaluations=64).knowing(lambda time: places + np.array([1.2, 0.0]))
    planner.plan([dataclasses.replace(s, tracks=s.tracks[:1]) for s in team], np.random.default_rng(0))
    assert planner.found == set()


def test_an_oracle_of_the_people_found_goes_to_those_it_lost_and_to_nobody_else():
    """All tracks are wrong by 30 m, in the open: UAVs go to where people are who were found, and to no others."""

    class Lost(FoundOracle):
        known = (0, 1, 2, 3)

        def knowing(self, people):
            planner = super().knowing(lambda time: people(time) + np.array([30.0, 0.0]))
            planner.found, planner.reset = set(self.known), lambda seed: None
            return planner

    class Unaware(Lost):
        known = ()

    setting = load_scenario("forest", [*SHORT, "duration=6", "trees.density=0"])
    shift = []
    for planner in (Lost, Unaware):
        poses = list(Mission(setting, planner(cutoff=10.0, beta=0.0), 0).fly())[-1].poses
        shift.append(np.mean([pose.position[0] for pose in poses]))
    assert shift[0] > shift[1] + 10.0


def test_whatever_an_oracle_comes_to_is_marked(tmp_path, monkeypatch, without_pictures):
    titles = []

    class Film(pictures.Film):
        def __init__(self, *arguments, planner, **options):
            titles.append(planner)
            super().__init__(*arguments, planner=planner, **options)

    monkeypatch.setattr(pictures, "Film", Film)
    setting = load_scenario("forest", [*SHORT])
    for name in ("oracle(evaluations=64)", "hover"):
        summary = run_mission(Trial(setting, name, 0), tmp_path / name)
        seen = name != "hover"
        assert json.loads((tmp_path / name / "summary.json").read_text())["sees_truth"] is seen
        recording = load_recording(tmp_path / name / "mission.npz")
        assert recording.sees_truth is seen and recording.planner == name
        assert (MARK in make_results_table(summary).title) == (MARK in titles[-1]) == seen
    rows = [fly_trial(task_of(setting, name, 0)).row for name in ("oracle(evaluations=64)", "hover")]
    with console.capture() as capture:
        show(rows, About("tried"))
    shown = " ".join(capture.get().split())
    assert [row.metrics["sees_truth"] for row in rows] == [1, 0] and "upper bound" in shown
    assert find_baseline(rows, "oracle") == "oracle(evaluations=64), upper bound"
    assert find_baseline(rows, "hover") == "hover" and PLANNERS["oracle"].upper_bound


def test_the_oracles_fly_with_maps_that_are_known_to_err():
    for key in ("believed.tree_deviation=0.5", "believed.trees_unknown=0.2"):
        for name in ("oracle(evaluations=64)", "oracle-found(evaluations=64)"):
            mission = Mission(load_scenario("forest", [*SHORT, "duration=2", key]), load_planner(name), 0)
            list(mission.fly())
            assert not mission.faults, (key, name, mission.faults)
