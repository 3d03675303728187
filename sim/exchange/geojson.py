"""Layers for maps: tracks, people, UAVs and losses of a recording as GeoJSON."""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.exchange.values import list_rows, list_tracks, list_truth
from sim.facts.flight import Flight
from sim.mission.recording import Recording
from sim.scenario.geo import Geo

_PERSON = ("person", "time", "x", "y")
_DIGITS = 9  # of degrees, a tenth of a millimetre


def write_geojson(recording: Recording, folder: Path) -> None:
    """Write `tracks.geojson`, `people.geojson`, `uavs.geojson` and `losses.geojson`, with times in seconds.

    Tracks are those that are reported. Lines have the times of their points as a property.
    """
    geo = recording.setting.geo
    tracks = list_tracks(recording)
    rows = list_rows(tracks, ("uav", "id", "time", "x", "y"), np.asarray(tracks["reported"]))
    _write(folder / "tracks.geojson", _make_lines(("uav", "id"), rows, geo))
    _write(folder / "people.geojson", _make_lines(("person",), list_rows(list_truth(recording), _PERSON), geo))
    works = zip(*np.nonzero(recording.working), strict=True)
    flown = ((int(i), float(recording.times[k]), *recording.believed_cameras[k, i, :2].tolist()) for k, i in works)
    _write(folder / "uavs.geojson", _make_lines(("uav",), flown, geo))
    losses = []
    table = Flight(recording).columns("losses")
    for row in list_rows(table, tuple(table)):
        own = dict(zip(table, row, strict=True))
        k = int(np.abs(recording.times - own["from_s"]).argmin())
        losses.append(_make_feature("Point", recording.people[k, own["person"]][None], own, geo))
    _write(folder / "losses.geojson", losses)


def _make_lines(keys: Sequence[str], rows: Iterator[tuple[Any, ...]], geo: Geo) -> list[dict[str, Any]]:
    """A line for all rows of the same `keys`, which stand before time [s] and place [m]."""
    found: defaultdict[tuple[int, ...], list[list[float]]] = defaultdict(list)
    for row in sorted(rows):
        found[row[: len(keys)]].append(list(row[len(keys) :]))
    lines = []
    for own, points in found.items():
        times, places = [point[0] for point in points], np.array(points)[:, 1:]
        facts = dict(zip(keys, own, strict=True)) | {"from_s": times[0], "until_s": times[-1], "times_s": times}
        lines.append(_make_feature("LineString" if len(times) > 1 else "Point", places, facts, geo))
    return lines


def _make_feature(kind: str, places: Any, facts: dict[str, Any], geo: Geo) -> dict[str, Any]:  # noqa: ANN401 - array
    points = geo.find_degrees(places)[:, ::-1].round(_DIGITS).tolist()
    return {
        "type": "Feature",
        "geometry": {"type": kind, "coordinates": points if kind == "LineString" else points[0]},
        "properties": facts,
    }


def _write(path: Path, features: list[dict[str, Any]]) -> None:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
