"""Missions flown from outside: the same bytes as by their planner, branches, and what is refused."""

import copy
import pickle

import numpy as np
import pytest
from helpers.flights import fly, recording_of
from helpers.teams import Spy

from planning.planner import Plan
from planning.planner_loading import load_planner
from sim.mission import snapshot
from sim.mission.archive import compute_digest
from sim.mission.mission import Mission
from sim.mission.plan_check import copy_situation
from sim.running.fly import record
from sim.scenario.loading import load_scenario
from tracking.detection.noise import NoiseModel
from tracking.errors import InputError
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import Forest

FLIGHTS = [
    ("sma-nbo(evaluations=64, horizon=3)", ["network.loss=0.2"]),
    ("dec-pomdp(evaluations=64, horizon=3)", ["sensing.mode=ideal", "dynamics=kinematic", "uavs.1.fails_at=1.5"]),
    ("greedy", ["sensing.mode=ideal", "tracking.initial_tracks=none", "first_decision=1", "network.plan_delay=0.4"]),
    ("lawnmower", ["wind.gust=1.5", "uavs.0.mount=body", "rates.planning=5", "appearance.randomise=true"]),
]


def hash_of(mission, snapshots, **named):
    return compute_digest(recording_of(mission, snapshots, **named))


def stepped(mission, planner):
    """Snapshots of a mission flown by a planner from outside, which asks for what UAVs know at each scan."""
    while not mission.over:
        team = mission.team
        yield mission.step(planner.plan(team, mission.rng) if team else None)


@pytest.mark.parametrize(("name", "overrides"), FLIGHTS, ids=[name for name, _ in FLIGHTS])
def test_a_mission_stepped_with_a_planners_plans_has_its_bytes(name, overrides):
    flown = hash_of(*fly(*overrides, planner=name, duration=3, seed=2))
    mission = Mission(load_scenario("forest", ["duration=3", *overrides]), load_planner(name), 2)
    assert hash_of(mission, list(stepped(mission, mission.planner))) == flown


def test_velocities_fly_as_plans_of_one_step_do():
    _, planned = fly("sensing.mode=ideal", planner=Spy(lambda s: [[1.0 + s.own.id, 0.0]]), duration=2)
    with Mission(load_scenario("forest", ["duration=2", "sensing.mode=ideal"])) as mission:
        given = []
        while not mission.over:
            velocities = np.array([[1.0 + situation.own.id, 0.0] for situation in mission.team]).reshape(-1, 2)
            given.append(mission.step(velocities))
    for one, other in zip(given, planned, strict=True):
        np.testing.assert_array_equal([p.position for p in one.poses], [p.position for p in other.poses])
        assert len(one.plans or ()) == len(other.plans or ())
    assert mission.over and mission.team == [] and mission.time == 2.0 and not mission.sees_truth


def test_a_mission_stepped_from_outside_is_recorded_with_its_chance():
    mission = Mission(load_scenario("forest", ["duration=1", "sensing.mode=ideal"]), seed=3, repeat=2)
    flight = record(mission, [mission.step(np.zeros((len(mission.team), 2))) for _ in range(4)], "eastward")
    recording = flight.recording
    assert (recording.planner, recording.seed, recording.repeat, recording.interrupted) == ("eastward", 3, 2, True)
    _, hovering = fly("sensing.mode=ideal", seed=3, repeat=2)
    np.testing.assert_array_equal(recording.ospa, [snapshot.ospa for snapshot in hovering[:4]])


def test_what_uavs_know_is_theirs_to_change():
    """By the planner of a mission, and from outside."""

    def spoil(situation):
        situation.forest.blockers[:] = situation.own.position[:] = 0.0
        for track in situation.tracks:
            track.belief.mean[:] = 0.0
        return np.zeros((1, 2))

    setting = load_scenario("forest", ["duration=2", "sensing.mode=ideal"])
    still, spoiling, spoilt = (Mission(setting, planner, 0) for planner in (Spy(), Spy(spoil), Spy()))
    while not still.over:
        for situation in spoilt.team:
            spoil(situation)
        expected = still.step()
        for found in (spoiling.step(), spoilt.step()):
            for name in ("ospa", "people", "poses", "scans", "tracks"):
                assert pickle.dumps(getattr(found, name)) == pickle.dumps(getattr(expected, name)), name


EACH = "expected a plan or a velocity (2,) for each of 3 UAVs"
REFUSED = {
    "plans: none are given, and the mission has no planner; expected 3 plans": None,
    f"plans: 2 plans for 3 UAVs; {EACH}": np.zeros((2, 2)),
    "plans: of UAV 0: velocity components of shape (3,), not (2,)": np.zeros((3, 3)),
    "plans: of UAV 1: velocity components are not finite": [[0.0, 0.0], [0.0, np.nan], [0.0, 0.0]],
    "plans: of UAV 0: controls of shape (2,), not (H, 2) with H from 1 to 1000": [Plan(np.zeros(2))] * 3,
    f"plans: TypeError: 'int' object is not iterable; {EACH}": 7,
}


