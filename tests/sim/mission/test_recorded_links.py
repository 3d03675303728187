"""Ages of what UAVs know from others, worked out again from a recording."""

import numpy as np
import pytest
from helpers.flights import IDEAL, fly, recording_of
from helpers.summaries import summary

from sim.mission.recorded_links import measure_ages
from tracking.track import Scan

LINE = "network.links=[[0, 1], [1, 2]]"


def flown(*options, planner="greedy", duration=5):
    """A recording, and the newest time (K, n, n) s of a scan that each UAV had of each other one in the mission."""
    newest = []

    def see(mission):
        last = newest[-1].copy() if newest else np.full((3, 3), np.nan)
        for i, received in enumerate(mission._knowledge.trackers.relay.received):
            for sent in received:
                if isinstance(sent.content, Scan):
                    last[i, sent.uav] = np.fmax(last[i, sent.uav], sent.content.time)
        newest.append(last)

    mission, snapshots = fly(*IDEAL, *options, planner=planner, duration=duration, see=see)
    return recording_of(mission, snapshots), np.array(newest)


def test_ages_of_steady_delays_are_those_counted_by_hand():
    recording, _ = flown(LINE, "network.delay=0.3")
    ages = measure_ages(recording)
    expected = np.array([[np.nan, 0.4, 0.8], [0.4, np.nan, 0.4], [0.8, 0.4, np.nan]])
    np.testing.assert_allclose(ages[4:], np.tile(expected, (len(ages) - 4, 1, 1)), atol=1e-9)
    assert np.isnan(ages[:2]).all() and np.isnan(ages[:4, 0, 2]).all()
    assert summary(recording)["network"]["age_s"] == pytest.approx(np.nanmean(ages))


@pytest.mark.parametrize("planner", ["greedy", "pma-nbo(horizon=3)"])
def test_ages_are_those_of_the_mission(planner):
    """With losses, jitter and a queue that scans share with plans; one UAV breaks down."""
    radio = ("network.delay=0.1", "network.jitter=0.5", "network.loss=0.2", "network.rate=3000", "uavs.2.fails_at=3.1")
    recording, newest = flown(LINE, *radio, planner=planner)
    ages = measure_ages(recording)
    both = recording.working[:, :, None] & recording.working[:, None]
    expected = np.where(both, recording.times[:, None, None] - newest, np.nan)
    np.testing.assert_array_equal(ages, expected)
    assert np.nanmax(ages) > 0.9 and np.isnan(ages[16:, 2]).all()


def test_without_delays_there_are_no_ages():
    recording, _ = flown("network.loss=0.2", duration=1)
    assert np.isnan(measure_ages(recording)).all() and summary(recording)["network"]["age_s"] is None
