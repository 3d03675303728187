"""Data that the script of a mission's page draws: plain numbers, rounded to centimetres, scan by scan."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.drawing import palette
from sim.drawing.film import HEIGHT, WIDTH
from sim.drawing.layout import View
from sim.drawing.map_view import ELLIPSE, MARGIN, TRAIL, looks_down
from sim.recording.recording import Recording
from sim.replay.event import IDENTITIES, UNMATCHED, Event, lanes
from sim.replay.history import STATES, History
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import camera_of
from tracking.numerics.arrays import Array, Indices

OUT, MISSED, SEEN, HIDDEN = 0, 1, 2, 3  # codes of a person before a camera; above HIDDEN by 1 + the tree that hides


def page_data(
    recording: Recording, scenario: Scenario, history: History, events: Sequence[Event], parts: View | None
) -> dict[str, Any]:
    """The content of the page's JSON; `parts` are those of the film, None where there is none.

    Lists run over scans, then UAVs, then people or tracks; null stands for what is absent or does not work.
    """
    view_texts = [history.view_texts(m) for m in range(recording.people.shape[1])]
    false = [event for event in events if event.kind in UNMATCHED]
    texts = {text: n for n, text in enumerate(dict.fromkeys(text for column in view_texts for text in column))}
    return {
        "area": [scenario.area.width, scenario.area.height],
        "margin": MARGIN,
        "rate": scenario.rates.sensing,
        "trail": round(TRAIL * scenario.rates.sensing),
        "times": _rounded(recording.times, 3),
        "trees": [_rounded([t.x, t.y, t.canopy_radius, t.trunk_radius]) for t in recording.forest.trees],
        "people": [[None if math.isnan(p[0]) else _rounded(p) for p in row] for row in recording.people],
        "headings": _rounded(np.nan_to_num(recording.headings)),
        "uavs": _rounded(recording.poses[:, :, :3]),
        "views": _views(recording, scenario),
        "tracks": _tracks(recording),
        "codes": codes(history).tolist(),
        "texts": list(texts),
        "view_texts": [[texts[text] for text in column] for column in view_texts],
        "holds": history.hold_states.tolist(),
        "holders": recording.numbers_of(history.tracks.ravel()).reshape(history.tracks.shape).tolist(),
        "works": history.working.astype(int).tolist(),
        "ospa": [[None if math.isnan(v) else round(v, 3) for v in row] for row in recording.ospa[:, :, 0].tolist()],
        "unmatched": [[e.kind, e.first, e.last, lane] for e, lane in zip(false, lanes(false), strict=True)],
        "switches": [[event.first, event.person] for event in events if event.kind in IDENTITIES],
        "plans": _plans(recording, scenario),
        "colours": _colours(),
        "film": None
        if parts is None
        else {"size": [WIDTH, HEIGHT], "tiles": [[b.x, b.y, b.width, b.height] for b in parts.tiles.values()]},
    }


def codes(history: History) -> Indices:
    """State of each person to the last frame of each UAV (K, n, M), one of the codes above; `OUT` to a broken one."""
    states = history.camera_states
    found = np.where(states == STATES.index("hidden"), HIDDEN + 1 + history.hiding_trees, OUT)
    found[states == STATES.index("missed")] = MISSED
    found[states == STATES.index("seen")] = SEEN
    return found


def _views(recording: Recording, scenario: Scenario) -> list[list[list[float] | None]]:
    """Corners x, y [m] of what each camera shows of the ground; null where it has no bounds nearby."""
    if scenario.sensing.field_of_view == "unlimited":
        return [[None] * len(scenario.uavs) for _ in recording.times]
    cameras = [camera_of(uav) for uav in scenario.uavs]
    rows: list[list[list[float] | None]] = []
    for k in range(len(recording.times)):
        pairs = [(camera, recording.camera_at(k, i)) for i, camera in enumerate(cameras)]
        rows.append([_rounded(c.footprint(p)[:, :2].ravel()) if looks_down(c, p) else None for c, p in pairs])
    return rows


def _tracks(recording: Recording) -> list[list[list[list[float]]]]:
    """Number, x, y, half axes [m] and turn [rad] of the ellipse that holds 95 % of each track, and 1 if reported."""
    variances, axes = np.linalg.eigh(recording.track_covariances[:, :2, :2])
    half = ELLIPSE * np.sqrt(np.maximum(variances, 0.0))
    turn = np.arctan2(axes[:, 1, 1], axes[:, 0, 1])
    number = recording.numbers_of(recording.track_ids)
    rows = _rounded(np.column_stack([number, recording.track_means[:, :2], half[:, ::-1], turn, recording.reported]))
    uavs, offsets = recording.poses.shape[1], recording.track_offsets.tolist()
    cells = [rows[a:b] for a, b in pairwise(offsets)]
    return [cells[k : k + uavs] for k in range(0, len(cells), uavs)]


def _plans(recording: Recording, scenario: Scenario) -> dict[str, Any]:
    """Times from which plans are flown [s], the seconds of one step, and the velocities [m/s] of each UAV's steps."""
    return {
        "times": _rounded([scenario.due(time) for time in recording.plan_times.tolist()], 3),
        "step": 1 / scenario.rates.planning,
        "controls": [[_rounded(c[~np.isnan(c[:, 0])]) for c in plans] for plans in recording.plans],
    }


def _colours() -> dict[str, Any]:
    """Names of the palette in lower case, and lists of the UAVs' and the tracks' colours, as CSS has them."""
    named = {
        name.lower(): css(value)
        for name, value in vars(palette).items()
        if name.isupper() and isinstance(value[0], int)
    }
    lists = {"uavs": palette.UAV_COLOURS, "tracks": palette.TRACK_COLOURS}  # further ones begin again
    return named | {name: [css(colour) for colour in colours] for name, colours in lists.items()}


def css(colour: palette.Colour) -> str:
    """A colour as CSS writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _rounded(values: ArrayLike | Array, digits: int = 2) -> Any:  # noqa: ANN401 - lists as deep as the array
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