@pytest.mark.parametrize(("message", "plans"), REFUSED.items(), ids=REFUSED)
def test_plans_that_cannot_be_used_are_refused_and_the_step_can_be_taken_again(message, plans):
    with Mission(load_scenario("forest", ["duration=1", "sensing.mode=ideal"])) as mission:
        with pytest.raises(InputError) as refused:
            mission.step(plans)
        assert str(refused.value) == message
        assert mission.step(np.zeros((3, 2))).time == 0.0
        with pytest.raises(InputError, match="plans: none are due between decisions"):
            mission.step(np.zeros((3, 2)))  # between decisions none are due
        assert mission.step().time == 0.2


def test_a_step_after_the_end_is_refused_and_one_too_fast_is_a_fault():
    mission = Mission(load_scenario("forest", ["duration=0.1", "sensing.mode=ideal"]))
    snapshot = mission.step([[30.0, 40.0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(snapshot.plans[0].controls, [[3.0, 4.0]])
    assert [fault.message for fault in snapshot.faults] == ["speed 50 m/s exceeds 5 m/s; clipped"]
    with pytest.raises(RuntimeError, match="the mission is over, or was closed"):
        mission.step()


# Two UAVs at one height that fly into each other, so that branches are in touch, too.
MEETING = "uavs=[{start=[-1, 0], footprint=20}, {start=[1, 0], footprint=20}]"
BRANCHED = {
    "quadrotors": ["wind.gust=1.5", "wind.velocity=[3, 1]"],
    "frames": ["appearance.randomise=true", "sensing.false_alarms=0.5"],
    "ideal": ["sensing.mode=ideal", "dynamics=kinematic", "network.loss=0.3"],
    "in touch": ["sensing.mode=ideal", MEETING],
}


class Meeting:
    """Every UAV flies to the origin, with some chance."""

    def plan(self, team, rng):
        return [Plan(np.clip(-s.own.position[None, :2] + rng.uniform(-0.1, 0.1, (1, 2)), -1, 1)) for s in team]


def test_a_mission_of_an_oracle_can_be_kept():
    mission = Mission(load_scenario("forest", ["duration=2", *BRANCHED["ideal"]]), load_planner("oracle"))
    begun = [mission.step() for _ in range(3)]
    branch = pickle.loads(pickle.dumps(mission))
    assert hash_of(branch, [*begun, *branch.fly()]) == hash_of(mission, [*begun, *mission.fly()])


@pytest.mark.parametrize("overrides", BRANCHED.values(), ids=BRANCHED)
def test_branches_of_a_mission_go_on_as_it_does_and_apart_from_it(overrides):
    whole = hash_of(*fly(*overrides, planner=Meeting(), duration=3))
    mission = Mission(load_scenario("forest", ["duration=3", *overrides]), Meeting())
    begun = [mission.step() for _ in range(9)]
    assert bool(begun[-1].contacts) == (MEETING in overrides)
    branches, others = [], []
    for copied in (copy.deepcopy, lambda mission: pickle.loads(pickle.dumps(mission))):
        branch, aside = copied(mission), copied(mission)
        branches.append(branch)
        away = np.full((len(aside.scenario.uavs), 2), -3.0)
        others.append([aside.step(away if aside.team else None) for _ in range(7)])
        aside.close()
    for flying in (mission, *branches):
        assert hash_of(flying, [*begun, *flying.fly()]) == whole
    for other in others:
        assert not np.array_equal(other[-1].poses[0].position, begun[-1].poses[0].position)


def list_arrays(value):
    """All arrays of a value but those of maps, cameras and motion models, which planners share."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, Forest | Camera | NearlyConstantVelocity | NoiseModel):
        return []
    if isinstance(value, dict):
        return list_arrays(list(value.values()))
    if isinstance(value, list | tuple):
        return [array for each in value for array in list_arrays(each)]
    return list_arrays(dict(vars(value))) if hasattr(value, "__dict__") else []


def test_a_copy_of_a_situation_shares_no_array_with_it():
    with Mission(
        load_scenario("forest", ["duration=3", "sensing.mode=ideal", "tracking.initial_tracks=none"])
    ) as mission:
        while mission.time < 2.0:
            team = mission.team
            mission.step([Plan(np.ones((2, 2)), {(s.own.id + 1) % 3: np.ones((1, 2))}) for s in team] if team else None)
        for situation in mission.team:
            copied = copy_situation(situation)
            ours, theirs = list_arrays(situation), list_arrays(copied)
            assert len(ours) == len(theirs) > 20 and situation.tracks and situation.looks and situation.intents
            for one, other in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(one, other)
                assert not np.shares_memory(one, other)


def test_errors_are_measured_only_if_somebody_asks_for_them(monkeypatch):
    measured = []
    monkeypatch.setattr(snapshot, "measure_errors", lambda *given: measured.append(given) or np.zeros((3, 3)))
    with Mission(load_scenario("forest", ["duration=2", "sensing.mode=ideal"])) as mission:
        steps = [mission.step(np.zeros((len(mission.team), 2))) for _ in range(3)]
        assert not measured
        assert [steps[1].ospa.shape, steps[1].error] == [(3, 3), 0.0] and len(measured) == 1
