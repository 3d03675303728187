"""Networks lose messages, have fixed links, and split and heal, and a mission comes out as it must."""

import dataclasses

import numpy as np
import pytest
from helpers.flights import IDEAL, fly, fly_ideal, recording_of
from helpers.recordings import assert_same, record
from helpers.scenes import track
from helpers.studies import task_of
from helpers.summaries import hand_made, shown, summary
from scipy.sparse.csgraph import connected_components
from scipy.stats import kstest

from planning.planner import Exchange
from sim.facts.metrics.fleet_facts import measure_disagreement
from sim.mission.archive import load_recording, save
from sim.mission.knowledge import BodyState, Knowledge
from sim.mission.radio import Inbox, RadioLinks, Sender, draw_jitter, draw_lost_messages, find_links
from sim.scenario.loading import load_scenario
from sim.scenario.uavs import Cut, Network
from sim.study.trial_flight import fly_trial
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import NO_TREES
from tracking.metrics.ospa import ospa
from tracking.track import Scan


def test_a_link_is_open_within_range_if_it_exists_and_is_not_cut():
    places = np.array([[0.0, 0, 20], [30, 0, 20], [60, 0, 20], [90, 0, 20]])
    pairs = lambda network, time=0.0: np.argwhere(np.triu(find_links(network, time, places))).tolist()  # noqa: E731
    every_pair = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    assert pairs(Network()) == every_pair
    assert pairs(Network(range=60.0)) == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert pairs(Network(links=((3, 0), (1, 2)))) == [[0, 3], [1, 2]]
    assert pairs(Network(links=((3, 0), (1, 2)), range=60.0)) == [[1, 2]]
    cut = Network(cuts=(Cut(((1, 0), (2, 3)), 10.0, 20.0), Cut(((0, 3),), 15.0)))
    without = lambda *gone: [pair for pair in every_pair if pair not in gone]  # noqa: E731
    assert pairs(cut, 9.8) == pairs(Network())
    assert pairs(cut, 10.0) == pairs(cut, 14.8) == without([0, 1], [2, 3])
    assert pairs(cut, 15.0) == without([0, 1], [2, 3], [0, 3])
    assert pairs(cut, 20.0) == pairs(cut, 1e6) == without([0, 3])
    for time in (0.0, 12.0, 17.0):
        table = find_links(cut, time, places)
        np.testing.assert_array_equal(table, table.T)
        assert not table.diagonal().any()
    with pytest.raises(ValueError, match=r"^network\.cuts\.0\.links: \[0, 2\] is not in network\.links; allowed are "):
        load_scenario("forest", ["network.links=[[0, 1], [1, 2]]", "network.cuts=[{links=[[0, 2]]}]"])


def test_a_sender_sends_one_message_after_the_other_and_drops_what_would_wait_for_too_long():
    sender = Sender(Network(rate=100.0, hold=2.0))
    assert [sender.send(0.0, 50), sender.send(0.2, 100), sender.send(1.0, 150)] == [0.5, 1.5, 3.0]
    assert sender.send(0.9, 1) is None and sender.send(1.0, 1) == 3.01  # after a wait of 2 s
    assert sender.send(9.0, 100) == 10.0
    free = Sender(Network(delay=1.0))
    assert [free.send(3.0, 10**9), free.send(3.0, 1)] == [3.0, 3.0]


def test_messages_are_taken_in_the_order_of_arrival_and_once():
    inbox = Inbox()
    for arrival, name in ((0.9, "c"), (0.3, "a"), (0.3, "b"), (0.2 + 0.4, "d")):
        inbox.put(arrival, name)
    assert list(inbox.take(0.2)) == [] and list(inbox.take(0.3)) == ["a", "b"]
    assert list(inbox.take(0.6)) == ["d"]  # although 0.2 + 0.4 is more than 0.6
    assert list(inbox.take(5.0)) == ["c"] and list(inbox.take(9.0)) == []


