"""A mission made by hand: a false track for 3 s, a duplicate for 2 s, and two tracks that swap people."""

import dataclasses

import numpy as np

from helpers import synthetic
from helpers.recordings import bare, record
from sim.scenario.scenario import encode_scenario
from tracking.filter.kalman import Gaussian
from tracking.track import Track

SCANS = 31
PEOPLE = np.array([[0.0, 0.0], [20.0, 0.0]])  # who stand still
FALSE, DUPLICATE, SWAP = (2, 16), (5, 14), 20  # scans, the first and the last


def tracks_at(k):
    """Places of tracks by id at scan k: numbers 0 and 1 are of people, 2 is false, 3 a duplicate."""
    west, east = PEOPLE if k < SWAP else PEOPLE[::-1]
    found = {70: west, 80: east}
    if FALSE[0] <= k <= FALSE[1]:
        found[90] = np.array([-40.0, 30.0])
    if DUPLICATE[0] <= k <= DUPLICATE[1]:
        found[95] = np.array([20.0, 0.6])
    return found


def swapping(**changes):
    """The recording, of three UAVs."""
    setting = synthetic.scenario(uavs=3, people=2, mode="ideal")

    def held(snapshot):
        places = tracks_at(round(snapshot.time * setting.rates.sensing))
        tracks = tuple(Track(id_, Gaussian(np.append(place, [0.0, 0.0]), np.eye(4))) for id_, place in places.items())
        return dataclasses.replace(snapshot, people=PEOPLE, tracks=[tracks] * 3, contacts=())

    return dataclasses.replace(record(SCANS, setting=setting, trees=0, change=held), **changes)


def standing_still(tracks, people=PEOPLE):
    """A recording of people who stand still, and of tracks by id and place, of each scan and UAV."""
    cells = [[{id_: (*place, 0.0, 0.0) for id_, place in cell.items()} for cell in row] for row in tracks]
    setting = synthetic.scenario(uavs=len(tracks[0]), people=len(people), mode="ideal")
    return bare(np.tile(people, (len(tracks), 1, 1)), cells, scenario=encode_scenario(setting))


def at_random(seed, *, scans=40, people=3, tracks=5):
    """Two UAVs' tracks that wander round people 25 m apart, come, go and swap people."""
    rng = np.random.default_rng(seed)
    homes = np.column_stack([25.0 * np.arange(people), np.zeros(people)])
    there = rng.random((scans, people, 1)) < 0.9
    owner = rng.integers(people, size=tracks)
    cells = []
    for _ in range(scans):
        owner = np.where(rng.random(tracks) < 0.1, rng.integers(people, size=tracks), owner)
        cells.append([_cell(rng, homes[owner]) for _ in range(2)])
    return dataclasses.replace(standing_still(cells, homes), people=np.where(there, homes, np.nan))


def _cell(rng, homes):
    held = np.flatnonzero(rng.random(len(homes)) < 0.8).tolist()
    return {10 * t: homes[t] + rng.normal(0, rng.choice([0.3, 2.0, 9.0]), 2) for t in held}
