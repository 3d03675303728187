"""The picture of an explanation: the map and the frames around a person, and the words beside them."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from sim.facts.explain.person import PersonFacts
from sim.facts.words import TextGroup
from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle, lay_out_groups, write
from sim.views.drawing.map_view import MapView
from sim.views.drawing.strokes import draw_disc, draw_line
from sim.views.frames.annotation import TRACK, annotate, find_marks
from sim.views.frames.frame_facts import make_frame_facts
from sim.views.frames.frame_panels import MARK
from sim.views.palette import INK, PANEL, PAPER, uav_colour
from sim.views.scene import make_scene, measure_map
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Image

_TILE, _HEAD, _GAP, _WORDS = 512, 26, 12, 620  # pixels: edge of a picture, its heading, gap of parts, width of words
_NEAR, _INSET = 7, 150  # pixels of the camera to either side of the person in an inset, and its edge
_SCALE, _LARGEST = 12.0, 4000.0  # pixels per m of the map, and pixels of the whole map at most
_FRAMES = 3  # largest number of frames
_TITLE = TextStyle(14, bold=True)


def draw_explanation(facts: PersonFacts, groups: Sequence[TextGroup]) -> Image:
    """The picture (H, W, 3) RGB: the map, the frames of up to three UAVs, and the words.

    UAVs with the person inside come first, then the nearest. Below the words are the cameras' original pixels around
    the person.
    """
    observer = facts.observer
    picture, tracks = _draw_map(facts)
    tiles = [("map", picture)]
    insets: list[tuple[str, Image]] = []
    shown = {TRACK} if tracks else set[str]()
    working = [w for w in facts.observations if w.works]
    for w in sorted(working, key=lambda w: (not w.sighting.in_image, np.nan_to_num(w.away)))[:_FRAMES]:
        sight = make_frame_facts(observer.recording, facts.k, w.uav)
        image = observer.again.image(facts.k, w.uav)
        frame, marks = annotate(image, sight, _TILE)
        shown |= marks
        heading = f"UAV {w.uav}: {w.sighting.status}"
        tiles.append((heading, np.asarray(cv2.resize(frame, (_TILE, _TILE)), dtype=np.uint8)))
        if sight.people[facts.person].pixels and w.sighting.looked:
            place = sight.camera.project(sight.pose, at_target_height(facts.place[None]))[0][0]
            insets.append((f"pixels of UAV {w.uav}", _enlarge(image, place)))
    words = np.vstack([_draw_words(groups, shown), *_put_beside(insets)])
    columns = min(len(tiles), 2)
    rows = -(-len(tiles) // columns)
    height = max(rows * (_TILE + _HEAD + _GAP) + _GAP, words.shape[0] + 2 * _GAP)
    left = columns * (_TILE + _GAP) + _GAP
    page = np.full((height, left + _WORDS + _GAP, 3), PAPER, dtype=np.uint8)
    for n, (heading, tile) in enumerate(tiles):
        y, x = _GAP + n // columns * (_TILE + _HEAD + _GAP), _GAP + n % columns * (_TILE + _GAP)
        write(page, heading, (x, y + _HEAD / 2), _TITLE)
        page[y + _HEAD : y + _HEAD + _TILE, x : x + _TILE] = tile
    page[_GAP:-_GAP, left:-_GAP] = PANEL
    page[_GAP : _GAP + words.shape[0], left:-_GAP] = words
    return page


def _enlarge(image: Image, place: Array) -> Image:
    """The pixels around a place (2,) of an image, enlarged."""
    edge = 2 * _NEAR + 1
    low = np.clip(np.floor(place).astype(int) - _NEAR, 0, len(image) - edge)
    part = image[low[1] : low[1] + edge, low[0] : low[0] + edge]
    return np.asarray(cv2.resize(part, (_INSET, _INSET), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def _put_beside(insets: Sequence[tuple[str, Image]]) -> list[Image]:
    """A row of insets under their headings, as wide as the words; empty without insets."""
    row = np.full((_HEAD + _INSET + _GAP, _WORDS, 3), PANEL, dtype=np.uint8)
    for n, (heading, inset) in enumerate(insets):
        x = _GAP + n * (_INSET + _GAP)
        write(row, heading, (x, _HEAD / 2), TextStyle())
        row[_HEAD : _HEAD + _INSET, x : x + _INSET] = inset
    return [row] if insets else []


def _cut_tile(image: Image, middle: Array) -> tuple[Image, Array]:
    """A tile of an image, centred on a pixel (2,) as far as possible and blank beyond it; and its first pixel (2,)."""
    tile = np.full((_TILE, _TILE, 3), PANEL, dtype=np.uint8)
    low = np.clip(middle - _TILE / 2, 0, np.maximum(np.array(image.shape[1::-1]) - _TILE, 0)).astype(int)
    part = image[low[1] : low[1] + _TILE, low[0] : low[0] + _TILE]
    tile[: part.shape[0], : part.shape[1]] = part
    return tile, low


def _draw_map(facts: PersonFacts) -> tuple[Image, bool]:
    """The part of the map around the person, with lines of sight and the trees in their way.

    The second value is True if there are tracks on it.
    """
    recording = facts.flight.recording
    metres = np.array(measure_map(facts.flight.scenario))
    scale = min(_SCALE, _LARGEST / float(metres.max()))
    width, height = np.ceil(scale * metres).astype(int).tolist()
    view = MapView(facts.flight.scenario, recording.forest, (width, height), recording.believed_forest)
    scene = make_scene(recording, facts.k, facts.flight.people.hold_states[facts.k])
    plain = [
        p._replace(named=None, look=p.look._replace(trouble=None)) for p in scene.people if p.number == facts.person
    ]
    others = [p for p in scene.people if p.number != facts.person]
    image, labels = view.draw(scene._replace(people=(*others, *plain)))  # with a ring and a name as below
    if not np.isnan(facts.place[0]):
        _draw_person(view, image, labels, facts)
    tile, low = _cut_tile(image, view.pixels(np.nan_to_num(facts.place)))
    inside = [np.all(np.abs(view.pixels(track.mean) - low - _TILE / 2) <= _TILE / 2) for track in scene.tracks]
    return tile, any(inside)


def _draw_person(view: MapView, image: Image, labels: Labels, facts: PersonFacts) -> None:
    recording = facts.flight.recording
    pixels = view.pixels
    _draw_sight(image, facts, pixels(facts.place), pixels(recording.poses[facts.k, :, :2]))
    labels.reserve(pixels(facts.place), 16.0)
    for tree in sorted({tree for w in facts.observations if w.works for tree in w.sighting.hidden_by}):
        place = pixels(recording.trees[tree, :2])
        draw_disc(image, place, view.scale * recording.trees[tree, 2], INK, 3)
        labels.put(f"tree {tree}", place, TextStyle(13, INK, True, PANEL))
    labels.put(f"person {facts.person}", pixels(facts.place), TextStyle(13, INK, True, PANEL))


def _draw_sight(image: Image, facts: PersonFacts, person: Array, uavs: Array) -> None:
    """Draw a ring, and a line from each camera with the person inside, dashed if the person is hidden."""
    for w in facts.observations:
        if not w.works or not w.sighting.inside:
            continue
        line = np.array([uavs[w.uav], person])
        pieces = max(int(math.dist(*line) / 7.0), 1)
        dots = line[0] + np.linspace(0, 1, pieces + 1)[:, None] * (line[1] - line[0])
        for n in range(0, pieces, 2 if w.sighting.hidden_by else 1):
            draw_line(image, dots[n : n + 2], uav_colour(w.uav), thickness=2)
    draw_disc(image, person, 14.0, PANEL, 5)
    draw_disc(image, person, 14.0, INK, 2)


def _draw_words(groups: Sequence[TextGroup], shown: set[str]) -> Image:
    """Image of the words, and of a legend of the marks with the names `shown`."""
    lines, bottom = lay_out_groups(groups, _WORDS - 2 * _GAP, float(_GAP), _TITLE)
    marks = find_marks(shown)
    rows = -(-len(marks) // 2)
    image = np.full((round(bottom) + rows * MARK + _GAP, _WORDS, 3), PANEL, dtype=np.uint8)
    for text, y, style in lines:
        write(image, text, (_GAP, y), style)
    for n, (text, mark) in enumerate(marks):
        at = np.array([_GAP + 22.0 + n % 2 * _WORDS / 2, bottom + (n // 2 + 0.5) * MARK])
        mark(image, at)
        write(image, text, (float(at[0]) + 32, float(at[1])), TextStyle())
    return image
