"""Hand-offs of people from UAV to UAV: cases made by hand, and a plain transcription."""

import numpy as np
import pytest
from helpers.recordings import bare, broken

from sim.facts.flight import Flight
from sim.facts.metrics.fleet_facts import find_handoffs

LEVEL = np.tile([0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 1.0], (6, 2, 1))  # poses of two UAVs at six scans


def flown(*lanes, **changes):
    """A mission with one person; each UAV's lane has a letter a scan: x where it detects the person."""
    matched = np.array([[letter == "x" for letter in lane] for lane in lanes]).T[:, :, None]
    scans, uavs = matched.shape[:2]
    return bare(np.zeros((scans, 1, 2)), [[{}] * uavs] * scans, matched=matched, **changes)


@pytest.mark.parametrize(
    ("lanes", "expected"),
    [
        (["xxx---", "---xxx"], [(3, 2, 0, 1)]),
        (["xxxx--", "--xxxx"], [(4, 3, 0, 1)]),  # both see the person for a while
        (["xx----", "----xx"], [(4, 1, 0, 1)]),  # nobody does
        (["xx--xx", "------"], []),
        (["xx-xx-", "xxxxxx"], [(2, 1, 0, 1)]),  # the second keeps the person
        (["xx----", "---xxx", "--xxxx"], [(2, 1, 0, 2)]),
        (["xxx---", "--xxxx", "-xxxxx"], [(3, 2, 0, 2)]),  # the third has seen the person for longer
        (["xx----", "--xx--", "----xx"], [(2, 1, 0, 1), (4, 3, 1, 2)]),
        (["------", "xxxxxx"], []),
    ],
)
def test_a_person_passes_to_the_uav_that_sees_them_once_the_other_no_longer_does(lanes, expected):
    assert [(h.scan, h.last, *h.uavs) for h in find_handoffs(flown(*lanes))] == expected


def test_a_slow_cameras_last_frame_counts_and_a_uav_that_breaks_down_sees_nobody():
    slow = '{"uavs": [{"start": [0, 0], "rate": 2.5}, {"start": [9, 9]}], "people": {"count": 1}}'
    assert find_handoffs(flown("x-x-x-", "xxxxxx", scenario=slow)) == []
    assert [h.scan for h in find_handoffs(broken(flown("xxxxxx", "xxxxxx"), 0, 3))] == [3]


def test_handoffs_are_told_as_events():
    flight = Flight(flown("xx----", "----xx", cameras=LEVEL, poses=LEVEL))
    assert [(e.text, e.time, e.person, e.uavs) for e in flight.events if e.kind == "hand-off"] == [
        ("person 0 passed from UAV 0 to UAV 1, unseen for 0.4 s", 0.8, 0, (1, 0))
    ]
