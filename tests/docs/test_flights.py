"""docs/flights.py: means by flight and way of taking errors, over all folders, and a line for each in the figure."""

import sys

import numpy as np
import pytest
from helpers.pages import DOCS
from helpers.studies import invented
from msgspec.structs import replace

from sim.study.store import Store, read_rows
from sim.study.trials import list_trials

sys.path.append(str(DOCS))
import flights


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The study in two parts; GOSPA tells the place in the study and the seed."""
    tasks = list_trials(replace(flights.STUDY, seeds="0-2"))
    parts = [tmp_path_factory.mktemp(name) for name in ("estimated", "others")]
    for part, folder in enumerate(parts):
        with Store.open(folder, "flights") as store:
            for k, task in enumerate(tasks):
                if (dict(task.factors)["pose_errors"] == "estimate") == (part == 0):
                    values = {"gospa.mean_m": k, "ospa.share_under_1m": 0.5, "nees.position.mean": 2.0}
                    store.add(task, replace(invented(task), metrics=values))
    return tasks, parts


def test_means_are_those_of_each_flight_over_all_folders(folders, monkeypatch, capsys, tmp_path):
    tasks, parts = folders
    monkeypatch.setattr(flights, "PICTURE", tmp_path / "flights.png")
    flights.main(map(str, parts))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| flight | `ignore` | `inflate` | `estimate` |" and len(lines) == 2 + len(flights.FLIGHTS)
    table = {name.strip(): cells for _, name, *cells, _ in (line.split("|") for line in lines)}
    for flight, column in (("none", 0), ("drift 2 m", 1), ("consumer", 2), ("rate 1000 B/s", 0)):
        place = [("flight", flight), ("pose_errors", flights.TRACKERS[column])]
        own = [k for k, task in enumerate(tasks) if list(task.factors) == place]
        assert len(own) == 3 and table[flight][column].strip() == f"{np.mean(own):.2f} (50.0; 2.00)"
    assert (tmp_path / "flights.png").stat().st_size > 10_000


def test_a_panel_has_a_line_for_each_way_from_the_flight_without_errors(folders):
    figure = flights.draw(flights.estimate([row for part in folders[1] for row in read_rows(part)]))
    assert [len(axes.lines) for axes in figure.axes] == [3, 3, 3, 1]
    assert [axes.lines[0].get_xdata().tolist() for axes in figure.axes] == [
        [0.0, 0.5, 1.0, 2.0, 3.0],
        [0.0, 2.0, 5.0, 10.0],
        [0.0, 0.05, 0.1, 0.2, 0.3],
        [0.0, 0.5, 1.0, 2.0],
    ]
