"""The scenes of a mission as the JSON of its page, one for each shown scan; metres are rounded to centimetres."""

import math
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.facts.flight import Flight
from sim.facts.metrics.fleet_facts import average_ospa
from sim.mission.recording import Recording
from sim.views import palette
from sim.views.drawing.layout import Parts
from sim.views.page.charts import Table, choose_shown, list_people_now, make_chart_legend, make_timeline
from sim.views.palette import BLUE, VERMILLION, format_css
from sim.views.scene import (
    MARGIN,
    PEOPLE_LOOKS,
    PersonLook,
    Scene,
    TreeMark,
    UavMark,
    find_half_axes,
    list_unseen_ground,
    make_scenes,
    mark_trees,
)
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array


def make_page_data(flight: Flight, parts: Parts | None) -> dict[str, Any]:
    """The content of the page's JSON; parts: those of the film, or None without a film.

    Lists run over shown scans, then UAVs, then people or tracks. Marks begin with the index of their look in `looks`;
    null stands for absent people and for what is not drawn.
    """
    recording, scenario = flight.recording, flight.scenario
    shown = choose_shown(recording)
    rate = scenario.rates.sensing / shown.stride
    scenes = list(islice(make_scenes(recording, flight.people.hold_states), 0, None, shown.stride))
    looks = {name: Table() for name in ("uavs", "people", "tracks", "trails", "rows")}
    trees = mark_trees(recording.forest)
    paths, trails = _list_trails(scenes, shown.stride, looks["trails"])
    errors = recording.errors[shown.every]
    timeline = make_timeline(flight, shown)
    return {
        "labelled": recording.labelled,
        "crowd": scenes[0].crowd,
        "area": [scenario.area.width, scenario.area.height],
        "margin": MARGIN,
        "rate": rate,
        "times": _round(recording.times[shown.every], 3),
        "trees": [_list_tree(tree) for tree in trees],
        "maps": _list_maps(recording, shown.every),
        "names": {
            "people": [f"person {m}" for m in range(recording.person_count)],
            "uavs": [f"UAV {i}" for i in range(recording.uav_count)],
        },
        "people": [_list_people(scene, recording.person_count, looks["people"]) for scene in scenes],
        "uavs": [[_list_uav(uav, scene.poses_err, looks["uavs"]) for uav in scene.uavs] for scene in scenes],
        "tracks": [_list_tracks(scene, looks["tracks"]) for scene in scenes],
        "paths": paths,
        "trails": trails,
        "detections": [_round([mark.place for mark in scene.detections]) for scene in scenes],
        "owner": [-1 if scene.owner is None else scene.owner for scene in scenes],
        "now": list_people_now(flight, shown, looks["rows"]),
        "ospa": _put_nulls(errors[:, :, 0]),
        "mean": _put_nulls(average_ospa(errors)[:, :1].T)[0],
        "lines": [[format_css(palette.uav_colour(i)), palette.uav_dashes(i)] for i in range(recording.uav_count)],
        "timeline": timeline,
        "map_legend": _make_map_legend(scenes, [tree.solid.cover for tree in trees]),
        "chart_legend": make_chart_legend(flight, timeline["shades"]),
        "looks": {name: list(table) for name, table in looks.items()},
        "colours": list_colours(),
        "film": None if parts is None else {"tiles": [[b.x, b.y, b.width, b.height] for b in parts.tiles.values()]},
    }


def _list_tree(tree: TreeMark) -> list[Any]:
    """x, y, radius [m], share of the ground below that is hidden, colour, colour of the edge, and words."""
    _, x, y, radius, *_ = tree.solid
    hides = f", hides {round(100 * tree.solid.cover)} % from above" if tree.solid.cover < 1.0 else ""
    words = f"tree {tree.tree}, {tree.solid.part} of {round(radius, 2):g} m radius{hides}"
    edge = format_css(palette.CANOPY_EDGE) if tree.is_crown else None
    return [*_round([x, y, radius, tree.solid.cover]), format_css(tree.colour), edge, words]


