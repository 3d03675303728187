"""Plans pass the network: what is lost leaves the last plan known, shifted, and all that is sent is counted."""

import dataclasses
import json

import numpy as np
import pytest
from helpers.flights import IDEAL, fly_ideal
from helpers.summaries import shown

from planning.composed import Composed
from planning.coordination.schemes import Decentralised, Parallel, Sequential
from planning.planner import Exchange, Plan
from planning.planner_loading import load_planner
from planning.prediction.intent import expect_plans, policy_of_intent
from sim.mission.plan_check import ask_planner
from sim.mission.radio import RadioLinks
from sim.mission.teammates import Teammates
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.scenario.random_streams import stream
from sim.scenario.uavs import Network
from tracking.errors import InputError

FIVE_STEPS = 8 * (7 + 2 * 5)  # bytes: sender, time, x, y, z, velocity and five controls


class Drawn:
    """Flies plans by chance and keeps the situations it is given."""

    def __init__(self, steps=5, exchange=None):
        self.teams, self.made, self.steps = [], [], steps
        if exchange is not None:
            self.exchange = exchange

    def plan(self, team, rng):
        self.teams.append(team)
        self.made.append({s.own.id: rng.uniform(-3, 3, (self.steps, 2)) for s in team})
        return [Plan(self.made[-1][s.own.id]) for s in team]


class Checked:
    """Plans, and plans once more on a team that knows all positions and last plans."""

    def __init__(self, planner):
        self.planner, self.exchange, self.calls = planner, planner.exchange, 0

    def plan(self, team, rng):
        last = {s.own.id: s.intents[s.own.id] for s in team if s.own.id in s.intents}
        whole = [
            dataclasses.replace(s, neighbours=tuple(o.own for o in team if o is not s), intents=last, reception=None)
            for s in team
        ]
        twin = np.random.default_rng()
        twin.bit_generator.state = rng.bit_generator.state
        plans = self.planner.plan(team, rng)
        for plan, other in zip(plans, self.planner.plan(whole, twin), strict=True):
            np.testing.assert_array_equal(plan.controls, other.controls)
        self.calls += 1
        return plans


@pytest.mark.parametrize("name", ["sma-nbo-mwtp", "sma-nbo(sweeps=2, order=random, horizon=3)", "pma-nbo"])
def test_over_a_network_without_faults_plans_are_those_of_a_team_that_knows_all(name):
    planner = Checked(load_planner(name))
    mission, _ = fly_ideal(planner=planner)
    assert planner.calls == 5 and mission.faults == []


def test_behind_a_cut_link_a_uav_follows_its_last_known_plan():
    """Links to UAV 2 are down from 1.5 s: its plan of 1 s is the last that UAV 0 knows, and UAV 0's that it knows."""
    planner = Drawn()
    fly_ideal("network.cuts=[{links=[[0, 2], [1, 2]], start=1.5}]", planner=planner, duration=7)
    for me, other in ((0, 2), (2, 0), (2, 1)):
        last, place = planner.made[1][other], planner.teams[1][other].own.position
        for k in range(2, 6):  # s; in k - 1 steps it has flown so many of the five
            situation = planner.teams[k][me]
            (vehicle,) = [v for v in situation.neighbours if v.id == other]
            np.testing.assert_allclose(vehicle.position[:2], place[:2] + last[: k - 1].sum(axis=0), rtol=1e-12)
            np.testing.assert_array_equal(situation.intents[other].controls, last[k - 2 :])
            intent = policy_of_intent(situation, vehicle, 5)
            np.testing.assert_array_equal(intent[: 6 - k], last[k - 1 :])
            assert not situation.receives(other)
        for k in (6, 7):
            assert other not in [v.id for v in planner.teams[k][me].neighbours]
            assert other not in planner.teams[k][me].intents
    for k in range(1, 8):  # those that hear one another know what was planned last and where they are
        np.testing.assert_array_equal(planner.teams[k][0].intents[1].controls, planner.made[k - 1][1])
        (vehicle,) = [v for v in planner.teams[k][0].neighbours if v.id == 1]
        np.testing.assert_array_equal(vehicle.position, planner.teams[k][1].own.position)


