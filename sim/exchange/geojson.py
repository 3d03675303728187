"""Layers for maps: tracks, people, UAVs and losses of a recording as GeoJSON."""

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from sim.facts.flight import Flight
from sim.mission.recording import Recording

_POINT = ("time_s", "x_m", "y_m")
_DIGITS = 9  # of degrees, a tenth of a millimetre
_LAYERS = {"tracks": ("uav", "track"), "people": ("person",), "uavs": ("uav",)}  # tables, and what a line is of


def write_geojson(recording: Recording, folder: Path) -> None:
    """Write `tracks.geojson`, `people.geojson`, `uavs.geojson` and `losses.geojson`, with times in seconds.

    Tracks are those that are reported. Lines have the times of their points as a property. Losses are points.
    """
    geo, flight = recording.setting.geo, Flight(recording)
    layers = defaultdict[str, list[dict[str, Any]]](list)

    def add(layer: str, places: Any, facts: dict[str, Any]) -> None:  # noqa: ANN401 - an array
        points = geo.find_degrees(np.array(places))[:, ::-1].round(_DIGITS).tolist()
        kind, points = ("LineString", points) if len(points) > 1 else ("Point", points[0])
        geometry = {"type": kind, "coordinates": points}
        layers[layer].append({"type": "Feature", "geometry": geometry, "properties": facts})

    for layer, keys in _LAYERS.items():
        columns = flight.columns(layer)
        lines = defaultdict[tuple[int, ...], list[tuple[float, ...]]](list)
        shown = {"tracks": recording.reported, "uavs": recording.working.ravel()}
        rows = np.flatnonzero(shown.get(layer, np.ones(len(columns["x_m"]), dtype=np.bool_)))
        for *own, time, x, y in zip(*(columns[name][rows].tolist() for name in (*keys, *_POINT)), strict=True):
            lines[tuple(own)].append((time, x, y))
        for line, points in sorted(lines.items()):
            times = [time for time, *_ in points]
            facts = {"from_s": times[0], "until_s": times[-1], "times_s": times}
            add(layer, [place for _, *place in points], {**dict(zip(keys, line, strict=True)), **facts})
    losses = flight.columns("losses")
    for values in zip(*(column.tolist() for column in losses.values()), strict=True):
        loss = dict(zip(losses, values, strict=True))
        k = int(np.abs(recording.times - loss["from_s"]).argmin())
        add("losses", [recording.people[k, loss["person"]]], loss)
    for layer in (*_LAYERS, "losses"):
        text = json.dumps({"type": "FeatureCollection", "features": layers[layer]})
        (folder / f"{layer}.geojson").write_text(text, encoding="utf-8")
