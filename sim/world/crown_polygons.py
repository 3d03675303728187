"""Crowns as polygons in GeoJSON files, taken as circles of equal area."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from sim.scenario.csv_tables import TableRow
from sim.scenario.geo import Geo
from sim.scenario.map_features import find_degrees, load_features
from tracking.errors import InputError, spell
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.trigonometry import arctan2

OUTLINES = "polygons"  # what radii of polygons come from
_SMALLEST = 0.01  # m², area of a crown


class Features(NamedTuple):
    """Trees of a GeoJSON file."""

    rows: list[TableRow]  # a feature each
    differences: list[float]  # area between each polygon and its circle, as a share of the area of either


def read_features(text: str, name: str, translate: Callable[[Sequence[str]], list[str]], geo: Geo) -> Features:
    """The trees of a GeoJSON text: points, or centroids of polygons with the radii of circles of equal area.

    name: what errors begin with. translate: gives columns for names of properties. geo: where the map is.
    """
    features, code = load_features(text, name, geo)
    found: list[tuple[dict[str, str], dict[str, str]]] = []
    differences: list[float] = []
    for n, feature in enumerate(features, 1):
        where = f"{name}, feature {n}"
        try:
            shape, own = feature["geometry"], feature["properties"] or {}
            columns = translate(list(own))
            values = {key: _write(entry) for key, entry in zip(columns, own.values(), strict=True)}
            names = {key: given for key, given in zip(columns, own, strict=True) if key not in (given, "x", "y")}
            place = _find_place(shape, where, geo, code)
        except InputError:
            raise
        except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
            raise InputError(f"{where}: is no point or polygon of numbers with properties") from error
        values |= {"x": repr(place.x), "y": repr(place.y)}
        if place.radius:
            values["crown_radius"], names["crown_radius"] = repr(place.radius), OUTLINES
            differences.append(place.difference)
        found.append((values, names))
    every = dict.fromkeys(key for values, _ in found for key in values)
    rows = [
        TableRow(f"{name}, feature {n}", n, {key: values.get(key, "") for key in every}, names, on_map=code is not None)
        for n, (values, names) in enumerate(found, 1)
    ]
    return Features(rows, differences)


class _Place(NamedTuple):
    x: float
    y: float
    radius: float = 0.0  # 0 for a point
    difference: float = 0.0


def _write(entry: object) -> str:
    return "" if entry is None else str(int(entry) if isinstance(entry, bool) else entry)


def _find_place(shape: dict[str, Any], where: str, geo: Geo, code: int | None) -> _Place:
    kind, given = shape["type"], shape["coordinates"]
    if kind == "Point":
        return _Place(*_find_metres([given], where, geo, code)[0].tolist())
    if kind not in ("Polygon", "MultiPolygon"):
        raise InputError(f"{where}: is a {kind}; expected a Point, Polygon or MultiPolygon")
    # The first ring of a polygon is its outline, anticlockwise here, and the others are holes, clockwise.
    rings = [
        _orient(_find_metres(ring, where, geo, code), hole=k > 0)
        for polygon in ([given] if kind == "Polygon" else given)
        for k, ring in enumerate(polygon)
    ]
    start = rings[0][0]
    moments = np.sum([_integrate(ring - start) for ring in rings], axis=0)
    area = float(moments[0])
    if not area >= _SMALLEST:  # also if it is no number
        raise InputError(f"{where}: a crown of {spell(area, 2)} m²; {_SMALLEST:g} m² or more are allowed")
    centre, radius = start + moments[1:] / area, math.sqrt(area / math.pi)
    common = math.fsum(overlap_circle(ring - centre, radius) for ring in rings)
    return _Place(float(centre[0]), float(centre[1]), radius, 2.0 * (1.0 - common / area))


def _find_metres(points: Sequence[Any], where: str, geo: Geo, code: int | None) -> Array:
    """Places (N, 2) m of points with an EPSG code; None: of metres."""
    places = np.array([point[:2] for point in points], dtype=float)
    if code is None:
        return places
    latitudes, longitudes = find_degrees(places, code)
    try:
        geo.place(float(latitudes[0]), float(longitudes[0]))
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    return geo.find_metres(latitudes, longitudes)


def _orient(ring: Array, *, hole: bool) -> Array:
    return ring[::-1] if (_integrate(ring - ring[0])[0] < 0.0) != hole else ring


def _integrate(ring: Array) -> Array:
    """Area, and integrals of x and y over it (3,); positive if the ring (V, 2) runs anticlockwise."""
    after = np.roll(ring, -1, axis=0)
    cross = ring[:, 0] * after[:, 1] - after[:, 0] * ring[:, 1]
    return np.array([cross.sum() / 2, *((ring + after) * cross[:, None]).sum(axis=0) / 6])


@compiled
def overlap_circle(ring: Array, radius: float) -> float:
    """Area that a ring (V, 2) shares with a circle about the origin; negative if the ring runs clockwise."""
    total, square = 0.0, radius * radius
    for k in range(len(ring)):
        ax, ay = ring[k - 1, 0], ring[k - 1, 1]
        dx, dy = ring[k, 0] - ax, ring[k, 1] - ay
        length, along = dx * dx + dy * dy, ax * dx + ay * dy
        root = along * along - length * (ax * ax + ay * ay - square)
        enters, leaves = 0.0, 0.0  # of the edge, as shares of its length: where it is in the circle
        if root > 0.0 and length > 0.0:
            enters = min(max((-along - math.sqrt(root)) / length, 0.0), 1.0)
            leaves = min(max((-along + math.sqrt(root)) / length, 0.0), 1.0)
        px, py, qx, qy = ax + enters * dx, ay + enters * dy, ax + leaves * dx, ay + leaves * dy
        bx, by = ring[k, 0], ring[k, 1]
        total += (px * qy - py * qx) / 2
        total += square / 2 * arctan2(ax * py - ay * px, ax * px + ay * py)
        total += square / 2 * arctan2(qx * by - qy * bx, qx * bx + qy * by)
    return total