def test_a_lost_plan_leaves_the_one_before_until_the_link_heals():
    planner = Drawn()
    # Of fifty rounds one arrives: all are in touch.
    fly_ideal("network.loss=0.6", "network.rounds=50", planner=planner, seed=3, duration=7)
    rng = stream(3, "intents")
    known = [{} for _ in range(3)]
    lost = 0
    for k, team in enumerate(planner.teams):
        for i, situation in enumerate(team):
            assert {j for j in situation.intents if j != i} == {j for j in known[i] if len(known[i][j])}
            for j, controls in known[i].items():
                if len(controls):
                    np.testing.assert_array_equal(situation.intents[j].controls, controls)
            assert [v.id for v in situation.neighbours] == [j for j in range(3) if j != i]
        reached = rng.random((1, 3, 3))[0] >= 0.6
        for i, situation in enumerate(team):
            assert situation.reception == (tuple(j for j in range(3) if j != i and reached[i, j]),)
            for j in range(3):
                if j == i:
                    continue
                lost += not reached[i, j]
                known[i][j] = planner.made[k][j] if reached[i, j] else known[i].get(j, np.zeros((0, 2)))[1:]
    assert 15 < lost < 45


def test_losses_of_plans_leave_a_uav_alone_and_consensus_as_it_is():
    planner = Drawn()
    fly_ideal("network.loss=1", planner=planner, duration=2)
    for k, team in enumerate(planner.teams):
        for i, situation in enumerate(team):
            assert situation.neighbours == () and situation.reception == ((),)
            assert list(situation.intents) == [i] * (k > 0)
    lossy = ("network.loss=0.5", "tracking.initial_tracks=none")
    (_, one), (_, other) = (fly_ideal(*lossy, planner=p, duration=3) for p in (Drawn(), Drawn(exchange=Exchange(4))))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.bytes_sent, b.bytes_sent)
        for x, y in zip(a.tracks, b.tracks, strict=True):
            assert [t.belief.mean.tobytes() for t in x] == [t.belief.mean.tobytes() for t in y]


@pytest.mark.parametrize("sweeps", [1, 2])
def test_in_a_sequence_a_uav_expects_intents_where_plans_did_not_arrive(random_team, sweeps):
    team = random_team(3)
    rng = np.random.default_rng(8)
    team = [
        dataclasses.replace(s, intents={j: Plan(rng.uniform(-3, 3, (5, 2))) for j in range(3)}, reception=heard)
        # Receptions in the first sweep and in the second: the plan of 1 never gets to 2, that of 0 late.
        for s, heard in zip(team, [((), (1,)), ((0,), (0, 2)), ((), (0,))], strict=True)
    ]
    plans = Composed(coordination=Sequential(sweeps=sweeps)).plan(team, np.random.default_rng(1))
    rng = np.random.default_rng(1)
    decide_ = Composed().decide
    knows = [expect_plans(s, 5) for s in team]
    for sweep in range(sweeps):
        for i, s in enumerate(team):
            knows[i][i] = decide_(s, knows[i], [i], rng)[0]
            for j, other in enumerate(team):
                if i in other.reception[sweep]:
                    knows[j][i] = knows[i][i]
    for i, plan in enumerate(plans):
        np.testing.assert_array_equal(plan.controls, knows[i][i])
    unheard = Composed(coordination=Parallel()).plan(team[:1], np.random.default_rng(1))[0]
    if sweeps == 1:
        np.testing.assert_array_equal(plans[0].controls, unheard.controls)


