"""The ground of a flight: flat, or with heights from a file, an ESRI ASCII grid or a GeoTIFF."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario.geo import Geo, Ground
from sim.scenario.text_files import read_text
from tracking.detection.detection_errors import whole_covariances
from tracking.errors import InputError, one_line, spell
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import PERSON_HEIGHT, TARGET_HEIGHT
from tracking.geometry.surface import Surface, find_ground, lay_on_ground, meet_ground
from tracking.numerics.arrays import Array

_LARGEST = 400_000_000  # bytes of a file
_KEYS = ("ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx", "dy", "nodata_value")
_DEGREES = 0.01  # edge of cells below which coordinates are degrees
_NEAR = 1000.0  # m from the origin, within which coordinates of the map are taken to be linear in metres
_RAYS = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 1.0, 7)]), axis=-1).reshape(-1, 2)  # shares of an image's edges
_FEWEST = 6  # rays that have to meet the ground


class _Grid(NamedTuple):
    """Heights in a file."""

    heights: Array  # (R, C) m, NaN where they are not known
    matrix: Array  # (2, 3): coordinates of a point of the grid are matrix @ (column, row, 1)
    crs: str | int | None  # EPSG code or WKT of these coordinates, if the file tells it


@dataclass(frozen=True, eq=False)
class Terrain:
    """The ground of a flight; without a `surface` it is flat."""

    height: float | None = None  # m above sea level of flat ground, if it is known
    surface: Surface | None = None
    error: float = 0.0  # m, standard deviation of the surface's heights
    where: str = ""
    matrix: Array = field(default_factory=lambda: np.zeros((2, 3)))  # as of `_Grid`

    @property
    def is_known(self) -> bool:
        """True if heights above sea level say how high above the ground they are."""
        return self.height is not None or self.surface is not None

    def find_heights(self, places: Array, who: str) -> Array:
        """Heights (N,) m above sea level at places (N, 2) m, where `who` is; InputError where none is known."""
        if self.surface is None:
            return np.full(len(places), self.height or 0.0)
        heights = find_ground(self.surface, np.ascontiguousarray(places))[:, 0]
        if np.isnan(heights).any():
            raise InputError(f"{self.where}: {self._tell_lack(self.surface, places[np.isnan(heights)][0], who)}")
        return np.asarray(heights)

    def raise_poses(self, poses: Array, who: str) -> Array:
        """Poses (N, 7) of `who` with heights above sea level, of those with heights above the ground below."""
        if self.surface is None:
            return poses
        return np.asarray(poses + self.find_heights(poses[:, :2], who)[:, None] * (np.arange(7) == 2))

    def find_places(self, camera: Camera, pose: Pose, pixels: Array) -> Array:
        """Places (N, 2) m of people whose mid-height a raised camera has at pixels (N, 2); NaN where no ground is."""
        if self.surface is None:
            return camera.ground_points(pose, pixels, TARGET_HEIGHT)
        return meet_ground(self.surface, pose.position, camera.rays(pose, pixels), TARGET_HEIGHT)

    def find_covariances(self, camera: Camera, pose: Pose, places: Array) -> Array:
        """Covariances (N, 2, 2) m² of people seen whole from a raised pose, on level ground at places (N, 2) m."""
        if self.surface is None:
            return whole_covariances(camera.lens(pose), places)
        found = np.empty((len(places), 2, 2))
        for k, height in enumerate(find_ground(self.surface, places)[:, 0].tolist()):
            above = Pose(pose.position - [0.0, 0.0, height], pose.quaternion)
            found[k] = whole_covariances(camera.lens(above), places[k : k + 1])[0]
        return found

    def lay(self, pose: Pose, places: Array, covariances: Array) -> Array:
        """Covariances (N, 2, 2) m² on the ground at places (N, 2) m, from those on level ground there."""
        if self.surface is None:
            return covariances
        return lay_on_ground(self.surface, pose.position, places, TARGET_HEIGHT, covariances, self.error)

    def level(self, camera: Camera, pose: Pose) -> Pose:
        """The pose over flat ground that shows people where the camera shows them from a raised pose, as far as it may.

        Heights count from the plane that fits the ground in view best. Seen from there, with people and trees on flat
        ground, what is in line stays in line. The attitude is turned so that the image has the same places, in the
        least squares.
        """
        if self.surface is None:
            return pose
        rays = camera.rays(pose, camera.shown(_RAYS * camera.size))
        places = meet_ground(self.surface, pose.position, rays, TARGET_HEIGHT)
        met = ~np.isnan(places[:, 0])
        away, eye = places[met] - pose.position[:2], pose.position.copy()
        if len(away) >= _FEWEST:
            plane = np.column_stack([np.ones(len(away)), away])
            heights = find_ground(self.surface, places[met])[:, 0]
            eye[2] -= np.linalg.lstsq(plane, heights, rcond=None)[0][0]
        if len(away) < _FEWEST or eye[2] <= PERSON_HEIGHT:
            eye[2] = pose.position[2] - find_ground(self.surface, pose.position[None, :2])[0, 0]
            return Pose(eye, pose.quaternion)
        sights = np.column_stack([away, np.full(len(away), TARGET_HEIGHT - eye[2])])
        units = [vectors / np.linalg.norm(vectors, axis=1)[:, None] for vectors in (sights, rays[met])]
        turn, _ = Rotation.align_vectors(*units)
        return Pose(eye, np.asarray((turn * Rotation.from_quat(pose.quaternion)).as_quat()))

    def _tell_lack(self, surface: Surface, place: Array, who: str) -> str:
        """What to change if a place (2,) m, where `who` is, has no height."""
        heights = surface.heights
        column, row = (float(a + b * place[0] + c * place[1]) for a, b, c in (surface.column, surface.row))
        east, north = self._name(column, row)
        if 0 <= column <= heights.shape[1] - 1 and 0 <= row <= heights.shape[0] - 1:
            near = heights[int(row) : int(row) + 2, int(column) : int(column) + 2]
            i, j = np.argwhere(np.isnan(near))[0] + (int(row), int(column))
            lacking = f"has no height (nodata) in row {i + 1}, column {j + 1}, near {east}, {north}"
            return f"{lacking}, where {who} is; fill such cells, or give a file that has them"
        ends = [self._name(*end) for end in ((0, heights.shape[0] - 1), (heights.shape[1] - 1, 0))]
        reach = f"does not cover the flight: it reaches from {', '.join(ends[0])} to {', '.join(ends[1])}"
        hint = "give a file with all that cameras see, in the coordinates of the flight's files, or their geo.epsg"
        return f"{reach}, and {who} is at {east}, {north}; {hint}"

    def _name(self, column: float, row: float) -> list[str]:
        """Coordinates of a point of the grid, in the file's own system."""
        return [spell(part, 9) for part in (self.matrix @ (column, row, 1.0)).round(6).tolist()]

    def moved(self, origin: tuple[float, float]) -> "Terrain":
        """The same ground, if places count from an origin [m]."""
        if self.surface is None:
            return self
        (a, b, c), (d, e, f), (x, y) = self.surface.column, self.surface.row, origin
        surface = self.surface._replace(column=(a + b * x + c * y, b, c), row=(d + e * x + f * y, e, f))
        return replace(self, surface=surface)


