"""Places on the map, by WGS 84 or an EPSG code, as metres to the east and north of an origin; and GPX files."""

import csv
import io
import math
import re
from functools import cache
from typing import Annotated, Any
from xml.etree import ElementTree

import numpy as np
from msgspec import Meta, Struct

from tracking.errors import InputError, one_line, spell
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import cos_each, hypot, sin_each

_A, _E2 = 6378137.0, 0.0066943799901413165  # m, semi-major axis of WGS 84, and its squared eccentricity
_DEGREE = math.pi / 180
_DIGITS = 6  # of metres, so that all processors and libraries give the same
FARTHEST = 9_000.0  # m, of places from the origin
LATITUDES = ("latitude", "lat", "latitude_deg", "lat_deg", "gps_latitude", "gps_lat", "decimallatitude")
LONGITUDES = (
    *("longitude", "lon", "lng", "long", "longitude_deg", "lon_deg", "gps_longitude", "gps_lon", "decimallongitude"),
)


class Geo(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a mission or flight is on the map."""

    # deg, `[latitude, longitude]` (WGS 84) of the area's centre; by default the middle of the first file on the map
    origin: tuple[Annotated[float, Meta(ge=-89, le=89)], Annotated[float, Meta(ge=-180, le=180)]] | None = None
    # code such as 25832 of the coordinates x and y in files, if they are projected; `pip install -e '.[geo]'`
    epsg: Annotated[int, Meta(ge=1024, le=999_999)] | None = None
    # m, height of the ground above the sea, for files with heights above the sea
    ground: Annotated[float, Meta(ge=-500, le=9000)] | None = None

    def find_metres(self, latitudes: Array, longitudes: Array) -> Array:
        """Places (N, 2) m to the east and north of the origin, in its tangential plane, of places (N,) deg."""
        assert self.origin
        (at,), angles = _find_points(*np.array(self.origin)[:, None]), _DEGREE * np.array(self.origin)
        (s, t), (c, d) = sin_each(angles), cos_each(angles)
        apart = _find_points(np.asarray(latitudes, dtype=float), np.asarray(longitudes, dtype=float)) - at
        x, y, z = apart.T
        return np.column_stack([d * y - t * x, c * z - s * (d * x + t * y)]).round(_DIGITS) + 0.0

    def find_degrees(self, places: Array) -> Array:
        """Latitudes and longitudes (N, 2) deg of places (N, 2) m."""
        assert self.origin
        found = np.tile(np.array(self.origin, dtype=float), (len(places), 1))
        for _ in range(6):  # each step adds four digits
            off = np.asarray(places) - self.find_metres(*found.T)
            s, c = sin_each(_DEGREE * found[:, 0]), cos_each(_DEGREE * found[:, 0])
            w = 1.0 - _E2 * s * s
            across = _A / np.sqrt(w)
            found[:, 0] += off[:, 1] * w / (across * (1.0 - _E2)) / _DEGREE
            found[:, 1] += off[:, 0] / (across * c) / _DEGREE
        return found

    def unproject(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Latitudes and longitudes (N,) deg of projected coordinates (N,); InputError without pyproj."""
        lon, lat = _make_converter(self.epsg or 4326).transform(x, y)
        return np.asarray(lat), np.asarray(lon)

    def place(self, latitude: float, longitude: float) -> tuple[float, float]:
        """One place [m]; ValueError if it is none, or far from the origin."""
        swapped = "are latitude and longitude swapped?"
        if not abs(latitude) <= 90:
            raise ValueError(f"a latitude of {spell(latitude)} is not allowed, but -90 to 90; {swapped}")
        if self.origin is None:
            raise ValueError("is a place on the map; geo.origin = [latitude, longitude] gives the area's centre")
        x, y = self.find_metres(np.array([latitude]), np.array([longitude]))[0].tolist()
        if not max(abs(x), abs(y)) <= FARTHEST:
            away = f"{spell(latitude, 8)}, {spell(longitude, 8)} is {hypot(x, y) / 1000:.1f} km from geo.origin"
            origin = ", ".join(spell(part, 8) for part in self.origin)
            other = self.find_metres(np.array([longitude]), np.array([latitude]))[0]
            hint = swapped if np.abs(other).max() <= FARTHEST else "files of a mission or flight have one origin"
            raise ValueError(f"{away}, {origin}; {FARTHEST / 1000:g} km are allowed; {hint}")
        return x, y


NOWHERE_ON_THE_MAP = Geo()


@cache
def _make_converter(epsg: int) -> Any:  # noqa: ANN401 - of pyproj, which may not be there
    """What converts projected coordinates to longitudes and latitudes."""
    try:
        from pyproj import Transformer
        from pyproj.exceptions import CRSError
    except ImportError as error:
        raise InputError("geo.epsg: needs pyproj: pip install 'understory[geo]'") from error
    try:
        return Transformer.from_crs(epsg, 4326, always_xy=True)
    except CRSError as error:
        raise InputError(f"geo.epsg: {epsg} is no code of coordinates: {one_line(error)}") from error


def tell_origin(geo: Geo, source: str = "") -> str:
    """Where the origin is, in one line; empty without one."""
    if geo.origin is None:
        return ""
    place = ", ".join(spell(part, 9) for part in geo.origin)
    return f"geo.origin: places are metres to the east and north of {place} (WGS 84){source}"


def _find_points(latitudes: Array, longitudes: Array) -> Array:
    """Points (N, 3) m of the ellipsoid, from its centre, of places (N,) deg."""
    lat, lon = _DEGREE * latitudes, _DEGREE * longitudes
    s, c = sin_each(lat), cos_each(lat)
    across = _A / np.sqrt(1.0 - _E2 * s * s)
    return np.column_stack([across * c * cos_each(lon), across * c * sin_each(lon), across * (1.0 - _E2) * s])


def read_gpx(text: str, name: str) -> str:
    """The points of a GPX file as a table with the columns time, id, latitude, longitude and maybe altitude_m.

    The id is the name of a point's track, or the number of the track. InputError begins with `name`.
    """
    try:
        root = ElementTree.fromstring(re.sub(r'\sxmlns="[^"]*"', "", text, count=1))
    except ElementTree.ParseError as error:
        raise InputError(f"{name}: is no GPX that can be read: {error}") from error
    rows: list[list[str]] = []
    for n, track in enumerate(root.findall("trk")):
        for point in track.iter("trkpt"):
            person = (track.findtext("name") or str(n)).strip()
            place = [point.get(key) or "" for key in ("lat", "lon")]
            rows.append([point.findtext("time") or "", person, *place, point.findtext("ele") or ""])
    if not rows:
        raise InputError(f"{name}: has no tracks; expected trk with trkpt and time")
    count = 5 if all(row[4] for row in rows) else 4
    table = io.StringIO()
    header = ["time", "id", "latitude", "longitude", "altitude_m"]
    csv.writer(table, lineterminator="\n").writerows(row[:count] for row in [header, *rows])
    return table.getvalue()
