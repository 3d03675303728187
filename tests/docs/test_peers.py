"""docs/peers.py: its scores are right, it runs, and docs/results/peers.md shows what it prints."""

import itertools
import sys

import numpy as np
import pytest
from helpers.pages import DOCS, text_of
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.types.state import State

sys.path.append(str(DOCS))
import peers

CELL = peers.Cell(0.9, 10)
SMALL = ["--seeds", "2,3", "--scans", "8"]


@pytest.mark.parametrize("seed", [0, 1])
def test_scores_equal_those_of_stone_soups_metric(seed):
    scene = peers.simulate(CELL, seed, 10)
    found = peers.theirs(scene, CELL, peers.TUNED[CELL])
    metric = GOSPAMetric(c=10.0, p=2.0)
    pairs = [
        [[State(place) for place in scan.values()] for scan in two] for two in zip(found, scene.people, strict=True)
    ]
    each = [metric.compute_gospa_metric(*states)[0].value for states in pairs]
    score = peers.score(scene, found)
    distance, missed, false = (np.mean([value[name] for value in each]) for name in ("distance", "missed", "false"))
    assert score.gospa == pytest.approx(distance, rel=1e-12)
    assert (score.missed, score.false) == pytest.approx((missed / 50, false / 50))
    assert score.missed > 0 and any(found)


def test_people_are_missed_by_three_causes_and_a_track_that_another_takes_over_is_a_switch():
    """A has a track from the second scan to the third; that of B walks off in the last scan, and C has none."""
    a, b, c = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]])
    tracks = [{}, {1: a, 2: b}, {1: a, 2: b}, {2: b}, {2: b + 20}]
    score = peers.score(peers.Scene([], [], [{"a": a, "b": b}] * 4 + [{"a": a, "b": b, "c": c}]), tracks)
    assert score[1:] == pytest.approx((6 / 5, 1 / 5, 0, 3 / 5, 2 / 5, 1 / 5))
    score = peers.score(peers.Scene([], [], [{"a": a, "b": b}] * 2), [{1: a, 2: b}, {1: b, 2: a}])
    assert score == (0, 0, 0, 2, 0, 0, 0)


def test_scenes_have_births_deaths_misses_and_false_alarms_and_come_again():
    one, again = (peers.simulate(CELL, 1) for _ in range(2))
    for x, y in zip(one.people, again.people, strict=True):
        np.testing.assert_array_equal([*x.values()], [*y.values()])
    ids = [set(scan) for scan in one.people]
    assert len(ids) == peers.SCANS and len(ids[0]) == peers.PEOPLE
    assert any(b - a for a, b in itertools.pairwise(ids))
    assert any(a - b for a, b in itertools.pairwise(ids))
    detected = np.mean([sum(not d.clutter for d in scan if hasattr(d, "clutter")) for scan in one.detections])
    assert detected / np.mean([len(scan) for scan in ids]) == pytest.approx(0.9, abs=0.05)
    assert np.mean([len(scan) for scan in one.detections]) - detected == pytest.approx(10, abs=1)


@pytest.mark.docs
def test_the_comparison_runs_and_pairs_scenes(capsys):
    peers.main(["compare", *SMALL])
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in capsys.readouterr().out.splitlines()[2:]]
    assert len(lines) == 3 * len(peers.TUNED)
    for k, cell in enumerate(peers.TUNED):
        scenes = [peers.simulate(cell, seed, 8) for seed in (2, 3)]
        theirs = np.mean([peers.score(scene, peers.theirs(scene, cell, peers.TUNED[cell])) for scene in scenes], axis=0)
        ours = np.mean([peers.score(scene, peers.ours(scene, peers.parameters(cell))) for scene in scenes], axis=0)
        means, gap = ([float(text.split()[0]) for text in line[2:6]] for line in lines[3 * k : 3 * k + 2])
        np.testing.assert_allclose(means, theirs[:4], atol=0.006)
        np.testing.assert_allclose(gap, (ours - theirs)[:4], atol=0.006)


@pytest.mark.docs
def test_tuning_finds_the_least_gospa(monkeypatch):
    monkeypatch.setattr(peers, "TRIED", {"points": (2, 3), "steps": (3, 5)})
    scene = peers.simulate(CELL, 0, 10)
    tried = [peers.Tuning(points, steps) for points in (2, 3) for steps in (3, 5)]
    costs = {tuning: peers.score(scene, peers.theirs(scene, CELL, tuning)).gospa for tuning in tried}
    assert costs[peers.tune(CELL, [0], 10)] == min(costs.values())


@pytest.mark.slow
def test_the_page_shows_a_cell_of_the_comparison():
    assert "\n".join(peers.compare([CELL], range(20)).splitlines()[2:]) in text_of("results/peers")
