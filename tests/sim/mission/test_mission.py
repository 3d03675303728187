"""Missions fly in every variant, whatever a planner does, and only what should change them does."""

import itertools

import numpy as np
import pytest
from helpers.clients import open_clients
from helpers.flights import IDEAL, fly, fly_ideal, mission_of, recording_of
from helpers.teams import Spy

from planning.planner import Plan
from planning.planner_loading import load_planner
from sim.mission.archive import load_recording
from sim.mission.mission import Mission
from sim.mission.tracker_setup import make_initial_tracks
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from tracking.errors import InputError

CROWD = "t,id,x,y\n" + "".join(
    f"{t},{name},{-28 + 1.5 * t},{y}\n"
    for name, y, first, last in (("early", -14, 0, 1), ("whole", 0, 0, 3), ("late", 14, 1, 3))
    for t in range(first, last + 1)
)
OPEN = "trees.density=0"


def test_a_mission_has_scans_and_plans_in_time_and_closes_its_world():
    mission, snapshots = fly(duration=2.3)
    np.testing.assert_allclose([s.time for s in snapshots], np.arange(12) / 5)
    assert [s.time for s in snapshots if s.plans] == [0.0, 1.0, 2.0] and mission.faults == []
    mission = Mission(load_scenario("forest", ["sensing.mode=ideal"]), load_planner("hover"), 0)
    flight = mission.fly()
    next(flight)
    flight.close()
    assert list(flight) == []


class Raising:
    """A detector, a tracker or a sensor mode that cannot be made."""

    def __init__(self, *given):
        raise ValueError("no weights")


@pytest.mark.parametrize("part", ["sensing.detector", "sensing.mode", "tracking.tracker"])
def test_a_mission_that_cannot_be_set_up_leaves_no_world(part):
    before = open_clients()
    with pytest.raises(InputError, match=f"{part}: '{__name__}:Raising' cannot be made: ValueError: no weights"):
        fly(f"{part}={__name__}:Raising")
    assert open_clients() == before


@pytest.mark.parametrize(
    "overrides",
    [
        ["dynamics=kinematic"],
        ["sensing.mode=ideal"],
        ["sensing.noise=camera"],
        ["sensing.occlusion=disc"],
        ["tracking.initial_tracks=none"],
        ["network.rounds=0"],
        ["rates.planning=5"],
        ["uavs=[{start=[-28, 0]}]"],
        *([f"uavs.{i}.mount=body" for i in range(3)],),
    ],
    ids=" ".join,
)
def test_every_variant_flies_without_fault(overrides):
    mission, snapshots = fly(*overrides, planner="sma-nbo-mwtp(evaluations=64)")
    assert len(snapshots) == 6 and mission.faults == [] and all(np.all(np.isfinite(s.ospa)) for s in snapshots)


class Noting:
    """Notes the steps of time that it plans with."""

    def __init__(self):
        self.noted = []

    def plan(self, team, rng):
        self.noted += [(s.time, s.step, s.motion.dt) for s in team]
        return [Plan(np.tile([1.0, 0.0], (2, 1))) for _ in team]


def test_decisions_may_be_further_apart_than_a_second():
    planner = Noting()
    mission, snapshots = fly(
        "dynamics=kinematic", "sensing.mode=ideal", "rates.planning=0.5", planner=planner, duration=5
    )
    assert planner.noted == [(time, 2.0, 2.0) for time in (0.0, 2.0, 4.0) for _ in range(3)]
    assert [s.time for s in snapshots if s.plans] == [0.0, 2.0, 4.0]
    np.testing.assert_allclose(snapshots[-1].poses[0].position[0] - snapshots[0].poses[0].position[0], 5.0)
    recording = recording_of(mission, snapshots)
    assert recording.times[-1] == 5.0 and mission.faults == []


def test_without_people_there_are_no_detections_and_no_tracks():
    mission, snapshots = fly("people.count=0", planner="sma-nbo-mwtp(evaluations=64)")
    assert mission.faults == []
    for s in snapshots:
        assert s.people.shape == (0, 2) and s.visible.shape == (3, 0)
        assert [len(scan.measurements) for scan in s.scans] == [0, 0, 0] and s.tracks == [(), (), ()]
        np.testing.assert_array_equal(s.ospa, 0.0)


