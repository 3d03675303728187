"""Time to find people: by hand, and of a mission whose people are known."""

import dataclasses

import numpy as np
from helpers.recordings import bare

from sim.facts.metrics.fleet_facts import measure_times_to_find
from sim.facts.metrics.score import score


def test_times_to_find_match_the_hand_count():
    """Five people at ten scans, five a second; a tree stands over the origin."""
    people = np.full((10, 5, 2), np.nan)
    people[:, 0] = 50.0, 0.0  # held at scan 4 by the second UAV
    people[2:, 1] = 20.0, 0.0  # comes at scan 2, is never found, and leaves after scan 7
    people[8:, 1] = np.nan
    people[:, 2] = 0.5, 0.0  # under the tree, held at scan 1, comes out at scan 3
    people[3:, 2, 0] = 30.0
    people[:, 3] = 0.0, 0.5  # under the tree throughout
    people[:, 4] = 0.0, 2.0  # comes out at scan 5, held at scan 6
    people[5:, 4, 1] = 40.0
    held = [[{}, {}] for _ in range(10)]
    held[4][1] = {1: (50.0, 0.9, 0.0, 0.0)}
    held[1][0] = {2: (0.5, 0.0, 0.0, 0.0)}
    held[6][0] = {3: (0.0, 40.0, 0.0, 0.0), 4: (20.0, 1.1, 0.0, 0.0)}
    recording = dataclasses.replace(bare(people, held), trees=np.array([[0.0, 0.0, 5.0, 3.0, 6.0, 0.2]]))
    found = measure_times_to_find(recording, [score(recording, uav) for uav in range(2)])
    np.testing.assert_allclose(found, [4 / 5, 5 / 5, 0.0, 1 / 5])