def _list_maps(recording: Recording, shown: slice) -> dict[str, Any] | None:
    """The maps that UAVs made, if they did: which one each UAV believed at each scan, and the content of each.

    A map has x, y and radius [m] of its crowns, and west, south, east and north [m] of strips of unseen ground.
    """
    if recording.maps is None:
        return None
    known: dict[Forest, int] = {}
    scans, uavs = range(recording.scan_count)[shown], range(recording.uav_count)
    believed = [[known.setdefault(recording.believed_at(k, i), len(known)) for i in uavs] for k in scans]
    crowns = [np.array([(tree.x, tree.y, tree.canopy_radius) for tree in forest.trees]) for forest in known]
    strips = [list_unseen_ground(forest) for forest in known]
    made = [[_round(own.ravel()), _round(unseen.ravel())] for own, unseen in zip(crowns, strips, strict=True)]
    return {"believed": believed, "made": made}


def _list_people(scene: Scene, people: int, looks: Table) -> list[list[float] | None]:
    """Look, x, y [m] and heading [rad] of each person; a look has label, its colour, and that of `find_person_look`."""
    found: list[list[float] | None] = [None] * people
    for person in scene.people:
        look = looks.index_of((person.name, person.named and format_css(person.named), *_format_look(person.look)))
        found[person.number] = [look, *_round([*person.place, person.heading])]
    return found


def _list_trails(scenes: Sequence[Scene], stride: int, looks: Table) -> tuple[list[Any], list[Any]]:
    """The path of each person and track that has trails: places (N, 2) m; and for each scan, parts of paths as trails.

    A trail has a look (its colour, and whether it is of a track), the number of its path, and two indices into that.
    """
    known, paths, rows = Table(), list[list[Any]](), list[list[list[int]]]()
    for scene in scenes:
        rows.append([])
        present = {person.number for person in scene.people}
        for trail in (trail for trail in scene.trails if len(trail.places)):
            number = known.index_of((trail.of_track, trail.number))
            if number == len(paths):
                paths.append([])
            paths[number] += [_round(trail.places[-1])] * (trail.of_track or trail.number in present)
            until = len(paths[number])
            look = looks.index_of((format_css(trail.colour), trail.of_track))
            rows[-1].append([look, number, max(until - -(-len(trail.places) // stride), 0), until])
    return paths, rows


def _list_uav(uav: UavMark, poses_err: bool, looks: Table) -> list[Any]:
    """Look, x, y, z [m], outlines of the view and the believed view, if it differs, and intent without its start."""
    tip = f"{uav.name}, {{}} m up" if uav.works else uav.name.replace(":", ",")
    trouble = uav.trouble and format_css(uav.trouble)
    look = looks.index_of((uav.name, format_css(uav.colour), uav.dashes, trouble, tip, uav.touched))
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
    states = {state for person in people for state in (person.view, person.hold)}
    states |= {"person"} if states & {"seen", "missed"} else set()
    sparsest = min(covers, default=1.0)
    marks: list[tuple[str, str, Any, bool]] = [("porous tree", "tree", sparsest, sparsest < 1.0)]
    marks += [(text, "person", _format_look(look), text in states) for text, look in PEOPLE_LOOKS.items()]
    marks += [
        ("track, 95 %", "track", format_css(VERMILLION), any(uav.tracks for uav in uavs)),
        ("mapped, unseen", "mapped", format_css(palette.TRUNK), any(scene.mapped is not None for scene in scenes)),
        ("view of a UAV", "view", format_css(BLUE), any(uav.view is not None for uav in uavs)),
        ("view as believed", "believed", format_css(BLUE), any(scene.poses_err for scene in scenes)),
        ("intent", "intent", format_css(BLUE), any(uav.intent is not None for uav in uavs)),
        ("detection", "detection", None, any(scene.detections for scene in scenes)),
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