def test_people_of_a_file_appear_and_leave_with_no_trunk_in_the_way(tmp_path):
    (tmp_path / "crowd.csv").write_text(CROWD)
    (tmp_path / "crowd.toml").write_text('duration = 3.0\n[people]\ntrajectories = "crowd.csv"\n[trees]\ndensity = 0\n')
    snapshots = list(mission_of(load_scenario(str(tmp_path / "crowd.toml")), "hover", 0).fly())
    present = np.array([~np.isnan(s.people[:, 0]) for s in snapshots])
    time = np.array([s.time for s in snapshots])
    np.testing.assert_array_equal(present, np.column_stack([time <= 1, time >= 0, time >= 1]))
    # UAV 0 hovers over the first of them and sees them as long as they are there; the last one is found.
    assert [int(s.visible[0, 0] > 0) for s in snapshots] == [int(t <= 1) for t in time]
    assert any(s.matched[:, 2].any() for s in snapshots) and len(snapshots[-1].tracks[2]) >= 1
    path = tmp_path / "walk.csv"
    rows = [f"{t},{y},{-70 + 14 * t},{y}" for t in range(11) for y in range(-48, 49, 6)]
    path.write_text("t,id,x,y\n" + "\n".join(rows))
    mission = mission_of(load_scenario("forest", [f"people.trajectories={path}", "duration=10"]), "hover", 0)
    trunks = np.array([(t.x, t.y) for t in mission.forest.trees])
    gaps = np.linalg.norm(mission.people.positions[:, :, None] - trunks, axis=3)
    assert gaps.min() > 0.2 + 0.5 - 0.12  # the path is kept clear where it is sampled, 0.23 m apart


def test_another_planner_meets_the_same_people_and_another_seed_others():
    (one, first), (two, second) = (fly(planner=planner, seed=3) for planner in ("greedy", "hover"))
    assert one.forest.trees == two.forest.trees
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.people, b.people)
        np.testing.assert_array_equal(a.headings, b.headings)
    assert not np.array_equal(first[-1].poses[0].position, second[-1].poses[0].position)
    (one, first), (two, second) = (fly(seed=seed) for seed in (0, 1))
    assert one.forest.trees != two.forest.trees and not np.array_equal(first[0].people, second[0].people)


class Faulty:
    """Flies east and goes wrong once a second, each time in another way."""

    def __init__(self):
        self.calls = itertools.count()

    def plan(self, team, rng):
        east = [Plan(np.tile([3.0, 0.0], (3, 1))) for _ in team]
        match next(self.calls):
            case 1:
                raise RuntimeError("lost")
            case 2:
                return [Plan(np.full((1, 2), np.nan)), *east[1:]]
            case 3:
                return [*east[:2], Plan(np.array([[30.0, 40.0]]))]
            case 4:
                return east[:1]
        return east


def test_a_planner_that_fails_does_not_end_the_mission():
    mission, snapshots = fly("sensing.mode=ideal", planner=Faulty(), duration=5)
    assert [(f.time, f.uav) for f in mission.faults] == [(1.0, None), (2.0, 0), (3.0, 2), (4.0, None)]
    for fault, words in zip(mission.faults, ("lost", "finite", "clipped", "1 plans for 3"), strict=True):
        assert words in fault.message
    assert [(s.time, *s.faults) for s in snapshots if s.faults] == [(fault.time, fault) for fault in mission.faults]
    plans = {s.time: [plan.controls for plan in s.plans] for s in snapshots if s.plans}
    np.testing.assert_array_equal(plans[1.0][0], np.tile([3.0, 0.0], (2, 1)))  # the rest of the last intent
    np.testing.assert_array_equal(plans[2.0][0], [[3.0, 0.0]])
    np.testing.assert_allclose(plans[3.0][2], [[3.0, 4.0]])  # shortened to the limit of 5 m/s
    np.testing.assert_array_equal(plans[4.0][2], [[0.0, 0.0]])  # nothing is left of the intent: hover
    assert len(snapshots) == 26