def test_jitter_is_even_and_without_it_no_chance_is_used():
    rng, twin = np.random.default_rng(0), np.random.default_rng(0)
    assert draw_jitter(Network(delay=1.0), 3, rng) is None and rng.bit_generator.state == twin.bit_generator.state
    drawn = draw_jitter(Network(jitter=0.5), 300, rng)
    assert kstest(drawn.ravel(), "uniform", (0, 0.5)).pvalue > 0.01


def test_scans_are_passed_on_over_so_many_links_each_taking_its_time():
    """On a line of four UAVs of which the first sees the only person, the tracks of the others say when they heard."""
    line = [
        *("network.links=[[0, 1], [1, 2], [2, 3]]", "network.delay=0.3", "network.rounds=2", "network.hold=3"),
        *("people.paths=[[[-6, 0], [6, 0]]]", "tracking.initial_tracks=none", "trees.density=0"),
        "uavs=[{start=[0,0]},{start=[40,0]},{start=[-40,0]},{start=[0,40]}]",
    ]
    _, snapshots = fly_ideal(*line, duration=4)
    first = [min([k for k, s in enumerate(snapshots) if s.tracks[i]], default=None) for i in range(4)]
    assert first == [first[0], first[0] + 2, first[0] + 4, None]
    for s in snapshots[first[2] :]:
        assert s.tracks[2][0].id == s.tracks[0][0].id


def test_losses_come_at_their_rate_and_without_them_no_chance_is_used():
    rng, twin = np.random.default_rng(0), np.random.default_rng(0)
    assert draw_lost_messages(Network(), 3, rng) is None and rng.bit_generator.state == twin.bit_generator.state
    lost = draw_lost_messages(Network(loss=0.3, rounds=100_000), 2, rng)
    assert lost.shape == (100_000, 2, 2)
    np.testing.assert_allclose(lost.mean(axis=0), 0.3, atol=5 * np.sqrt(0.21 / 1e5))  # five standard deviations
    assert draw_lost_messages(Network(loss=1.0), 3, rng).all()
    assert np.all(
        draw_lost_messages(Network(loss=0.6, rounds=100_000), 2, twin)[lost]
    )  # more loss loses the same and more


def decide(knowledge, k, poses, links):
    """Situations of the decision at scan k, in which the UAVs at these poses take frames without a detection."""
    time, uavs = k / 5.0, range(len(poses))
    taken = [i for i in uavs if knowledge._scenario.has_frame(i, k)]
    scans = {i: Scan(i, time, poses[i], np.zeros((0, 2)), np.zeros((0, 2, 2))) for i in taken}
    knowledge.track(time, scans, links, list(uavs))
    states, forests = [BodyState(pose, np.zeros(2)) for pose in poses], [NO_TREES] * len(poses)
    return knowledge.begin_decision(k, states, forests, links, list(uavs))


def test_a_uav_searches_by_the_frames_of_those_it_hears_alone():
    """Of two UAVs, what the second sends does not reach the first."""
    fleet = "uavs=[{start=[-28, -14]}, {start=[-28, 14], footprint=22}]"
    setting = load_scenario("forest", [*IDEAL, "tracking.initial_tracks=none", fleet])
    poses = [Pose.level(*uav.start, uav.altitude) for uav in setting.uavs]
    pair = ~np.eye(2, dtype=bool)

    def known(up, lost):
        knowledge = Knowledge(setting, [], exchange=Exchange(), rng=np.random.default_rng(0))
        return decide(knowledge, 0, poses, RadioLinks(up, lost))

    alone, both = known(pair & False, None), known(pair, None)
    deaf = known(pair, np.tile([[False, True], [False, False]], (5, 1, 1)))
    assert [[v.id for v in s.neighbours] for s in deaf] == [[], [0]] and [len(s.looks) for s in deaf] == [1, 2]
    for found, expected in zip(deaf, (alone[0], both[1]), strict=True):
        np.testing.assert_array_equal(found.undetected.people, expected.undetected.people)
    people = [s.undetected.people for s in (*alone, *both)]
    assert (people[0] != people[1]).any() and (people[0] > people[2]).any() and (people[2] == people[3]).all()


