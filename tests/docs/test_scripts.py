"""docs/*.py: figures and tables of pages are as they say, and a page's words are what the scripts count."""

import math
import re
import sys

import numpy as np
import pytest
from helpers.pages import DOCS, text_of
from helpers.studies import invented
from msgspec.structs import replace

from sim.facts.metrics.fleet_facts import find_people_in_the_open
from sim.mission.world_setup import make_forest_and_people
from sim.scenario.loading import load_scenario
from sim.study.store import Store, read_rows
from sim.study.trials import list_trials

sys.path.append(str(DOCS))
import canopy
import flights
import how_many
import mismatch
import scale
import unknown_forest


def test_fewer_people_show_under_denser_crowns_and_most_do_in_the_open():
    thin, dense = (canopy.view_people(density, 12) for density in (0.1, math.inf))
    for rows in (thin, dense):
        assert len(rows) == 96 and 0 <= rows[:, 1].min() and rows[:, 1].max() <= 1
        assert 0.1 < rows[:, 0].mean() < 0.5  # crowns cover about a quarter of the area
        assert (rows[rows[:, 0] == 0, 1] > 0).mean() > 0.85  # an opaque crown hides people beside it, too
    shown = [(rows[rows[:, 0] > 0, 1] > 0).mean() for rows in (thin, dense)]
    assert shown[0] > 0.95 and shown[1] < 0.5


