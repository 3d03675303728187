"""Places of the features in GeoJSON files: in degrees, in projected coordinates, or in metres."""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from sim.scenario.geo import Geo
from tracking.errors import InputError
from tracking.numerics.arrays import Array

SUFFIXES = (".geojson", ".json")
_DEGREES = 4326  # code of latitude and longitude
_WIDEST = 1.0  # extent of a file in degrees; in metres no forest is as small


def load_features(text: str, name: str, geo: Geo) -> tuple[list[dict[str, Any]], int | None]:
    """Features of a GeoJSON text, and the EPSG code of their coordinates, or None if these are metres.

    The code is that of `crs`, of degrees if all places are less than a degree apart, or else `geo.epsg`. Projected
    coordinates are metres if the map has neither an origin nor a code. InputError begins with `name`.
    """
    try:
        data = json.loads(text)
        features = list(data["features"])
        crs = re.search(r"EPSG:+(\d+)$|CRS84$", str((data.get("crs") or {}).get("properties", {}).get("name")))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{name}: is no FeatureCollection of GeoJSON") from error
    places = list_places(features)
    degrees = len(places) > 0 and np.all(np.abs(places) <= 180) and np.ptp(places, axis=0).max() < _WIDEST
    code = int(crs[1] or _DEGREES) if crs else _DEGREES if degrees else geo.epsg
    return features, code if code == _DEGREES or geo.epsg or geo.origin else None


def list_places(features: Sequence[dict[str, Any]]) -> Array:
    """All places (N, 2) of features, x or longitude first; none if one of them is wrong."""

    def walk(part: Any) -> Iterator[Any]:  # noqa: ANN401 - nested lists of JSON
        if isinstance(part[0], list):
            for inner in part:
                yield from walk(inner)
        else:
            yield part[:2]

    try:
        found = [place for feature in features for place in walk(feature["geometry"]["coordinates"])]
        return np.array(found, dtype=float).reshape(-1, 2)
    except (ValueError, KeyError, TypeError, IndexError, RecursionError):
        return np.zeros((0, 2))


def find_degrees(places: Array, code: int) -> tuple[Array, Array]:
    """Latitudes and longitudes (N,) deg of places (N, 2) with an EPSG code."""
    x, y = places.T
    return (y, x) if code == _DEGREES else Geo(epsg=code).unproject(x, y)