def test_a_frame_changes_the_tracks_of_those_who_hear_of_it_alone():
    """UAV 0 has broken down, and the last one detects a person."""
    setting = load_scenario("forest", IDEAL)
    poses = [Pose.level(*uav.start, uav.altitude) for uav in setting.uavs]
    person = np.array([-28.0, 14.0])
    scans = {2: Scan(2, 0.0, poses[2], person[None] + 0.5, np.eye(2)[None] * 0.1)}

    def known(*arrives):
        """Places of the tracks of UAVs 1 and 2, if messages from one to another arrive."""
        lost = np.ones((5, 3, 3), dtype=bool)
        for sender, receiver in arrives:
            lost[:, receiver, sender] = False
        at = [track(0, *person, 0.0, 0.0)]
        knowledge = Knowledge(setting, at, exchange=Exchange(), rng=np.random.default_rng(0))
        tracks, _ = knowledge.track(0.0, scans, RadioLinks(~np.eye(3, dtype=bool), lost), [1, 2])
        assert tracks[0] == ()
        return [tracks[i][0].belief.mean[:2] for i in (1, 2)]

    np.testing.assert_allclose(known((1, 2))[0], person, atol=1e-9)
    assert np.all(known((2, 1))[0] > person + 0.1) and np.all(known()[1] > person + 0.1)


def test_between_frames_of_a_slow_camera_undetected_people_only_spread():
    fleet = "uavs=[{start=[-28, -14], rate=1}]"
    setting = load_scenario("forest", [*IDEAL, "tracking.initial_tracks=none", "rates.planning=5", fleet])
    knowledge = Knowledge(setting, [], exchange=Exchange(), rng=np.random.default_rng(0))
    links, found = RadioLinks(np.zeros((1, 1), dtype=bool), None), []
    for k in range(6):
        body = Pose.level(3.0 * k, 0.0, setting.uavs[0].altitude)
        (situation,) = decide(knowledge, k, [body], links)
        found.append(situation.undetected.people.sum())
    assert found[:5] == pytest.approx([found[0]] * 5) and found[5] < found[0] - 0.01


def test_disagreement_is_the_mean_ospa_between_pairs_and_grows_with_losses():
    held = [[track(0, 0, 0, 0, 0)], [track(0, 3, 4, 0, 0)], [track(0, 0, 0, 0, 0), track(1, 9, 9, 0, 0)]]
    alone = ospa(np.zeros((1, 2)), np.array([[0.0, 0], [9, 9]])).distance
    third = ospa(np.array([[3.0, 4]]), np.array([[0.0, 0], [9, 9]])).distance
    assert measure_disagreement(held) == pytest.approx((5.0 + alone + third) / 3)
    assert measure_disagreement(held[:1]) == measure_disagreement([]) == measure_disagreement([[], []]) == 0.0
    mission, snapshots = fly_ideal("network.loss=0.9", seed=1, duration=3)
    row = fly_trial(task_of(mission.scenario, "hover", 1)).row
    assert row.metrics["network.disagreement_m"] == np.mean([measure_disagreement(s.tracks) for s in snapshots]) > 0.01
    whole = fly_trial(task_of(load_scenario("forest", [*IDEAL, "duration=3"]), "hover", 1)).row
    assert whole.metrics["network.disagreement_m"] < 1e-9