UNKNOWN_GROUND = Terrain()


def read_terrain(folder: Path, ground: Ground, geo: Geo) -> tuple[Terrain, list[str]]:
    """The ground of a flight in a folder, and what was read of `ground.file` in one line.

    geo: where the flight's places are on the map, if they are.
    """
    if not ground.file:
        return Terrain(geo.ground), []
    path = folder / ground.file if (folder / ground.file).exists() else Path(ground.file)
    where = f"ground.file: {path}"
    if geo.ground is not None:
        raise InputError(f"geo.ground: not allowed with {where}, which has the heights of the ground")
    grid = _read_ascii(path, where) if path.suffix.lower() in (".asc", ".txt", ".grd") else _read_tiff(path, where)
    if min(grid.heights.shape) < 2 or np.isnan(grid.heights).all():
        raise InputError(f"{where}: has no heights of 2 × 2 points or more")
    near = np.array([[0.0, 0.0], [_NEAR, 0.0], [-_NEAR, 0.0], [0.0, _NEAR], [0.0, -_NEAR]])
    columns, rows = np.linalg.solve(
        grid.matrix[:, :2], (_find_coordinates(grid, near, geo, where) - grid.matrix[:, 2]).T
    )
    slopes = [(index[[1, 3]] - index[[2, 4]]) / (2 * _NEAR) for index in (columns, rows)]
    column, row = ((float(i[0]), *slope.tolist()) for i, slope in zip((columns, rows), slopes, strict=True))
    terrain = Terrain(None, Surface(grid.heights, column, row), ground.error, where, grid.matrix)
    (i, j), unknown = grid.heights.shape, np.argwhere(np.isnan(grid.heights))
    ends = " to ".join(spell(float(end), 5) for end in (np.nanmin(grid.heights), np.nanmax(grid.heights)))
    told = f"{where}: {i} × {j} heights from {ends} m, which err by {ground.error:g} m (ground.error)"
    if len(unknown):
        told += f"; {len(unknown)} are missing, the first in row {unknown[0, 0] + 1}, column {unknown[0, 1] + 1}"
    return terrain, [told]


