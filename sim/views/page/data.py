"""Data for the script of a mission's page: plain numbers by shown scan, rounded to centimetres."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.facts.event import IDENTITIES, assign_lanes
from sim.facts.flight import Flight
from sim.mission.recording import Recording
from sim.views.drawing import palette
from sim.views.drawing.layout import Parts
from sim.views.drawing.map_view import MARGIN, TRAIL, find_footprint, find_half_axes
from sim.views.timeline import choose_rows
from tracking.geometry.camera import Pose
from tracking.numerics.arrays import Array, Flags

MOST_SCANS = 1500  # shown on a page


@dataclass(frozen=True)
class Shown:
    """The scans on a page: each `stride`-th of a long mission."""

    stride: int
    count: int

    @staticmethod
    def of(recording: Recording) -> "Shown":
        """All scans of a recording, or at most `MOST_SCANS` of them, evenly spread."""
        scans = len(recording.times)
        stride = -(-scans // MOST_SCANS)
        return Shown(stride, -(-scans // stride))

    def span(self, first: int, last: int) -> tuple[int, int]:
        """The first and the last shown scan, by their places on the page, of a span of scans; at least one."""
        begin = min(-(-first // self.stride), self.count - 1)
        return begin, max(begin, last // self.stride)


def make_page_data(flight: Flight, parts: Parts | None) -> dict[str, Any]:
    """The content of the page's JSON; parts: those of the film, or None without a film.

    Lists run over shown scans, then UAVs, then people or tracks; null means absent or broken down.
    """
    recording, scenario, people, events = flight.recording, flight.scenario, flight.people, flight.events
    shown = Shown.of(recording)
    every, rate = slice(None, None, shown.stride), scenario.rates.sensing / shown.stride
    view_texts = [people.view_texts(m)[every] for m in range(recording.person_count)]
    rows, folded = choose_rows(people)
    holders = people.tracks[every]
    texts = {text: n for n, text in enumerate(dict.fromkeys(text for column in view_texts for text in column))}
    return {
        "labelled": recording.labelled,
        "area": [scenario.area.width, scenario.area.height],
        "margin": MARGIN,
        "rate": rate,
        "trail": round(TRAIL * rate),
        "times": _round(recording.times[every], 3),
        "trees": [_round([t.x, t.y, t.canopy_radius, t.trunk_radius, t.cover]) for t in recording.forest.trees],
        "people": _put_nulls(recording.people[every], 2, np.isnan(recording.people[every, :, 0])),
        "headings": _round(np.nan_to_num(recording.headings[every])),
        "uavs": _round(recording.poses[every, :, :3]),
        "views": _list_views(recording, recording.cameras[every]),
        "believed": None if recording.believed is None else _list_views(recording, recording.believed[every]),
        "tracks": _list_tracks(recording)[every],
        "states": people.camera_states[every].tolist(),
        "texts": list(texts),
        "view_texts": [[texts[text] for text in column] for column in view_texts],
        "holds": people.hold_states[every].tolist(),
        "holders": recording.numbers_of(holders.ravel()).reshape(holders.shape).tolist(),
        "works": recording.working[every].astype(int).tolist(),
        "ospa": _put_nulls(recording.errors[every, :, 0], 3, np.isnan(recording.errors[every, :, 0])),
        "rows": rows,
        "folded": folded,
        "unmatched": [[e.kind, *shown.span(e.first, e.last), lane] for e, lane in assign_lanes(events)],
        "switches": [[shown.span(e.first, e.first)[0], e.person] for e in events if e.kind in IDENTITIES],
        "plans": _list_plans(recording),
        "colours": {
            **list_colours(),
            # Further UAVs repeat these with other dashes.
            "uavs": [format_css(colour) for colour in palette.UAV_COLOURS],
            "uav_dashes": palette.UAV_DASHES,
            "pale_uavs": [format_css(palette.pale(colour)) for colour in palette.UAV_COLOURS],
            "pale_false": format_css(palette.pale(palette.FALSE)),
            "tracks": [format_css(colour) for colour in palette.TRACK_COLOURS],
        },
        "film": None if parts is None else {"tiles": [[b.x, b.y, b.width, b.height] for b in parts.tiles.values()]},
    }


def _list_views(recording: Recording, cameras: Array) -> list[list[list[float] | None]]:
    """Outline x, y [m] of the field of view on the ground of cameras (K, n, 7); null if it has no bounds nearby."""
    poses = [[Pose(pose[:3], pose[3:]) for pose in row] for row in cameras]
    views = [[find_footprint(recording.setting, i, pose) for i, pose in enumerate(row)] for row in poses]
    return [[None if view is None else _round(view.ravel()) for view in row] for row in views]


def _list_tracks(recording: Recording) -> list[dict[str, Any]]:
    """Rows of the tracks of each scan, equal ones of several UAVs once, and each UAV's as indices into these rows.

    A row has the number of the track, x, y, half axes [m] and rotation [rad] of its 95 % ellipse, and 1 if it is
    reported.
    """
    half, axes = find_half_axes(recording.track_covariances[:, :2, :2])
    turn = np.arctan2(axes[:, 1, 1], axes[:, 0, 1])
    number = recording.numbers_of(recording.track_ids)
    columns = [number, recording.track_means[:, :2], half[:, ::-1], turn, recording.reported]
    rows = list(map(tuple, _round(np.column_stack(columns))))
    uavs, offsets = recording.uav_count, recording.track_offsets.tolist()
    found = []
    for k in range(0, len(offsets) - 1, uavs):
        distinct = {row: n for n, row in enumerate(dict.fromkeys(rows[offsets[k] : offsets[k + uavs]]))}
        held = [[distinct[row] for row in rows[a:b]] for a, b in pairwise(offsets[k : k + uavs + 1])]
        found.append({"rows": list(distinct), "held": held})
    return found


def _list_plans(recording: Recording) -> dict[str, Any]:
    """Times [s] from which plans are flown, duration [s] of a step, and velocities [m/s] of each UAV's steps."""
    setting = recording.setting
    return {
        "times": _round([setting.plan_start(time) for time in recording.plan_times.tolist()], 3),
        "step": setting.rates.plan_step,
        "controls": [[_round(c[~np.isnan(c[:, 0])]) for c in plans] for plans in recording.plans],
    }


def list_colours() -> dict[str, str]:
    """Colours of the palette in CSS, by their names in lower case."""
    named = {name.lower(): value for name, value in vars(palette).items() if name.isupper()}
    colours = {name: v for name, v in named.items() if isinstance(v, tuple) and len(v) == 3 and isinstance(v[0], int)}
    return {name: format_css(colour) for name, colour in colours.items()}


def format_css(colour: palette.Colour) -> str:
    """A colour in CSS."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _put_nulls(values: Array, digits: int, without: Flags) -> list[list[Any]]:
    """Rounded values (K, N, ...) as lists, with null at the places (K, N) without a value."""
    rows = zip(_round(np.nan_to_num(values), digits), without.tolist(), strict=True)
    return [[None if gone else value for value, gone in zip(*row, strict=True)] for row in rows]


def _round(values: ArrayLike, digits: int = 2) -> Any:  # noqa: ANN401 - lists as deep as the array
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
