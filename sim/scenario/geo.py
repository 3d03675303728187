"""Places on the map, by WGS 84 or an EPSG code, as metres to the east and north of an origin; and GPX files."""

import csv
import io
import math
import re
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any
from xml.etree import ElementTree

import numpy as np
from msgspec import Meta, Struct

from tracking.errors import InputError, one_line, spell
from tracking.numerics.arrays import Array
from tracking.numerics.trigonometry import cos, cos_each, hypot, sin, sin_each

_A, _E2 = 6378137.0, 0.0066943799901413165  # m, semi-major axis of WGS 84, and its squared eccentricity
_DEGREE = math.pi / 180
_Wave = Callable[[Any], Any]  # sine or cosine of numbers, or of arrays
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
        given = (np.asarray(values, dtype=float) for values in (latitudes, longitudes))
        return np.column_stack(self._find_metres(sin_each, cos_each, *given)).round(_DIGITS) + 0.0

    def _find_metres(self, sine: _Wave, cosine: _Wave, latitude: Any, longitude: Any) -> tuple[Any, Any]:  # noqa: ANN401
        """East and north [m] of places [deg], numbers or arrays, by the functions for these."""
        assert self.origin
        x, y, z = _find_point(sine, cosine, latitude, longitude)
        (u, v, w), s, c, t, d = _find_frame(self.origin)
        x, y, z = x - u, y - v, z - w
        return d * y - t * x, c * z - s * (d * x + t * y)

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
        swapped = "are latitude and longitude swapped? (the first file gives geo.origin by default)"
        if not abs(latitude) <= 90:
            raise ValueError(f"a latitude of {spell(latitude)} is not allowed, but -90 to 90; {swapped}")
        if self.origin is None:
            raise ValueError("is a place on the map; geo.origin = [latitude, longitude] gives the area's centre")
        x, y = self._find_metres(sin, cos, latitude, longitude)
        if not max(abs(x), abs(y)) <= FARTHEST:
            away = f"{spell(latitude, 8)}, {spell(longitude, 8)} is {hypot(x, y) / 1000:.1f} km from geo.origin"
            origin = ", ".join(spell(part, 8) for part in self.origin)
            other = self._find_metres(sin, cos, longitude, latitude)
            hint = swapped if max(map(abs, other)) <= FARTHEST else "files of a mission or flight have one origin"
            raise ValueError(f"{away}, {origin}; {FARTHEST / 1000:g} km are allowed; {hint}")
        return round(float(x), _DIGITS) + 0.0, round(float(y), _DIGITS) + 0.0

    def project(self, latitudes: Array, longitudes: Array, crs: int | str) -> tuple[Array, Array]:
        """Coordinates x and y (N,) by an EPSG code, or a text of WKT, of places (N,) deg; InputError without pyproj."""
        x, y = _make_converter(crs).transform(longitudes, latitudes, direction="INVERSE")
        return np.asarray(x), np.asarray(y)


NOWHERE_ON_THE_MAP = Geo()


class Ground(Struct, frozen=True, forbid_unknown_fields=True):
    """Ground that is not flat, of a flight that `understory track` reads."""

    # heights [m] above sea level as an ESRI ASCII grid (`.asc`) or a GeoTIFF (`pip install -e '.[geo]'`), in the
    # coordinates of the flight's files or on the map; relative to the flight's folder, or to the current one
    file: str = ""
    error: Annotated[float, Meta(ge=0, le=100)] = 0.3  # m, standard deviation of these heights


@cache
def _make_converter(epsg: int | str) -> Any:  # noqa: ANN401 - of pyproj, which may not be there
    """What converts projected coordinates to longitudes and latitudes."""
    try:
        from pyproj import Transformer
        from pyproj.exceptions import CRSError
    except ImportError as error:
        raise InputError("geo.epsg: needs pyproj: pip install pyproj") from error
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


@cache
def _find_frame(origin: tuple[float, float]) -> tuple[Any, ...]:
    """The point of the ellipsoid at an origin [deg], and sines and cosines of its latitude and longitude."""
    lat, lon = _DEGREE * origin[0], _DEGREE * origin[1]
    return _find_point(sin, cos, *origin), sin(lat), cos(lat), sin(lon), cos(lon)


def _find_point(sine: _Wave, cosine: _Wave, latitude: Any, longitude: Any) -> tuple[Any, Any, Any]:  # noqa: ANN401
    """Point [m] of the ellipsoid, from its centre, of a place [deg]."""
    lat, lon = _DEGREE * latitude, _DEGREE * longitude
    s, c = sine(lat), cosine(lat)
    across = _A / np.sqrt(1.0 - _E2 * s * s)
    return across * c * cosine(lon), across * c * sine(lon), across * (1.0 - _E2) * s


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
