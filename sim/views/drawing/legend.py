"""The legend of a film, below the map."""

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from sim.scenario.scenario import Scenario
from sim.views.drawing.lettering import TextStyle, measure_width, write
from sim.views.drawing.marks import draw_cross, draw_detection, draw_person_mark, draw_quadrotor
from sim.views.drawing.strokes import cut_dashes, draw_disc, draw_line, draw_lines
from sim.views.palette import (
    BELIEVED,
    BLUE,
    CANOPY,
    CANOPY_EDGE,
    INK,
    PANEL,
    TRUNK,
    UNSEEN,
    UNSEEN_SHARE,
    Colour,
    mix,
    track_colour,
)
from sim.views.scene import PEOPLE_LOOKS, mark_trees, outline_mistaken_crowns
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Image

_TEXT = TextStyle(13)
_SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
_TURN = np.linspace(0, 2 * math.pi, 32, endpoint=False)


_Entry = tuple[Callable[[Image, Array], None], str]


def draw_legend(
    image: Image,
    scenario: Scenario,
    *,
    owner: str | None,
    tiles: bool,
    scale: float,
    forest: Forest,
    believed_forest: Forest | None = None,
    labelled: bool = True,
) -> None:
    """Fill an RGB strip with the marks that are shown, and a scale bar for the map's `scale` in pixels per metre.

    owner: the UAV whose tracks are on the map; None for a film without the map. labelled: False if the map has
    detections in place of people. scenario: says if poses err, and if UAVs map trees.
    """
    entries: list[_Entry] = []
    if owner:
        entries += _list_trees(forest)
        entries += [(_draw_believed_tree, "believed")] * bool(outline_mistaken_crowns(forest, believed_forest))
        entries += [(_draw_mapped_tree, "mapped, unseen")] * (scenario.mapping.forest == "mapped")
        people = PEOPLE_LOOKS.items() if labelled else ()
        entries += [(partial(draw_person_mark, heading=0.0, look=look), text) for text, look in people]
    entries.append((_draw_track, f"track of {owner}, 95 %" if owner else "track"))
    if owner:
        errs = scenario.navigation_errs
        entries += [(_draw_believed_uav, "UAV, view, believed") if errs else (_draw_uav, "UAV, view")]
        entries += [(_draw_intent, "intent")] * labelled
    if tiles or not labelled:
        entries.append((partial(draw_detection, reach=10.0), "detection"))
    middle = image.shape[0] / 2
    x = 4.0
    for mark, text in entries:
        mark(image, np.array([x + 14, middle]))
        write(image, text, (x + 34, middle), _TEXT)
        x += 34 + measure_width(text, _TEXT) + 8
    if owner:
        _draw_scale_bar(image, scale, np.array([image.shape[1] - 6.0, middle + 6]))


def _list_trees(forest: Forest) -> Iterator[_Entry]:
    covers = [tree.solid.cover for tree in mark_trees(forest) if tree.is_crown] or [1.0]
    if max(covers) == 1.0:
        yield partial(_draw_tree, cover=1.0), "tree"
    if min(covers) < 1.0:
        yield partial(_draw_tree, cover=min(covers)), "porous tree"


def _draw_scale_bar(image: Image, scale: float, right: Array) -> None:
    """Draw a bar with a round length of about 50 to 130 pixels."""
    metres = next(m for m in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10**4, 10**5) if m * scale > 50)
    left = right - np.array([metres * scale, 0.0])
    for end in (left, right):
        draw_line(image, end + np.array([(0, -5), (0, 1)]), INK, thickness=2)
    draw_line(image, np.array([left, right]), INK, thickness=2)
    write(image, f"{metres} m", ((left[0] + right[0]) / 2, right[1] - 11), _TEXT, align=0.5)


def _draw_tree(image: Image, at: Array, *, cover: float) -> None:
    draw_disc(image, at, 10.0, mix(CANOPY, PANEL, cover))
    draw_disc(image, at, 10.0, CANOPY_EDGE, 1)
    draw_disc(image, at, 2.0, TRUNK)


def _draw_believed_tree(image: Image, at: Array, colour: Colour = CANOPY_EDGE) -> None:
    ring = at + 10.0 * np.column_stack([np.cos(_TURN), np.sin(_TURN)])
    draw_lines(image, cut_dashes(ring, BELIEVED), colour)


def _draw_mapped_tree(image: Image, at: Array) -> None:
    x, y = np.rint(at).astype(int)
    image[y - 8 : y + 9, x : x + 13] = mix(UNSEEN, PANEL, UNSEEN_SHARE)
    _draw_believed_tree(image, at, TRUNK)


def _draw_track(image: Image, at: Array) -> None:
    ring = at + np.column_stack([14 * np.cos(_TURN), 10 * np.sin(_TURN)])
    draw_line(image, ring, track_colour(0), thickness=2, closed=True)
    draw_cross(image, at, track_colour(0))


def _draw_uav(image: Image, at: Array) -> None:
    draw_line(image, at + 12.0 * _SQUARE, BLUE, thickness=2, closed=True)
    draw_quadrotor(image, at, BLUE)


def _draw_believed_uav(image: Image, at: Array) -> None:
    _draw_uav(image, at)
    draw_lines(image, cut_dashes(at + 12.0 * _SQUARE + (4.0, -2.0), BELIEVED), BLUE)


def _draw_intent(image: Image, at: Array) -> None:
    for dx in (-12.0, -5.0, 2.0):
        draw_disc(image, at + np.array([dx, 0.0]), 2.0, BLUE)
    draw_disc(image, at + np.array([9.0, 0.0]), 4.0, BLUE, 2)