def test_losses_are_those_of_the_seed_and_change_no_people_nor_noise():
    """A fleet that hovers sees the same whatever it believes; with averages alone messages are as long, too."""
    (whole, without), (lossy, losing) = (fly_ideal("network.fusion=kla", f"network.loss={loss}") for loss in (0.0, 0.8))
    assert whole.forest.trees == lossy.forest.trees
    differ = 0
    for a, b in zip(without, losing, strict=True):
        np.testing.assert_array_equal(a.people, b.people)
        for one, other in zip(a.scans, b.scans, strict=True):
            np.testing.assert_array_equal(one.measurements, other.measurements)
        np.testing.assert_array_equal(a.bytes_sent, b.bytes_sent)  # what is lost has been sent
        pairs = [[t.belief.mean.tobytes() for t in s.tracks[0]] for s in (a, b)]
        differ += pairs[0] != pairs[1]
    assert sum(len(scan.measurements) for s in without for scan in s.scans) > 50 and differ > 10
    lossy = ("network.loss=0.5", "tracking.initial_tracks=none")
    one, other = (recording_of(*fly_ideal(*lossy, planner="sma-nbo-mwtp(evaluations=64)", seed=2)) for _ in range(2))
    assert_same(one, other)


def test_bytes_count_rounds_to_linked_uavs_and_survive_the_disk(tmp_path):
    # Four tracks: 6 + 4 * 29 numbers of 8 bytes in each of five rounds; UAV 2 has no link.
    _, snapshots = fly_ideal("network.links=[[0, 1]]", "network.fusion=kla", duration=1)
    for s in snapshots:
        np.testing.assert_array_equal(s.bytes_sent, [5 * 8 * 122, 5 * 8 * 122, 0])
    recording = dataclasses.replace(hand_made(), bytes_sent=np.array([[100, 300], [0, 1000]]))
    network = summary(recording)["network"]
    assert {k: v for k, v in network.items() if k.startswith("bytes")} == {
        "bytes_total": 1400, "bytes_per_scan_mean": 350.0, "bytes_per_scan_max": 1000
    }  # fmt: skip
    held = [recording.tracks_at(k, i) for k in range(2) for i in range(2)]
    assert network["disagreement_m"] == (measure_disagreement(held[:2]) + measure_disagreement(held[2:])) / 2
    (line,) = [line for line in shown(summary(recording)).splitlines() if "sent by a UAV per scan" in line]
    assert "0.3 kB" in line or "0.4 kB" in line
    save(record(), tmp_path / "mission.npz")
    kept = load_recording(tmp_path / "mission.npz").bytes_sent
    np.testing.assert_array_equal(kept, 100 * np.arange(11)[:, None] + np.arange(3))


def test_a_split_fleet_disagrees_and_agrees_again_in_the_scan_it_heals():
    """Four people, all known at the start; UAV 2 is cut off from 1 s to 3 s, and then hears only UAV 1."""
    cuts = "network.cuts=[{links=[[1, 2]], start=1, end=3}]"
    links = ("network.links=[[0, 1], [1, 2]]", cuts, "network.rounds=8", "trees.density=0")
    mission, snapshots = fly_ideal(*links, duration=6)
    assert mission.faults == []
    for s in snapshots:
        ids = [[t.id for t in held] for held in s.tracks]
        assert all(len(set(held)) == len(held) <= 4 for held in ids)
        between = measure_disagreement(s.tracks)
        if 1 <= s.time < 3:
            np.testing.assert_array_equal(s.bytes_sent[2], 0)
            assert between > 1e-3
        else:
            assert ids[0] == ids[1] == ids[2] and between < 0.02


@pytest.mark.parametrize(("fusion", "initial"), [("kla", "known"), ("hcmci", "none")])
def test_with_half_of_all_messages_lost_the_fleet_agrees(fusion, initial):
    """On every id in all but a few scans, and within centimetres in the mean."""
    overrides = ("network.loss=0.5", f"network.fusion={fusion}", f"tracking.initial_tracks={initial}")
    _, snapshots = fly_ideal(*overrides, seed=0, duration=12)
    alike = [len({tuple(t.id for t in held) for held in s.tracks}) == 1 for s in snapshots]
    assert np.mean(alike) > 0.95
    gaps = [measure_disagreement(s.tracks) for s, same in zip(snapshots, alike, strict=True) if same]
    assert 0.0 < np.mean(gaps) < 0.05


