"""A recorded mission: what its tables, arrays and figures hold, against the recording's own accessors."""

import dataclasses
import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from helpers.recordings import broken, record
from matplotlib.figure import Figure

from sim.facts.columns import TABLES
from sim.facts.flight import Flight, load
from sim.facts.rerender import Rerenderer
from sim.mission.archive import save
from sim.views.drawing.map_view import MapView
from sim.views.frames.frame_panels import draw_frame_page
from sim.views.scene import make_scenes
from tracking.errors import InputError

TEXT = (Path(__file__).parents[3] / "docs" / "how-to" / "notebooks.md").read_text(encoding="utf-8")


def losing():
    """A mission of 4 s in which no person is held from 1 s to 2 s."""

    def lost(snapshot):
        return dataclasses.replace(snapshot, tracks=[()] * 3) if 1.0 <= snapshot.time <= 2.0 else snapshot

    return record(21, seed=3, change=lost)


@pytest.fixture(scope="module")
def flight():
    return Flight(losing())


def test_each_row_of_a_table_is_what_the_recording_says(flight):
    r = flight.recording
    tracks, measured, ospa = (flight.columns(name) for name in ("tracks", "measurements", "ospa"))
    assert len(tracks["time_s"]) == 3 * (21 - 6) * 4
    for k, i in np.ndindex(21, 3):
        rows = (tracks["time_s"] == r.times[k]) & (tracks["uav"] == i)
        held = r.tracks_at(k, i)
        assert tracks["track"][rows].tolist() == [r.track_numbers[track.id] for track in held]
        for name, (row, column) in {"xx_m2": (0, 0), "xy_m2": (0, 1), "yy_m2": (1, 1)}.items():
            assert tracks[name][rows].tolist() == [track.belief.covariance[row, column] for track in held]
        for axis, name in enumerate(("x_m", "y_m", "vx_m_per_s", "vy_m_per_s")):
            assert tracks[name][rows].tolist() == [track.belief.mean[axis] for track in held]
        rows = (measured["time_s"] == r.times[k]) & (measured["uav"] == i)
        found = np.column_stack([measured["x_m"][rows], measured["y_m"][rows]])
        np.testing.assert_array_equal(found, r.scan_at(k, i).measurements)
        pixels = np.column_stack([measured["u_px"][rows], measured["v_px"][rows]])
        np.testing.assert_array_equal(pixels, r.pixels_at(k, i))
    np.testing.assert_array_equal(ospa["ospa_m"].reshape(21, 3), r.ospa[..., 0])


def test_people_sightings_and_losses_are_those_of_the_history(flight):
    history = flight.people
    people, sightings, losses = (flight.columns(name) for name in ("people", "sightings", "losses"))
    assert len(people["time_s"]) == history.recording.present.sum() == 21 * 4 - 5  # the fourth comes after a second
    gone = (people["time_s"] >= 1.0) & (people["time_s"] <= 2.0)
    assert not people["held_by_uavs"][gone].any()
    step = people["person"] == 0
    np.testing.assert_allclose(np.diff(people["x_m"][step])[0] / 0.2, people["vx_m_per_s"][step][0])
    seen = sightings["inside"]
    assert seen.sum() == history.views.inside.sum()
    assert (sightings["hidden_by_tree"][seen] >= 0).sum() == (history.views.hidden_by >= 0).sum() > 0
    outside = np.argwhere(history.recording.present & ~history.views.inside.any(axis=1) & ~history.held.astype(bool))[0]
    visible = flight.recording.visible.copy()
    visible[outside[0], 1, outside[1]] = 3  # at the edge of the frame
    cut = Flight(dataclasses.replace(flight.recording, visible=visible)).columns("sightings")
    assert len(cut["uav"]) == len(sightings["uav"]) + 1
    assert (sightings["held_by_track"] >= 0).sum() == (history.tracks >= 0).sum()
    assert [tuple(row) for row in zip(*losses.values(), strict=True)] == [
        (
            loss.person,
            loss.grade,
            0.2 * loss.first,
            pytest.approx(min(0.2 * (loss.last + 1), 4)),
            loss.found,
            *loss.scans,
        )
        for loss in history.unheld
    ]
    events = flight.columns("events")
    assert [*zip(*events.values(), strict=True)] == [(e.time, e.kind, e.sentence) for e in flight.events]
    assert "person lost" in events["kind"]


