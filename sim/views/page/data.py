"""The scenes of a mission as the JSON of its page, one for each shown scan; metres are rounded to centimetres."""

import math
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.facts.flight import Flight
from sim.facts.metrics.fleet_facts import average_ospa
from sim.views.drawing import palette
from sim.views.drawing.layout import Parts
from sim.views.drawing.palette import BLUE, INK, LOST, VERMILLION, format_css
from sim.views.page.charts import Table, choose_shown, list_people_now, make_chart_legend, make_timeline
from sim.views.scene import MARGIN, TRAIL, PersonLook, Scene, UavMark, find_half_axes, find_person_look, make_scenes
from tracking.numerics.arrays import Array

_FEW = 8  # people; more have short names on the map


def make_page_data(flight: Flight, parts: Parts | None) -> dict[str, Any]:
    """The content of the page's JSON; parts: those of the film, or None without a film.

    Lists run over shown scans, then UAVs, then people or tracks. Marks begin with the index of their look in `looks`;
    null stands for absent people and for what is not drawn.
    """
    recording, scenario = flight.recording, flight.scenario
    shown = choose_shown(recording)
    rate = scenario.rates.sensing / shown.stride
    scenes = list(islice(make_scenes(recording, flight.people.hold_states), 0, None, shown.stride))
    looks = {name: Table() for name in ("uavs", "people", "tracks", "rows")}
    trees = recording.forest.trees
    errors = recording.errors[shown.every]
    timeline = make_timeline(flight, shown)
    return {
        "labelled": recording.labelled,
        "area": [scenario.area.width, scenario.area.height],
        "margin": MARGIN,
        "rate": rate,
        "trail": round(TRAIL * rate),
        "times": _round(recording.times[shown.every], 3),
        "trees": [
            [*_round([t.x, t.y, t.canopy_radius, t.trunk_radius, t.cover]), _tell_tree(n, t.canopy_radius, t.cover)]
            for n, t in enumerate(trees)
        ],
        "names": {
            "people": [f"person {m}" for m in range(recording.person_count)],
            "uavs": [f"UAV {i}" for i in range(recording.uav_count)],
        },
        "people": [_list_people(scene, recording.person_count, looks["people"]) for scene in scenes],
        "uavs": [[_list_uav(uav, scene.poses_err, looks["uavs"]) for uav in scene.uavs] for scene in scenes],
        "tracks": [_list_tracks(scene, looks["tracks"]) for scene in scenes],
        "owner": [-1 if scene.owner is None else scene.owner for scene in scenes],
        "now": list_people_now(flight, shown, looks["rows"]),
        "ospa": _put_nulls(errors[:, :, 0]),
        "mean": _put_nulls(average_ospa(errors)[:, :1].T)[0],
        "lines": [[format_css(palette.uav_colour(i)), palette.uav_dashes(i)] for i in range(recording.uav_count)],
        "timeline": timeline,
        "map_legend": _make_map_legend(scenes, [tree.cover for tree in trees]),
        "chart_legend": make_chart_legend(flight, timeline["shades"]),
        "looks": {name: list(table) for name, table in looks.items()},
        "colours": list_colours(),
        "film": None if parts is None else {"tiles": [[b.x, b.y, b.width, b.height] for b in parts.tiles.values()]},
    }


def _tell_tree(number: int, radius: float, cover: float) -> str:
    hides = f", hides {round(100 * cover)} % from above" if cover < 1.0 else ""
    return f"tree {number}, canopy of {round(radius, 2):g} m radius{hides}"


def _list_people(scene: Scene, people: int, looks: Table) -> list[list[float] | None]:
    """Look, x, y [m] and heading [rad] of each person; a look has label, its colour, and that of `find_person_look`."""
    found: list[list[float] | None] = [None] * people
    for person in scene.people:
        named = {"lost": LOST, "not found yet": INK}.get(person.hold)
        label = str(person.number) if people > _FEW else person.name
        look = looks.index_of((label, named and format_css(named), *_format_look(person.look)))
        found[person.number] = [look, *_round([*person.place, person.heading])]
    return found


