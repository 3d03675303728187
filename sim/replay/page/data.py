"""Data for the script of a mission's page: plain numbers by scan, rounded to centimetres."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.drawing import palette
from sim.drawing.layout import Parts
from sim.drawing.map_view import ELLIPSE, MARGIN, TRAIL, footprint
from sim.recording.recording import Recording
from sim.replay.event import IDENTITIES, lanes
from sim.replay.flight import Flight


def page_data(flight: Flight, parts: Parts | None) -> dict[str, Any]:
    """The content of the page's JSON; parts: those of the film, or None without a film.

    Lists run over scans, then UAVs, then people or tracks; null means absent or broken down.
    """
    recording, scenario, history, events = flight.recording, flight.scenario, flight.history, flight.events
    view_texts = [history.view_texts(m) for m in range(recording.people.shape[1])]
    texts = {text: n for n, text in enumerate(dict.fromkeys(text for column in view_texts for text in column))}
    return {
        "area": [scenario.area.width, scenario.area.height],
        "margin": MARGIN,
        "rate": scenario.rates.sensing,
        "trail": round(TRAIL * scenario.rates.sensing),
        "times": _round(recording.times, 3),
        "trees": [_round([t.x, t.y, t.canopy_radius, t.trunk_radius]) for t in recording.forest.trees],
        "people": [[None if math.isnan(p[0]) else _round(p) for p in row] for row in recording.people],
        "headings": _round(np.nan_to_num(recording.headings)),
        "uavs": _round(recording.poses[:, :, :3]),
        "views": _views(recording),
        "tracks": _tracks(recording),
        "states": history.camera_states.tolist(),
        "texts": list(texts),
        "view_texts": [[texts[text] for text in column] for column in view_texts],
        "holds": history.hold_states.tolist(),
        "holders": recording.numbers_of(history.tracks.ravel()).reshape(history.tracks.shape).tolist(),
        "works": history.working.astype(int).tolist(),
        "ospa": [[None if math.isnan(v) else round(v, 3) for v in row] for row in recording.ospa[:, :, 0].tolist()],
        "unmatched": [[e.kind, e.first, e.last, lane] for e, lane in lanes(events)],
        "switches": [[event.first, event.person] for event in events if event.kind in IDENTITIES],
        "plans": _plans(recording),
        "colours": {
            **colours(),
            "uavs": [css(colour) for colour in palette.UAV_COLOURS],  # further UAVs repeat these colours
            "pale_uavs": [css(palette.pale(colour)) for colour in palette.UAV_COLOURS],
            "pale_false": css(palette.pale(palette.FALSE)),
            "tracks": [css(colour) for colour in palette.TRACK_COLOURS],
        },
        "film": None if parts is None else {"tiles": [[b.x, b.y, b.width, b.height] for b in parts.tiles.values()]},
    }


def _views(recording: Recording) -> list[list[list[float] | None]]:
    """Corners x, y [m] of each camera's field of view on the ground; null if it has no bounds nearby."""
    scans, uavs = recording.poses.shape[:2]
    shown = ([footprint(recording.setting, i, recording.camera_at(k, i)) for i in range(uavs)] for k in range(scans))
    return [[None if corners is None else _round(corners.ravel()) for corners in row] for row in shown]


def _tracks(recording: Recording) -> list[list[list[list[float]]]]:
    """Number of each track, x, y, half axes [m] and rotation [rad] of its 95 % ellipse, and 1 if it is reported."""
    variances, axes = np.linalg.eigh(recording.track_covariances[:, :2, :2])
    half = ELLIPSE * np.sqrt(np.maximum(variances, 0.0))
    turn = np.arctan2(axes[:, 1, 1], axes[:, 0, 1])
    number = recording.numbers_of(recording.track_ids)
    rows = _round(np.column_stack([number, recording.track_means[:, :2], half[:, ::-1], turn, recording.reported]))
    uavs = recording.poses.shape[1]
    offsets = recording.track_offsets.tolist()
    cells = [rows[a:b] for a, b in pairwise(offsets)]
    return [cells[k : k + uavs] for k in range(0, len(cells), uavs)]


def _plans(recording: Recording) -> dict[str, Any]:
    """Times [s] from which plans are flown, duration [s] of a step, and velocities [m/s] of each UAV's steps."""
    setting = recording.setting
    return {
        "times": _round([setting.plan_start(time) for time in recording.plan_times.tolist()], 3),
        "step": setting.rates.plan_step,
        "controls": [[_round(c[~np.isnan(c[:, 0])]) for c in plans] for plans in recording.plans],
    }


def colours() -> dict[str, str]:
    """Colours of the palette in CSS, by their names in lower case."""
    named = {name.lower(): value for name, value in vars(palette).items() if name.isupper()}
    return {name: css(v) for name, v in named.items() if isinstance(v, tuple) and isinstance(v[0], int)}


def css(colour: palette.Colour) -> str:
    """A colour in CSS."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _round(values: ArrayLike, digits: int = 2) -> Any:  # noqa: ANN401 - lists as deep as the array
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