@pytest.mark.parametrize("options", [{"people": 0}, {"uavs": 1}, {"mode": "ideal"}, {"scans": 1}])
def test_every_table_and_figure_stands_small_missions(options):
    flight = Flight(record(**options))
    for name in TABLES:
        assert len({len(column) for column in flight.columns(name).values()}) == 1
        assert list(flight.table(name).columns) == list(flight.columns(name))
    for figure in (flight.ospa_figure(), flight.timeline_figure(), flight.map_figure(0.0)):
        assert isinstance(figure, Figure)
    assert "hover" in repr(flight)


def test_tables_take_pandas_or_polars(flight, monkeypatch):
    assert type(flight.table("trees")).__module__.startswith("pandas")
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "polars", types.SimpleNamespace(DataFrame=lambda columns: ("polars", columns)))
    library, columns = flight.table("trees")
    assert library == "polars" and list(columns) == list(flight.columns("trees"))
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(InputError, match="pandas or polars; neither is installed"):
        flight.table("trees")


def test_map_and_frame_are_those_of_a_film_and_the_annotated_one(flight):
    figure = flight.map_figure(3.63)  # nearest to scan 18
    shown = figure.axes[0].get_images()[0].get_array()
    view = MapView(flight.scenario, flight.recording.forest, shown.shape[1::-1])
    image, _ = view.draw([*make_scenes(flight.recording, flight.people.hold_states)][18])
    np.testing.assert_array_equal(shown, image)
    shown = flight.frame_figure(3.0, uav=2).axes[0].get_images()[0].get_array()
    with Rerenderer(flight.recording) as again:
        np.testing.assert_array_equal(shown, draw_frame_page(again, 15, 2, size=640))


@pytest.mark.parametrize(
    ("ask", "reason"),
    [
        (lambda f: f.map_figure(4.5), "time: 4.5 s is not in the recording; allowed are 0 to 4 s"),
        (lambda f: f.frame_figure(1.0, uav=3), "uav: there is no UAV 3; allowed are 0 to 2"),
        (lambda f: Flight(broken(f.recording, 1, 4)).frame_figure(1.0, uav=1), "time: at 1 s UAV 1 had broken"),
        (lambda f: f.table("track"), "table: 'track' is unknown; .*did you mean tracks"),
        (lambda f: load("nowhere"), "DIR: nowhere does not exist"),
    ],
)
def test_wrong_questions_are_answered_in_one_line(flight, ask, reason):
    with pytest.raises(InputError, match=reason) as caught:
        ask(flight)
    assert "\n" not in str(caught.value)


def test_a_flight_is_shown_by_its_results_in_one_line(flight):
    mine = Flight(dataclasses.replace(flight.recording, planner="mine:Mine"))
    errors = mine.recording.ospa[..., 0]
    assert repr(mine).startswith("<Flight: mine:Mine, seed 3; 4.0 s, 21 scans; 3 UAVs, 4 people, 45 trees; OSPA mean ")
    assert f"mean {errors.mean():.2f} m, {100 * np.mean(errors < 1):.1f} % under 1 m; people held " in repr(mine)
    count = sum(loss.grade == "lost" for loss in mine.people.unheld)
    assert f"; lost {count} times, at worst person " in repr(mine) and "\n" not in repr(mine)
    unknown = Flight(dataclasses.replace(flight.recording, track_means=flight.recording.track_means + 1e3))
    assert repr(unknown).endswith("; never lost; not found yet 4 times, at worst person 0 for 4.0 s from 0.0 s>")
    assert len(unknown.columns("losses")["person"]) == 4


def test_notebooks_show_all_figures_without_pyplot(flight):
    for figure in (flight.ospa_figure(), flight.timeline_figure(), flight.map_figure(1), flight.frame_figure(1, 0)):
        assert figure._repr_png_().startswith(b"\x89PNG")


def test_its_page_lists_every_column_and_runs_block_by_block(flight, tmp_path, monkeypatch, capsys):
    tables = dict(re.findall(r"^\| `(\w+)` \| [^|`]+ \| (`time_s`.*|`tree`.*|`person`.*) \|$", TEXT, flags=re.M))
    columns = {name: list(flight.columns(name)) for name in TABLES}
    assert {name: re.findall(r"`(\w+)`", text) for name, text in tables.items()} == columns
    folder = tmp_path / "runs" / "forest-sma-nbo-gospa-seed0"
    folder.mkdir(parents=True)
    save(flight.recording, folder / "mission.npz")
    monkeypatch.chdir(tmp_path)
    names = {}
    blocks = re.findall(r"^```python\n(.*?)^```$", TEXT, flags=re.M | re.S)
    assert len(blocks) == 6
    for block in blocks:
        exec(compile(block, "notebooks.md", "exec"), names)
    assert (tmp_path / "loss.png").exists() and isinstance(names["figure"], Figure)
    assert "nearest UAV to each person: [" in capsys.readouterr().out