def test_without_messages_a_uav_remembers_what_it_planned_for_the_others():
    class Spy:
        exchange = Decentralised.exchange

        def __init__(self):
            self.teams, self.plans = [], []

        def plan(self, team, rng):
            self.teams.append(team)
            self.plans.append(load_planner("dec-pomdp(horizon=3, evaluations=64)").plan(team, rng))
            return self.plans[-1]

    spy = Spy()
    _, snapshots = fly_ideal("network.cuts=[{links=[[0, 2]], start=2.5}]", planner=spy)
    for k in (1, 2, 3):
        for i, situation in enumerate(spy.teams[k]):
            for j in {0, 1, 2} - {i}:
                assert not situation.receives(j)
                given = situation.intents[j].controls
                cut = k == 3 and {i, j} == {0, 2}  # still the last that it planned when they were in touch
                np.testing.assert_array_equal(given, spy.plans[2 if cut else k - 1][i].others[j])
    np.testing.assert_array_equal(spy.teams[4][0].intents[2].controls, spy.plans[2][0].others[2][1:])
    assert not np.any([s.plan_bytes for s in snapshots])


@pytest.mark.parametrize(
    ("planner", "sent", "rounds"),
    [
        ("sma-nbo-mwtp", [FIVE_STEPS] * 3, 1),
        ("sma-nbo(sweeps=2, horizon=3)", [2 * 8 * (7 + 2 * 3)] * 3, 2),
        ("mcr(samples=3)", [FIVE_STEPS] * 3, 1),
        ("dec-pomdp(evaluations=64)", [0, 0, 0], 0),
        ("centralized(evaluations=64)", [2 * FIVE_STEPS, 0, 0], 1),
        ("dec-mcts(evaluations=64, rounds=2, sequences=3)", [6 * FIVE_STEPS] * 3, 6),
        ("hover", [0, 0, 0], 0),
        ("lawnmower", [0, 0, 0], 0),
    ],
)
def test_bytes_and_rounds_of_plans_are_those_counted_by_hand(planner, sent, rounds):
    _, snapshots = fly_ideal("people.count=2", planner=planner, duration=1)
    for s in snapshots:
        made = s.plans is not None
        assert s.plan_bytes.tolist() == [made * size for size in sent] and s.plan_rounds == made * rounds


def test_without_an_exchange_attribute_each_plan_is_sent_once():
    _, snapshots = fly_ideal("network.links=[[0, 1]]", "network.loss=1", planner=Drawn(steps=2), duration=1)
    assert snapshots[0].plan_bytes.tolist() == [88, 88, 0]  # lost ones count; the last has no neighbour
    _, snapshots = fly_ideal(planner=Drawn(steps=2), duration=1)
    assert snapshots[0].plan_bytes.tolist() == [8 * 11] * 3 and snapshots[0].plan_rounds == 1
    with pytest.raises(InputError, match=r"'Drawn' cannot say what it sends: exchange must be an Exchange, is 'of"):
        fly_ideal(planner=Drawn(steps=2, exchange="of glances"), duration=1)
    planner = Drawn(steps=2, exchange=Exchange(3))
    _, snapshots = fly_ideal("network.links=[[0, 1], [1, 2]]", "uavs.0.fails_at=0.5", planner=planner, duration=1)
    assert snapshots[0].plan_bytes.tolist() == [3 * 88] * 3
    assert snapshots[-1].plan_bytes.tolist() == [0, 3 * 88, 3 * 88] and snapshots[-1].plan_rounds == 3
    assert [s.reception for s in planner.teams[0]] == [((1,),) * 3, ((0, 2),) * 3, ((1,),) * 3]


@pytest.mark.parametrize("rounds", [-1, 1.0, True, 1001])
def test_rounds_are_whole_numbers(rounds):
    with pytest.raises(ValueError, match=r"^rounds must be a whole number from 0 to 1000, is "):
        Exchange(rounds)


