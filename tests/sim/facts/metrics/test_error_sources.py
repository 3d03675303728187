"""Sources of squared GOSPA: hand-made cases, and their sum over missions."""

import numpy as np
import pytest
from helpers.recordings import bare, broken

from sim.facts.metrics.fleet_facts import SOURCES, find_error_sources
from sim.facts.metrics.metric import Outcome
from tracking.metrics.ospa import gospa

MISS = 50.0  # m²
NEAR, FAR_OFF, GHOST = (0.5, 0.0, 0.0, 0.0), (3.0, 0.0, 0.0, 0.0), (80.0, 0.0, 0.0, 0.0)


def sources(tracks, *, detected=(), **changes):
    """Means of the sources [m²] over scans and UAVs, by name: one person at the origin; tracks by scan and UAV."""
    matched = np.zeros((len(tracks), len(tracks[0]), 1), dtype=bool)
    for place in detected:
        matched[place] = True
    recording = bare(np.zeros((len(tracks), 1, 2)), tracks, matched=matched, **changes)
    return dict(zip(SOURCES, find_error_sources(recording, Outcome(recording).scores).mean(axis=0), strict=True))


def only(**parts):
    return dict.fromkeys(SOURCES, 0.0) | parts


@pytest.mark.parametrize(
    ("tracks", "detected", "expected"),
    [
        ([[{}]], (), {"not_found_yet": MISS}),
        ([[{}]], [(0, 0)], {"not_found_yet": MISS}),  # no track yet
        ([[{0: FAR_OFF}]], (), {"localisation": 9.0}),
        ([[{0: NEAR}]], (), {"localisation": 0.25}),
        ([[{0: NEAR}, {}]], (), {"localisation": 0.125, "known_to_others": MISS / 2}),
        ([[{0: NEAR, 1: GHOST}]], (), {"localisation": 0.25, "false": MISS}),
        ([[{0: NEAR}], [{}]], (), {"localisation": 0.125, "unknown_to_others": MISS / 2}),
        ([[{0: NEAR}], [{0: GHOST}]], (), {"localisation": 0.125, "unknown_to_others": MISS / 2, "false": MISS / 2}),
        (
            [[{0: NEAR}], [{}]],
            [(1, 0)],
            {"localisation": 0.125, "unknown_to_others": MISS / 2},
        ),  # it sees the person, without a track
        (
            [[{0: NEAR}, {}], [{}, {}]],
            [(1, 1)],
            {"localisation": 0.0625, "known_to_others": MISS / 2, "unknown_to_others": MISS / 4},
        ),
    ],
)
def test_each_error_has_the_source_that_the_fleet_s_knowledge_gives_it(tracks, detected, expected):
    assert sources(tracks, detected=detected) == pytest.approx(only(**expected))


def test_sources_add_up_to_squared_gospa_at_each_scan_of_each_uav_that_works():
    rng = np.random.default_rng(0)
    people = rng.uniform(-15, 15, (30, 4, 2))
    people[rng.random((30, 4)) < 0.2] = np.nan
    rows = []
    for here in np.nan_to_num(people):  # each UAV has a track at one of the people, and up to four elsewhere
        own = here[rng.integers(4, size=3)]
        others = [dict(enumerate(rng.uniform(-15, 15, (rng.integers(5), 4)), 3)) for _ in own]
        rows.append([{i: (*place, 0.0, 0.0), **others[i]} for i, place in enumerate(own)])
    recording = broken(bare(people, rows, matched=rng.random((30, 3, 4)) < 0.1), 1, 12)
    found, distances = find_error_sources(recording, Outcome(recording).scores), []
    for i in range(recording.poses.shape[1]):
        for k in np.flatnonzero(recording.working[:, i]):
            tracks = [t.belief.mean[:2] for t in recording.tracks_at(k, i) if t.reported]
            people = recording.people[k][~np.isnan(recording.people[k, :, 0])]
            distances.append(gospa(np.reshape(tracks, (-1, 2)), people).distance)
    np.testing.assert_allclose(found.sum(axis=1), np.square(distances), atol=1e-9)
    assert found.any(axis=0).all() and (found >= 0.0).all()