NEAR, ALONE = 1.0, 3.0  # m, of a person's track, and of people with tracks that cannot be mistaken for each other's
SPLITS = {
    "one apart": ("network.cuts=[{links=[[0, 2], [1, 2]], start=3, end=13}]",),
    "all apart": ("network.cuts=[{links=[[0, 1], [0, 2], [1, 2]], start=2, end=14}]",),
    "off and on": (
        "network.cuts=[{links=[[0, 1], [0, 2]], start=2, end=9}, {links=[[0, 2], [1, 2]], start=11, end=15}]",
    ),
    "line": ("network.links=[[0, 1], [1, 2]]", "network.cuts=[{links=[[1, 2]], start=3, end=13}]"),
}


def tracks_near(snapshot, people):
    """Number (n, M) of tracks of each UAV near each person."""
    counts = []
    for held in snapshot.tracks:
        places = np.array([t.belief.mean[:2] for t in held]).reshape(-1, 2)
        counts.append((np.linalg.norm(places[:, None] - people[None], axis=2) < NEAR).sum(axis=0))
    return np.array(counts)


def check(split: str, seed: int, *overrides: str) -> int:
    """Assert agreement while all hear each other, over others or not, and one track a person after each healing.

    Returns the number of healings.
    """
    mission, snapshots = fly(*SPLITS[split], *overrides, planner="sma-nbo", seed=seed, duration=18)
    healings, before, healed = 0, True, False
    for s in snapshots:
        graph = find_links(mission.scenario.network, s.time, np.array([p.position for p in s.poses]))
        whole = connected_components(graph)[0] == 1
        healings += whole and not before
        before, healed = whole, whole and (healed or not before)
        assert not whole or len({tuple(t.id for t in held) for held in s.tracks}) == 1
        gaps = np.linalg.norm(s.people[:, None] - s.people[None], axis=2) + np.diag(np.full(len(s.people), np.inf))
        counts = tracks_near(s, s.people) * (gaps.min(axis=1) > ALONE)
        assert not healed or counts.max() <= 1, (split, seed, s.time)
    return healings


@pytest.mark.parametrize(("split", "seed"), [("one apart", 0), ("all apart", 1)])
def test_a_fleet_that_heals_agrees_at_once_without_duplicates(split, seed):
    assert check(split, seed, *IDEAL) == 1


@pytest.mark.slow
@pytest.mark.parametrize("sensing", [IDEAL, ()])
@pytest.mark.parametrize("seed", range(20))
def test_a_fleet_that_heals_agrees_at_once_without_duplicates_on_any_seed(seed, sensing):
    split = list(SPLITS)[seed % len(SPLITS)]
    assert check(split, seed, *sensing) >= 1


def test_after_a_cut_of_a_slow_network_the_fleet_agrees_on_ids_again():
    """UAV 2 is cut off for 8 s, ten times as long as the network holds; a fifth of all messages is lost."""
    cut = "network.cuts=[{links=[[0, 2], [1, 2]], start=1, end=9}]"
    slow = ("network.delay=0.2", "network.hold=0.8", "network.loss=0.2", cut)
    mission, snapshots = fly_ideal(*slow, "tracking.initial_tracks=none", planner="sma-nbo-gospa", duration=16)
    reported = [[{t.id for t in tracks if t.reported} for tracks in s.tracks] for s in snapshots]
    assert any(ids[0] != ids[2] for ids in reported[:50])
    agree = [ids[0] == ids[1] == ids[2] for ids in reported]
    assert np.mean(agree[65:]) > 0.8 and len(reported[-1][0]) >= 3
    assert mission.faults == []