def test_a_run_says_what_plans_took_to_send(tmp_path, without_pictures):
    setting = load_scenario("forest", ["duration=1", *IDEAL, "uavs.2.fails_at=0.6"])
    summary = run_mission(Trial(setting, "sma-nbo-mwtp(evaluations=64)", 0), tmp_path / "out", video=False)
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["network"] == summary["network"]
    assert summary["network"]["plans"] == {
        "bytes_total": 5 * FIVE_STEPS, "bytes_per_decision_mean": 136.0, "bytes_per_decision_max": 136, "rounds": 1,
    }  # fmt: skip
    (line,) = [line for line in shown(summary).splitlines() if "plans of a UAV per decision" in line]
    assert "136 B, 1 round " in line


@pytest.mark.parametrize("others", [{1: "north"}, {1: np.zeros(3)}, {1: [[np.inf, 0.0]]}, [1]])
def test_nonsense_about_others_is_a_fault(random_team, others):
    class Confused:
        def plan(self, team, rng):
            return [Plan(np.ones((1, 2)), others) for _ in team]

    plans, faults = ask_planner(Confused(), random_team(0), {}, np.random.default_rng(0))
    assert [f.uav for f in faults] == [0, 1, 2] and "others" in faults[0].message
    for plan in plans:
        np.testing.assert_array_equal(plan.controls, [[0.0, 0.0]])


def test_the_messages_of_a_centralised_planner_are_never_lost(random_team):
    fleet = [s.own for s in random_team(0)]
    none = np.zeros((3, 3), dtype=bool)
    for rounds in (1, 3):
        teammates = Teammates(Network(loss=1.0), Exchange(rounds, centre=True), np.random.default_rng(0))
        teammates.update(0.0, fleet, RadioLinks(none, none[None]), [0, 2], 1.0)
        sent = teammates.send({0: Plan(np.ones((4, 2))), 2: Plan(np.ones((3, 2)))})
        assert sent.tolist() == [rounds * 8 * (7 + 6), 0, 0] and teammates.own[2].controls.shape == (3, 2)


def test_a_silent_neighbour_is_reckoned_with_its_momentum(random_team):
    """Two steps of half a second after the link from UAV 1 to UAV 0 went down, by the lag's differential equation."""
    before, commands, left = np.array([2.0, -1.0]), np.array([[-3.0, 1.0], [0.5, 4.0], [1.0, 1.0]]), np.exp(-0.5 / 0.65)
    fleet = [dataclasses.replace(s.own, lag=0.65, velocity=before) for s in random_team(0, uavs=2)]
    up, teammates = ~np.eye(2, dtype=bool), Teammates(Network(), Exchange(), np.random.default_rng(0))
    teammates.update(0.0, fleet, RadioLinks(up, None), [0, 1], 0.5)
    teammates.send({i: Plan(commands) for i in range(2)})
    place, velocity = fleet[1].position[:2], before
    for command in commands[:2]:
        teammates.update(0.0, fleet, RadioLinks(np.zeros_like(up), None), [0, 1], 0.5)
        (known,) = teammates.tell(0)["neighbours"]
        place = place + 0.5 * command + 0.65 * (1.0 - left) * (velocity - command)
        velocity = command + left * (velocity - command)
        np.testing.assert_allclose(known.position, [*place, fleet[1].position[2]])
        np.testing.assert_allclose(known.velocity, velocity)
        teammates.send({i: Plan(commands) for i in range(2)})


@pytest.mark.parametrize(("rate", "delay"), [(5, 1.0), (25, 1.16)])  # 25 times 1.16 is below 29
def test_a_delayed_plan_is_flown_exactly_so_much_later(rate, delay):
    """Of a planner with plans that depend on the time of the decision alone."""
    rates = "rates.physics=200", f"rates.sensing={rate}"
    given = [fly_ideal(*rates, f"network.plan_delay={later}", planner=Drawn(), duration=5)[1] for later in (0, delay)]
    commands, delayed = (np.array([s.commands for s in snapshots]) for snapshots in given)
    scans = round(rate * delay)
    np.testing.assert_array_equal(delayed[: scans + 1], 0.0)  # commands are those in force up to a scan
    np.testing.assert_array_equal(delayed[scans:], commands[: len(commands) - scans])
    assert np.all(np.any(commands[1:], axis=(1, 2)))