def _find_coordinates(grid: _Grid, places: Array, geo: Geo, where: str) -> Array:
    """Coordinates (N, 2) of places (N, 2) m in the system of a grid: that which it tells, or that of the files."""
    degrees = np.abs(np.linalg.det(grid.matrix[:, :2])) < _DEGREES * _DEGREES
    crs = grid.crs or geo.epsg or (4326 if degrees else None)
    if geo.origin is None and degrees:
        raise InputError(
            f"{where}: is in degrees, but the flight is not on the map; give geo.origin, or a file in metres"
        )
    if geo.origin is None or crs is None:
        return places
    latitudes, longitudes = geo.find_degrees(places).T
    return np.column_stack(geo.project(latitudes, longitudes, crs))


def _read_ascii(path: Path, where: str) -> _Grid:
    """Heights in an ESRI ASCII grid, whose first row is the northernmost."""
    words = read_text(path, where, _LARGEST).split()
    head: dict[str, float] = {}
    try:
        while len(words) > 2 * len(head) and (key := words[2 * len(head)].lower()) in _KEYS:
            head[key] = float(words[2 * len(head) + 1])
        values = np.array(words[2 * len(head) :], dtype=float)
    except ValueError as error:
        raise InputError(f"{where}: is no ESRI ASCII grid: {one_line(error)}") from error
    right, up = (head.get(f"d{axis}", head.get("cellsize", 0.0)) for axis in "xy")
    west, south = (head.get(f"{axis}llcenter", head.get(f"{axis}llcorner", np.nan)) for axis in "xy")
    if not {"ncols", "nrows"} <= {*head} or not np.isfinite(west + south) or not min(right, up) > 0:
        raise InputError(
            f"{where}: is no ESRI ASCII grid: expected ncols, nrows, xllcorner, yllcorner, cellsize, heights"
        )
    if len(values) != head["ncols"] * head["nrows"]:
        size = f"{spell(head['nrows'])} rows of {spell(head['ncols'])} heights"
        raise InputError(f"{where}: has {len(values)} heights, but its head says {size}")
    heights = values.reshape(int(head["nrows"]), int(head["ncols"]))
    heights[heights == head.get("nodata_value", -9999.0)] = np.nan
    west += right / 2 * ("xllcorner" in head)
    north = south + up / 2 * ("yllcorner" in head) + (len(heights) - 1) * up
    return _Grid(heights, np.array([[right, 0.0, west], [0.0, -up, north]]), None)


def _read_tiff(path: Path, where: str) -> _Grid:
    """Heights in a GeoTIFF, or another raster that GDAL reads."""
    try:
        import rasterio
    except ImportError as error:
        raise InputError(f"{where}: needs rasterio: pip install rasterio; or give an ESRI ASCII grid, .asc") from error
    try:
        with rasterio.open(path) as file:
            heights = file.read(1, masked=True).astype(float).filled(np.nan)
            a, b, c, d, e, f = file.transform[:6]
            crs = (file.crs.to_epsg() or file.crs.to_wkt()) if file.crs else None
    except rasterio.errors.RasterioError as error:
        raise InputError(f"{where}: is no GeoTIFF that can be read: {one_line(error)}") from error
    matrix = np.array([[a, b, c + (a + b) / 2], [d, e, f + (d + e) / 2]])
    return _Grid(np.ascontiguousarray(heights), matrix, crs)