def _list_uav(uav: UavMark, poses_err: bool, looks: Table) -> list[Any]:
    """Look, x, y, z [m], outlines of the view and the believed view, if it differs, and intent without its start."""
    tip = f"{uav.name}, {{}} m up" if uav.works else uav.name.replace(":", ",")
    trouble = uav.trouble and format_css(uav.trouble)
    look = looks.index_of((uav.name, format_css(uav.colour), uav.dashes, trouble, tip))
    believed = uav.believed_view if poses_err else None
    intent = None if uav.intent is None else uav.intent[1:]
    outlines = [None if line is None else _round(line.ravel()) for line in (uav.view, believed, intent)]
    return [look, *_round(uav.pose.position), *outlines]


def _list_tracks(scene: Scene, looks: Table) -> dict[str, Any]:
    """Tracks of a scan, equal ones of several UAVs once, and each UAV's as indices into these rows.

    A row has the look, x, y, half axes [m] and rotation [rad] of the 95 % ellipse.
    """
    tracks = [track for uav in scene.uavs for track in uav.tracks]
    half, axes = find_half_axes(np.array([track.covariance for track in tracks]).reshape(-1, 2, 2))
    turn = np.arctan2(axes[:, 1, 1], axes[:, 0, 1])
    numbers = [
        looks.index_of(
            (t.name, format_css(t.colour), f"track {t.number} of {{}}{'' if t.reported else ', not reported'}")
        )
        for t in tracks
    ]
    means = np.array([track.mean for track in tracks]).reshape(-1, 2)
    rows = iter(map(tuple, _round(np.column_stack([numbers, means, half[:, ::-1], turn]))))
    distinct = Table()
    held = [[distinct.index_of(next(rows)) for _ in uav.tracks] for uav in scene.uavs]
    return {"rows": list(distinct), "held": held}


def _make_map_legend(scenes: Sequence[Scene], covers: Sequence[float]) -> list[list[Any]]:
    """What the map shows at some scan: text, kind of the mark, and its look."""
    people = [person for scene in scenes for person in scene.people]
    uavs = [uav for scene in scenes for uav in scene.uavs]
    views, holds = {person.view for person in people}, {person.hold for person in people}
    sparsest = min(covers, default=1.0)
    marks: list[tuple[str, str, Any, bool]] = [("porous tree", "tree", sparsest, sparsest < 1.0)]
    for text, view in (("person", "seen"), ("hidden", "hidden"), ("outside every view", "out of view")):
        marks.append((text, "person", _format_look(find_person_look(view, "held")), view in views))
    for hold in ("lost", "not found yet"):
        marks.append((hold, "person", _format_look(find_person_look("seen", hold)), hold in holds))
    marks += [
        ("track, 95 %", "track", format_css(VERMILLION), any(uav.tracks for uav in uavs)),
        ("view of a UAV", "view", format_css(BLUE), any(uav.view is not None for uav in uavs)),
        ("view as believed", "believed", format_css(BLUE), any(scene.poses_err for scene in scenes)),
        ("intent", "intent", format_css(BLUE), any(uav.intent is not None for uav in uavs)),
    ]
    return [[text, kind, look] for text, kind, look, drawn in marks if drawn]


def _format_look(look: PersonLook) -> tuple[str, bool, str | None]:
    """Colour, True for a hollow disc, and colour of the ring."""
    return format_css(look.colour), look.hollow, look.trouble and format_css(look.trouble)


def list_colours() -> dict[str, str]:
    """Colours of the palette in CSS, by their names in lower case."""
    named = {name.lower(): value for name, value in vars(palette).items() if name.isupper()}
    colours = {name: v for name, v in named.items() if isinstance(v, tuple) and len(v) == 3 and isinstance(v[0], int)}
    return {name: format_css(colour) for name, colour in colours.items()}


def _put_nulls(values: Array) -> list[list[float | None]]:
    """Rows of values (K, N) m in millimetres, with null for NaN."""
    rounded = _round(values, 3)
    return [[None if math.isnan(value) else value for value in row] for row in rounded]


def _round(values: ArrayLike, digits: int = 2) -> Any:  # noqa: ANN401 - lists as deep as the array
    return (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist()
