"""Heights of the ground in both formats, on the map and off it, and what is refused."""

import re
from types import SimpleNamespace

import numpy as np
import pyproj
import pytest
import rasterio

from sim.scenario.geo import Geo, Ground
from sim.world.terrain import read_terrain
from tracking.errors import InputError

HEIGHTS = np.random.default_rng(0).uniform(90, 110, (5, 6)).round(2)  # row 0 in the north
CORNER, CELL = (457100.0, 5428300.0), 20.0
HEAD = "ncols 6\nnrows 5\nxllcorner {}\nyllcorner {}\ncellsize {}\nNODATA_value -9999\n"


def ascii_grid(path, heights=HEIGHTS, corner=CORNER, cell=CELL, head=HEAD):
    rows = "\n".join(" ".join(map(repr, row)) for row in heights.tolist())
    path.write_text(head.format(*corner, cell) + rows + "\n")
    return path


def tiff(path, heights=HEIGHTS, corner=CORNER, cell=CELL, crs=None, **options):
    where = rasterio.transform.from_origin(corner[0], corner[1] + cell * len(heights), cell, cell)
    shape = {"height": heights.shape[0], "width": heights.shape[1], "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", driver="GTiff", nodata=-9999, transform=where, crs=crs, **shape, **options) as file:
        file.write(heights.astype(np.float32), 1)
    return path


def read(path, geo=None, **ground):
    return read_terrain(path.parent, Ground(file=path.name, **ground), geo or Geo())


@pytest.mark.parametrize("write", [ascii_grid, tiff], ids=["ascii", "tiff"])
def test_heights_stand_in_the_middle_of_cells_counted_from_the_north_west(write, tmp_path):
    path = tmp_path / ("dem.asc" if write is ascii_grid else "dem.tif")
    terrain, (told,) = read(write(path))
    east, north = CORNER[0] + 10 + CELL * np.arange(6), CORNER[1] + 90 - CELL * np.arange(5)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(terrain.find_heights(places, "").reshape(5, 6), HEIGHTS, atol=1e-5)
    moved = terrain.moved((457000.0, 5428000.0)).find_heights(np.array([[120.0, 380.0]]), "UAV 0")
    np.testing.assert_allclose(moved, HEIGHTS[:2, :2].mean(), atol=1e-5)
    assert "5 × 6 heights from 90" in told and "err by 0.3 m" in told


def test_centres_of_cells_and_other_sides_of_cells_are_read(tmp_path):
    head = "NCOLS 6\nNROWS 5\nXLLCENTER {}\nYLLCENTER {}\nDX {}\nDY 10\n"
    terrain, _ = read(ascii_grid(tmp_path / "dem.asc", corner=(0.0, 0.0), head=head))
    np.testing.assert_allclose(terrain.find_heights(np.array([[20.0, 40.0]]), ""), HEIGHTS[0, 1])


@pytest.mark.parametrize(("code", "told"), [(25832, True), (25832, False), (4326, True), (4326, False)])
def test_coordinates_of_the_map_agree_with_pyproj(code, told, tmp_path):
    """Over 2 km they are taken to be linear, which is exact to centimetres, and to a metre for degrees."""
    across = pyproj.Transformer.from_crs(4326, code, always_xy=True)
    geo = Geo(origin=(49.0, 8.42), epsg=25832 if code == 25832 and not told else None)
    cell = 20.0 if code == 25832 else 0.0002
    x, y = across.transform(8.42, 49.0)
    grid = {"heights": np.add.outer(np.arange(300.0), 2 * np.arange(300.0)), "corner": (x - 150 * cell, y - 150 * cell)}
    if told:
        path = tiff(tmp_path / "dem.tif", crs=f"EPSG:{code}", compress="deflate", cell=cell, **grid)
    else:
        head = HEAD.replace("ncols 6\nnrows 5", "ncols 300\nnrows 300")
        path = ascii_grid(tmp_path / "dem.asc", cell=cell, head=head, **grid)
    places = np.random.default_rng(1).uniform(-1000, 1000, (50, 2))
    lat, lon = geo.find_degrees(places).T
    x, y = across.transform(lon, lat)
    column, row = (x - grid["corner"][0]) / cell - 0.5, 299.5 - (y - grid["corner"][1]) / cell
    metre = 1 / 20  # cells
    found = read(path, geo)[0].find_heights(places, "")
    np.testing.assert_allclose(found, row + 2 * column, atol=3 * metre * (0.1 if code == 25832 else 1.0))


HOLED = np.where(np.eye(5, 6) > 0, -9999.0, HEIGHTS)
REFUSED = {
    "beyond": (ascii_grid, {}, (10.0, 20.0), r"does not cover the flight: it reaches from 457110, 5428310 to 457210, "
               r"5428390, and UAV 0 is at 10, 20; give a file with all that cameras see"),
    "nodata": (ascii_grid, {"heights": HOLED}, (457115.0, 5428385.0), r"has no height \(nodata\) in row 1, column 1, "
               r"near 457115, 5428385, where UAV 0 is; fill such cells"),
    "words": (ascii_grid, {"head": "<html> "}, None, "is no ESRI ASCII grid"),
    "comma": (ascii_grid, {"head": HEAD + "99,5\n"}, None, "is no ESRI ASCII grid: could not convert string .*99,5"),
    "few": (ascii_grid, {"heights": HEIGHTS[:4]}, None, "has 24 heights, but its head says 5 rows of 6 heights"),
    "degrees": (ascii_grid, {"cell": 0.0002}, None, "is in degrees, but the flight is not on the map; give geo.origin"),
    "tiff of words": (ascii_grid, {"head": "<html> "}, None, "is no GeoTIFF that can be read"),
    "empty": (tiff, {"heights": np.full((5, 6), -9999.0)}, None, "has no heights"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_one_line(case, tmp_path):
    write, options, place, told = REFUSED[case]
    path = write(tmp_path / ("dem.tif" if "tiff" in case or write is tiff else "dem.asc"), **options)
    with pytest.raises(InputError, match=rf"^ground\.file: \S+dem\.\w+: {told}") as caught:
        terrain, (remark,) = read(path)
        assert ("5 are missing, the first in row 1, column 1" in remark) == (case == "nodata")
        terrain.find_heights(np.array([place]), "UAV 0")
    assert "\n" not in str(caught.value)


def test_a_missing_library_or_file_and_two_heights_of_the_ground_are_named(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=re.escape("geo.ground: not allowed with ground.file")):
        read(ascii_grid(tmp_path / "dem.asc"), Geo(ground=100.0))
    for name in ("none.asc", "none.tif"):
        with pytest.raises(InputError, match=rf"^ground\.file: {name}: .*(cannot be read|No such file)"):
            read(SimpleNamespace(parent=tmp_path, name=name))
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    with pytest.raises(InputError, match="needs rasterio: pip install rasterio; or give an ESRI ASCII grid"):
        read(tiff(tmp_path / "dem.tif"))