def test_a_uav_that_breaks_down_flies_no_delayed_plan():
    _, snapshots = fly_ideal("network.plan_delay=1.4", "uavs.1.fails_at=1.1", planner=Drawn(), duration=3)
    assert all(not np.any(s.commands[1]) for s in snapshots) and np.any(snapshots[-1].commands[0])


@pytest.mark.parametrize("delay", [0.3, 1.0, 2.5])
def test_over_a_slow_network_intents_and_places_are_those_of_the_latest_message(delay):
    """Others expect a kinematic UAV where its plan of then leads; up to a second later that is where it is."""
    planner = Drawn()
    fly_ideal(f"network.delay={delay}", "uavs.2.fails_at=5.5", planner=planner, duration=7)
    late = int(np.ceil(delay))  # decisions
    for k, team in enumerate(planner.teams):
        for situation in team:
            assert situation.reception == ((),)
            others = [j for j in range(3) if j != situation.own.id and k >= late and not (j == 2 and k > 5)]
            assert [v.id for v in situation.neighbours] == others
            assert sorted(situation.intents) == sorted([situation.own.id] * (k > 0) + others)
            for vehicle in situation.neighbours:
                np.testing.assert_array_equal(
                    situation.intents[vehicle.id].controls, planner.made[k - late][vehicle.id][late - 1 :]
                )
                then = planner.teams[k - late][vehicle.id].own.position[:2]
                there = then + planner.made[k - late][vehicle.id][:late].sum(axis=0)
                np.testing.assert_allclose(vehicle.position[:2], there, atol=1e-9)
                if late == 1:
                    np.testing.assert_allclose(there, next(s.own for s in team if s.own.id == vehicle.id).position[:2])


def test_a_slow_sender_drops_what_would_wait_for_too_long_and_counts_what_it_sends():
    """At 200 bytes a second a report of 136 bytes and scans of 88 bytes and more wait in one queue."""
    rate = ("network.rate=200", "network.hold=1")
    _, snapshots = fly_ideal(*rate, planner=Drawn(), duration=8)
    sent = np.sum([s.bytes_sent + s.plan_bytes for s in snapshots], axis=0)
    assert np.all(sent <= 200 * (8 + 1) + 1000) and np.all(sent >= 200 * 7)
    assert any(0 in s.bytes_sent for s in snapshots)
    plans = np.array([s.plan_bytes for s in snapshots if s.plans is not None])
    assert set(np.unique(plans)) <= {0, FIVE_STEPS} and plans.any()
    _, free = fly_ideal("network.rate=1e9", planner=Drawn(), duration=8)
    assert min(s.bytes_sent.min() for s in free) >= 8 * (2 + 9)
    _, alone = fly_ideal("network.delay=1", "network.range=0.1", planner=Drawn(), duration=2)
    assert not np.any([s.bytes_sent + s.plan_bytes for s in alone])


def test_without_plans_a_silent_teammate_is_predicted_by_its_velocity_while_the_network_holds():
    class Mute(Drawn):
        exchange = Exchange(0)

        def plan(self, team, rng):
            self.teams.append(team)
            return [Plan(np.full((1, 2), 1.0 + s.own.id)) for s in team]

    planner = Mute()
    fly_ideal("network.delay=0.5", "network.cuts=[{links=[[0, 1]], start=2.5}]", planner=planner, duration=8)
    for k, team in enumerate(planner.teams):
        known = {v.id: v for v in team[0].neighbours}
        assert (1 in known) == (1 <= k <= 4) and (2 in known) == (k >= 1)  # sent at 2 s, held for 2 s
        assert set(team[0].intents) == {0} - ({0} if k == 0 else set())
        for j, vehicle in known.items():
            if k > 2:
                np.testing.assert_allclose(vehicle.position, team[j].own.position, atol=1e-9)
