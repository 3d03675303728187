"""Figures show the data they are given."""

import os

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from sim.views.drawing.plots import draw_ospa_figure, save


def errors(scans=50, uavs=3):
    rng = np.random.default_rng(0)
    localisation = rng.gamma(2.0, 0.2, (scans, uavs))
    cardinality = np.where(rng.random((scans, uavs)) < 0.1, 25.0, 0.0)
    return np.arange(scans) / 5, np.stack([np.hypot(localisation, cardinality), localisation, cardinality], axis=2)


def test_lines_are_the_input_and_shades_part_localisation_from_cardinality():
    times, ospa = errors()
    axes = draw_ospa_figure(times, ospa).axes[0]
    lines = {line.get_label(): line for line in axes.get_lines()}
    for i in range(3):
        np.testing.assert_array_equal(lines[f"UAV {i}"].get_xydata(), np.column_stack([times, ospa[:, i, 0]]))
    np.testing.assert_array_equal(lines["mean of UAVs"].get_ydata(), ospa[:, :, 0].mean(axis=1))
    assert any(np.all(np.asarray(line.get_ydata()) == 1.0) for line in axes.get_lines())
    assert len({to_rgb(lines[f"UAV {i}"].get_color()) for i in range(3)}) == 3
    drawn = draw_ospa_figure(times, ospa).axes[0].collections
    shades = {shade.get_label(): shade.get_paths()[0].vertices for shade in drawn}
    localisation, total = ospa[:, :, 1].mean(axis=1), ospa[:, :, 0].mean(axis=1)
    assert set(shades) == {"localisation", "added by cardinality"}
    assert {0.0, *localisation} == set(shades["localisation"][:, 1])
    assert {*localisation, *total} == set(shades["added by cardinality"][:, 1])


def test_a_uav_that_breaks_down_ends_its_line_and_leaves_the_mean():
    times, ospa = errors()
    ospa[20:, 1] = np.nan
    axes = draw_ospa_figure(times, ospa).axes[0]
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in axes.get_lines()}
    assert np.flatnonzero(np.isnan(lines["UAV 1"])).tolist() == list(range(20, 50))
    np.testing.assert_allclose(lines["mean of UAVs"][20:], ospa[20:, ::2, 0].mean(axis=1), rtol=1e-15)
    ends = [c for c in axes.collections if len(c.get_offsets()) == 1 and c.get_linewidth() == 2]
    assert [tuple(c.get_offsets()[0]) for c in ends] == [(times[19], ospa[19, 1, 0])]


@pytest.mark.parametrize(("scans", "uavs"), [(1, 1), (201, 20)])
def test_any_mission_gives_a_png_and_nothing_else(tmp_path, scans, uavs):
    save(draw_ospa_figure(*errors(scans, uavs)), tmp_path / "ospa.png")
    assert (tmp_path / "ospa.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert os.listdir(tmp_path) == ["ospa.png"]


def test_equal_data_give_equal_files_and_a_failure_none(tmp_path):
    for name in ("a.png", "b.png"):
        save(draw_ospa_figure(*errors()), tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()

    class Broken:
        def savefig(self, path, **options):
            path.write_bytes(b"half")
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        save(Broken(), tmp_path / "ospa.png")
    assert sorted(os.listdir(tmp_path)) == ["a.png", "b.png"]
