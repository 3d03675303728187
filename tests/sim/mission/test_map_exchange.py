"""Maps on their way through a fleet: over several links, with losses, after splits, and late."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.flights import fly, recording_of

from sim.facts.tracking_replay import replay_tracking
from sim.mission.map_exchange import DatedMap, MapExchange
from sim.mission.radio import RadioLinks
from sim.mission.scan_relay import ScanRelay
from sim.scenario.uavs import Network
from tracking.geometry.line_of_sight import Raster
from tracking.mapping.fusion import TreeMap

GROUND = Raster.over((20.0, 20.0), np.full((10, 10), np.nan))
HEADER = 8 * 2


class Fleet:
    """UAVs that make a map each second."""

    def __init__(self, uavs, network=None):
        self.network = network or Network()
        self.exchange, self.relay = MapExchange(self.network, uavs), ScanRelay(self.network, uavs)
        self.uavs = uavs

    def step(self, time, pairs, lost=None, makers=None):
        up = np.zeros((self.uavs, self.uavs), dtype=np.bool_)
        for i, j in pairs:
            up[i, j] = up[j, i] = True
        makers = range(self.uavs) if makers is None else makers
        for i in makers:
            self.exchange.publish(i, DatedMap(time, TreeMap((), GROUND)))
        links = RadioLinks(up, None if lost is None else lost[None])
        return self.exchange.step(time, makers, links, range(self.uavs), self.relay)

    def ages(self, time):
        table = np.full((self.uavs, self.uavs), np.inf)
        for i in range(self.uavs):
            for origin, made in self.exchange.maps(i).items():
                table[i, origin] = time - made.time
        return table


def every_pair(uavs):
    return [(i, j) for i in range(uavs) for j in range(i)]


def test_in_a_fleet_in_contact_each_sends_its_own_map_alone():
    fleet = Fleet(4)
    for time in (0.0, 1.0, 2.0, 3.0):
        sent = fleet.step(time, every_pair(4))
    np.testing.assert_array_equal(fleet.ages(3.0), 0.0)
    np.testing.assert_array_equal(sent, HEADER + 4 * 8 * 2 + 100 // 4)  # four versions, and one map without trees


def test_maps_pass_on_over_several_links():
    fleet, chain = Fleet(4), list(pairwise(range(4)))
    for time in range(12):
        fleet.step(float(time), chain)
    ages = fleet.ages(11.0)
    hops = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
    assert np.all(ages <= 2.0 * hops) and np.all(ages[hops > 0] >= hops[hops > 0] - 1)


def test_half_of_the_messages_lost_delays_maps_and_loses_none():
    fleet, rng = Fleet(3), np.random.default_rng(0)
    ages = []
    for time in range(60):
        fleet.step(float(time), every_pair(3), rng.random((3, 3)) < 0.5)
        ages.append(fleet.ages(float(time)))
    assert np.mean(ages[10:]) < 1.0 and np.max(ages[10:]) < 8.0
    fleet.step(60.0, every_pair(3))
    np.testing.assert_array_equal(fleet.ages(60.0), 0.0)


def test_a_fleet_that_was_split_agrees_again_on_maps_of_a_uav_that_has_failed():
    fleet = Fleet(4)
    for time in range(5):
        fleet.step(float(time), [(0, 1), (2, 3)])
    assert np.isinf(fleet.ages(4.0)[0, 2:]).all()
    for time in (5.0, 6.0):  # UAV 3 has failed, and only UAV 2 has its last map
        fleet.step(time, every_pair(3), makers=(0, 1, 2))
    assert [fleet.exchange.maps(i)[3].time for i in range(3)] == [4.0] * 3


def test_a_fleet_that_was_split_agrees_after_two_messages_for_each_link_of_a_chain():
    fleet, chain = Fleet(4), list(pairwise(range(4)))
    for time in range(5):
        fleet.step(float(time), [(0, 1), (2, 3)])
    for time in range(5, 11):
        fleet.step(float(time), chain)
        assert (3 in fleet.exchange.maps(0)) == (time >= 8)
    assert np.all(np.isfinite(fleet.ages(10.0)))


def test_a_late_map_does_not_replace_a_newer_one():
    fleet = Fleet(2, Network(delay=0.4, jitter=0.5))
    for time, late in ((0.0, 2.9), (1.0, 0.0)):
        fleet.exchange.publish(0, DatedMap(time, TreeMap((), GROUND)))
        jitter = np.full((2, 2), late)
        up = ~np.eye(2, dtype=np.bool_)
        fleet.exchange.step(time, [0], RadioLinks(up, None, jitter), [0, 1], fleet.relay)
    for time, newest in ((1.2, None), (1.6, 1.0), (3.6, 1.0)):
        fleet.exchange.step(time, [], RadioLinks(up, None), [0, 1], fleet.relay)
        held = fleet.exchange.maps(1).get(0)
        assert (held and held.time) == newest


def test_maps_wait_for_the_transmitter_that_scans_use():
    fleet = Fleet(2, Network(rate=1000.0, hold=1.0))
    fleet.relay.transmit(0, 0.0, 500)
    (size, _) = fleet.step(0.0, [(0, 1)], makers=(0,))
    assert 0 not in fleet.exchange.maps(1)
    arrival = 0.5 + size / 1000.0
    for time, there in ((arrival - 0.01, False), (arrival + 0.01, True)):
        fleet.step(time, [(0, 1)], makers=())
        assert (0 in fleet.exchange.maps(1)) == there
    fleet.relay.transmit(0, 1.0, 1001)
    assert fleet.step(1.0, [(0, 1)], makers=(0,))[0] == 0  # it would wait for longer than `hold`, and is dropped


@pytest.mark.parametrize("overrides", [["network.loss=0.5"], ["network.delay=0.2", "network.rate=40000"]])
def test_a_uav_believes_trees_that_only_others_have_seen(overrides):
    settings = ["mapping.forest=mapped", "trees.density=45", *overrides]
    mission, snapshots = fly(*settings, planner="sma-nbo-gospa", seed=3, duration=10)
    recording = recording_of(mission, snapshots, seed=3)
    alone, others = fly(*settings, "mapping.share=false", planner="sma-nbo-gospa", seed=3, duration=10)
    last = recording.scan_count - 1
    apart = recording_of(alone, others, seed=3)
    seen = [[np.mean(r.believed_at(last, uav).unknown.values == 0.0) for uav in range(3)] for r in (recording, apart)]
    assert np.all(np.divide(*seen) > 1.2)
    trees = [[len(r.believed_at(last, uav).trees) for uav in range(3)] for r in (recording, apart)]
    assert np.sum(trees[0]) > np.sum(trees[1])
    assert recording.map_bytes.sum(axis=0).min() > 0 and recording.map_bytes[1:5].sum() == 0  # once a second
    assert apart.map_bytes is None
    assert replay_tracking(recording).note == ""