def test_the_page_on_fleets_gets_means_figure_and_verdict_of_the_study(tmp_path, monkeypatch):
    """The share held rises with the size, by a tenth for each UAV, and is a little less from far above."""
    with Store.open(tmp_path, "how-many") as store:
        for task in list_trials(replace(how_many.STUDY, seeds="0-3")):
            height, size = (float(dict(task.factors)[name]) for name in ("altitude", "fleet"))
            held = {"share_held": 0.4 + 0.1 * size - height / 1000 + 0.002 * task.seed}
            store.add(task, replace(invented(task), metrics=held))
    page = tmp_path / "page.md"
    page.write_text("# How\n\n## Result\n\nold\n")
    monkeypatch.setattr(how_many, "PAGE", page)
    monkeypatch.setattr(how_many, "PICTURE", tmp_path / "how-many.png")
    for _ in range(2):  # again it replaces what it wrote
        how_many.main(str(tmp_path))
    text = page.read_text()
    assert text.startswith("# How\n\n## Result\n\nShare of five") and "old" not in text and text.count("| m |") == 1
    lines = [line.split(" | ") for line in text.splitlines() if line.startswith("| ")]
    assert lines[0] == ["| m", "1", "2", "3", "4", "5", "6 |"]
    assert [line[0] for line in lines[1:]] == ["| ---", "| 15", "| 30", "| 50", "| 80"]
    assert lines[2][1].startswith("48.8 [") and lines[5][5].startswith("82.3 [")
    assert [[cell.startswith("**") for cell in line[1:]] for line in lines[2:]] == [[False] * 5 + [True]] * 4
    assert "fleet = 6, altitude = 15 was the cheapest of 24 with a mean of at least 90 % on seeds 0-1" in text
    assert (tmp_path / "how-many.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_page_on_canopies_has_what_the_command_prints(capsys):
    canopy.main()
    assert capsys.readouterr().out in text_of("results/canopy")


def test_means_of_flights_are_over_all_folders_and_drawn_from_the_flight_without_errors(tmp_path, monkeypatch, capsys):
    """The study in two parts; GOSPA tells the place in the study and the seed."""
    tasks = list_trials(replace(flights.STUDY, seeds="0-2"))
    parts = [tmp_path / "estimated", tmp_path / "others"]
    for part in parts:
        with Store.open(part, "flights") as store:
            for k, task in enumerate(tasks):
                if (dict(task.factors)["pose_errors"] == "estimate") == (part == parts[0]):
                    values = {"gospa.mean_m": k, "ospa.share_under_1m": 0.5, "nees.position.mean": 1.0 + task.seed**2}
                    store.add(task, replace(invented(task), metrics=values))
    monkeypatch.setattr(flights, "PICTURE", tmp_path / "flights.png")
    flights.main(map(str, parts))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| flight | `ignore` | `inflate` | `estimate` |" and len(lines) == 2 + len(flights.FLIGHTS)
    table = {name.strip(): cells for _, name, *cells, _ in (line.split("|") for line in lines)}
    for flight, column in (("none", 0), ("drift 2 m", 1), ("consumer", 2), ("rate 1000 B/s", 0)):
        place = [("flight", flight), ("pose_errors", flights.TRACKERS[column])]
        own = [k for k, task in enumerate(tasks) if list(task.factors) == place]
        assert len(own) == 3 and table[flight][column].strip() == f"{np.mean(own):.2f} (50.0; 2.67, 2.00, 5.00)"
    assert (tmp_path / "flights.png").stat().st_size > 10_000
    figure = flights.draw(flights.estimate([row for part in parts for row in read_rows(part)]))
    assert [len(axes.lines) for axes in figure.axes] == [3, 3, 3, 1]
    assert figure.axes[0].lines[0].get_xdata().tolist() == [0.0, 0.5, 1.0, 2.0, 3.0]


def test_what_wrong_beliefs_cost_is_paired_by_maps_and_rankings_are_compared_with_those_under_the_truth(
    tmp_path, monkeypatch, capsys
):
    """Of planner k the share is 0.9 - 0.1 k under the truth; a level costs 0.1 per planner, or turns the ranking."""
    planners = mismatch.STUDY.planners[:3]
    tasks = list_trials(replace(mismatch.STUDY, planners=planners, seeds="0-6"))
    with Store.open(tmp_path / "mismatch", "mismatch") as store:
        for task in tasks:
            k, (_, level) = planners.index(task.planner), task.factors[0]
            share = 0.9 - 0.1 * k - 0.002 * task.seed - 0.1 * (level == "20 % missing")
            share -= 0.0004 * task.seed**2 * (level == "20 % missing")
            share = 0.5 + 0.1 * k if level == "all missing" else share
            store.add(task, replace(invented(task), metrics={"ospa.share_under_1m": share}))
    monkeypatch.setattr(mismatch, "PICTURE", tmp_path / "mismatch.png")
    monkeypatch.setattr(mismatch, "TRIALS", tmp_path / "mismatch.csv")
    mismatch.main([str(tmp_path / "mismatch")])
    first, second = capsys.readouterr().out.split("\n\n")
    lines = first.splitlines()
    table = {cells[1].strip(): [cell.strip() for cell in cells[2:-1]] for cells in (line.split("|") for line in lines)}
    assert len(lines) == 2 + len(mismatch.LEVELS) and list(table)[2:] == mismatch.LEVELS
    assert table["exact"] == ["", "89.4", "79.4", "69.4", ""]
    assert table["20 % missing"][1:] == ["78.9", "68.9", "58.9", "1.00"] and table["all missing"][4] == "-1.00"
    assert table["20 % missing"][0].startswith("+10.5 [+8.9, +12.3")
    assert table["half of the leaves"][4] == "1.00" and table["leaves, exact"][4] == ""
    gains = dict(re.findall(r"^\| (.+) \| ([+-]?[\d.]+)", second, flags=re.M))
    assert gains["20 % missing"] == "+10.5" and gains["trees off by 0.5 m"] in ("+0.0", "0.0")
    assert (tmp_path / "mismatch.png").stat().st_size > 10_000


@pytest.mark.parametrize("uavs", scale.FLEETS)
def test_fleets_grow_at_constant_density_and_start_apart_within_the_area(uavs):
    scenario = scale.make_scenario(uavs)
    hectares = scenario.area.width * scenario.area.height / 1e4
    assert hectares == pytest.approx(1.25 * uavs) and scenario.trees.expected_count(scenario.area) == 37.5 * uavs
    assert scenario.people.count == round(uavs / 0.3)
    starts = [uav.start for uav in scenario.uavs]
    gaps = [math.dist(a, b) for k, a in enumerate(starts) for b in starts[:k]]
    assert min(gaps) > 90 and max(abs(x) for start in starts for x in start) < scenario.area.width / 2


@pytest.mark.docs
def test_curves_of_scale_have_their_points_with_the_time_of_each_stage_and_all_forests_can_grow(monkeypatch):
    points = list(scale.list_points())
    assert len(points) == len(scale.FLEETS) + 3 * len(scale.FACTORS)
    for point in points:
        forest, people = make_forest_and_people(point.scenario, 0)
        assert forest.trees and people.positions.shape[1] == point.scenario.people.count
    monkeypatch.setattr(scale, "SECONDS", 0.4)
    monkeypatch.setattr(scale, "REPEATS", 1)
    times = scale.time_mission(scale.make_scenario(2))
    assert list(times) == list(scale.STAGES) and all(0 <= time < 1e4 for time in times.values())
    assert [axes.get_xlabel() for axes in scale.draw({"UAVs": [(2, times), (3, times)]}).axes] == ["UAVs"]


def people_of(scenario, seed):
    """Times [s] for which people can be found, and the speeds [m/s] of all."""
    forest, people = make_forest_and_people(scenario, seed)
    times = np.arange(round(scenario.duration * scenario.rates.sensing) + 1) / scenario.rates.sensing
    places = np.array([people.at(time)[0] for time in times])
    free = find_people_in_the_open(places, np.array([[tree.x, tree.y, tree.canopy_radius] for tree in forest.trees]))
    there, seen = ~np.isnan(places[..., 0]), np.flatnonzero(free.any(axis=0))
    ends = np.array([np.flatnonzero(there[:, person])[-1] for person in seen])
    moves = np.diff(places, axis=0) * scenario.rates.sensing
    return times[ends] - times[np.argmax(free[:, seen], axis=0)], np.hypot(*moves[~np.isnan(moves[..., 0])].T)


@pytest.mark.docs
def test_the_best_times_to_find_people_are_those_of_the_page_on_worlds():
    """The share of people not found falls from that outside the images at first, as fast as the images sweep."""
    scenario = load_scenario("search", [])
    stays, speeds = zip(*(people_of(scenario, seed) for seed in range(50)), strict=True)
    edges, area = np.array([uav.footprint for uav in scenario.uavs]), scenario.area.width * scenario.area.height
    passing = np.hypot(scenario.uavs[0].max_speed, np.sqrt(np.mean(np.square(np.concatenate(speeds)))))
    outside = 1.0 - np.square(edges).sum() / area
    told = []
    for width in (edges.sum(), np.sqrt(2.0) * edges.sum()):
        rate = width * passing / area
        searched = [np.minimum(stay, outside / rate) for stay in stays]
        found = np.mean([np.mean(outside * time - rate * time * time / 2) for time in searched])
        told += [f"{width * passing:.0f} m²", f"{found:.1f} s"]
    page = " ".join(text_of("results/worlds").split())
    (said,) = re.findall(r"at most (\d+ m²) more in each second, or (\d+ m²) .*? in ([\d.]+ s), or ([\d.]+ s)", page)
    assert said == (told[0], told[2], told[1], told[3])


def test_maps_are_compared_with_the_true_trees(capsys):
    unknown_forest.main([3], duration=10)
    _, _, *lines = [line.split(" | ") for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines] == ["| default", "| other appearances"]
    for _, recall, false, middle, radius, top, nees, shadows in lines:
        assert float(recall.split()[0]) > 90 and float(false.split()[0]) < 10
        assert all(0.0 < float(error) < 1.5 for error in (middle, radius, top)) and 0.0 < float(nees) < 5
        assert 0.8 < float(shadows.removesuffix(" |")) <= 1.0