def test_known_at_the_start_is_who_is_there_at_both_of_the_first_scans():
    here, there = np.array([[0.0, 0], [1, 1], [np.nan, np.nan]]), np.array([[0.2, 0], [np.nan, np.nan], [3, 3]])
    (track,) = make_initial_tracks(load_scenario("forest"), here, there)
    assert track.id == 0 and track.belief.mean.tolist() == [0.0, 0.0, 1.0, 0.0]


def test_known_tracks_start_on_all_people_and_unknown_ones_soon():
    _, known = fly("trees.density=0")
    assert [len(held) for held in known[0].tracks] == [4, 4, 4]
    _, unknown = fly("trees.density=0", "tracking.initial_tracks=none", seed=3)
    assert [len(held) for held in unknown[0].tracks] == [0, 0, 0] and np.all(np.any(unknown[0].visible, axis=0))
    assert [len(held) for held in unknown[2].tracks] == [4, 4, 4] and np.all(unknown[-1].ospa[:, 0] < 1.0)
    _, snapshots = fly(duration=0.1)
    assert [[len(held) for held in s.tracks] for s in snapshots] == [[4, 4, 4]]


def test_a_uav_knows_only_the_neighbours_it_hears_and_their_intents():
    """Three in a row, 30 m apart, that reach 40 m: the middle one hears both, the outer ones only the middle one."""
    starts = [f"{{start=[{x}, 0], footprint={edge}}}" for x, edge in ((-30, 20), (0, 25), (30, 22))]
    planner = Spy(lambda situation: np.zeros((2, 2)))
    fly(f"uavs=[{','.join(starts)}]", "network.range=40", "trees.density=0", planner=planner)
    heard = [[([v.id for v in s.neighbours], sorted(s.intents)) for s in team] for team in planner.teams]
    neighbours = [[1], [0, 2], [1]]
    assert heard[0] == [(n, []) for n in neighbours]
    assert heard[1] == [(n, sorted([i, *n])) for i, n in enumerate(neighbours)]


@pytest.mark.parametrize(("first", "asked"), [(0, [0, 1, 2, 3, 4]), (1, [1, 2, 3, 4]), (3, [3, 4]), (4, [4])])
def test_uavs_hover_until_the_first_decision(first, asked):
    planner = Spy(lambda situation: [[2.0, 0.0]])
    _, snapshots = fly_ideal(OPEN, f"first_decision={first}", planner=planner)
    assert [team[0].time for team in planner.teams] == asked
    starts = np.array([uav.start for uav in Scenario().uavs])
    for snapshot in snapshots:
        moved = np.array([pose.position[:2] for pose in snapshot.poses]) - starts
        np.testing.assert_allclose(moved, [[2.0 * max(0.0, snapshot.time - first), 0.0]] * 3, atol=1e-9)
        assert (snapshot.plans is not None) == (snapshot.time in asked)
        assert np.all(snapshot.plan_bytes == 0) or snapshot.time in asked
    assert all(scan.measurements.size for scan in snapshots[0].scans)


def test_missions_that_hover_at_first_sense_the_same_and_are_shown(tmp_path, without_pictures):
    """Hovering draws nothing: until the first decision a mission is that of a planner that hovers."""
    unknown = (OPEN, "first_decision=2", "tracking.initial_tracks=none")
    _, later = fly_ideal(*unknown, planner="sma-nbo(evaluations=64)", seed=3)
    _, still = fly_ideal(*unknown, seed=3)
    for one, other in zip(later[:11], still, strict=False):
        assert np.array_equal(one.ospa, other.ospa)
        assert [len(t) for t in one.tracks] == [len(t) for t in other.tracks]
    assert len(later[3].tracks[0]) == 4 and Scenario().first_decision == 0.0
    scenario = load_scenario("forest", [*IDEAL, OPEN, "duration=4", "first_decision=2"])
    run_mission(Trial(scenario, "greedy", 0), tmp_path / "out")
    recording = load_recording(tmp_path / "out" / "mission.npz")
    np.testing.assert_array_equal(recording.plan_times, [2.0, 3.0, 4.0])
    assert recording.plans_at(0) is None
    for name in ("mission.html", "mission.mp4", "timeline.png", "summary.json"):
        assert (tmp_path / "out" / name).is_file()
