"""Anti-aliased text in images, with matplotlib's font."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import matplotlib
import numpy as np
from matplotlib.ft2font import FT2Font
from numpy.typing import NDArray

from sim.facts.words import TextGroup
from sim.views.palette import FAINT, INK, Colour
from tracking.numerics.arrays import Image

Mask = NDArray[np.float32]


@dataclass(frozen=True)
class TextStyle:
    """The look of a text; a halo keeps it legible on any background."""

    size: int = 13  # pixels per em
    colour: Colour = INK
    bold: bool = False
    halo: Colour | None = None


class PlacedLine(NamedTuple):
    """A line of text at its height in an image."""

    text: str
    middle: float  # pixels from the top
    style: TextStyle


_HEADING, _TEXT = TextStyle(13, FAINT), TextStyle(13)
_LINE, _GAP = 19, 12  # pixels: height of a line, and the gap between groups


def measure_width(text: str, style: TextStyle) -> int:
    """Width of a text [pixel]."""
    return int(_make_mask(text, style.size, style.bold)[0].shape[1]) - 4


def wrap(text: str, room: int, style: TextStyle) -> list[str]:
    """Lines of a text that are at most `room` pixels wide; all but the first are indented."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if measure_width(longer, style) <= room:
            lines[-1] = longer
        else:
            lines.append(f"    {word}")
    return lines


def lay_out_groups(
    groups: Sequence[TextGroup], room: int, top: float, heading: TextStyle = _HEADING
) -> tuple[list[PlacedLine], float]:
    """Lines of groups of sentences from `top` down, and the height below all of them.

    Lines are at most `room` pixels wide; `heading` is the style of the first heading.
    """
    found: list[PlacedLine] = []
    y = top
    for group in groups:
        found.append(PlacedLine(group.heading, y + _LINE / 2, _HEADING if found else heading))
        y += _LINE
        for line in (line for sentence in group.sentences for line in wrap(sentence, room, _TEXT)):
            found.append(PlacedLine(line, y + _LINE / 2, _TEXT))
            y += _LINE
        y += _GAP
    return found, y


def write(image: Image, text: str, at: tuple[float, float], style: TextStyle, align: float = 0.0) -> None:
    """Write into an RGB image (H, W, 3), vertically centred on `at` (x, y) but moved such that the text fits.

    align: 0 puts the text's left edge at x, 0.5 its centre, and 1 its right edge.
    """
    mask, descent = _make_mask(text, style.size, style.bold)
    height, extent = mask.shape
    baseline = at[1] + 0.36 * style.size
    x = round(at[0] - align * (extent - 4)) - 2
    y = round(baseline - (height - 2 - descent))
    x = min(max(x, 0), max(image.shape[1] - extent, 0))
    y = min(max(y, 0), max(image.shape[0] - height, 0))
    rows = image.reshape(len(image), -1)[y : y + height, 3 * x : 3 * (x + extent)]  # pixels and channels in one axis
    for clear, ink in _make_layers(text, style):
        blend = rows * clear[: rows.shape[0], : rows.shape[1]]
        blend += ink[: rows.shape[0], : rows.shape[1]]
        blend += np.float32(0.5)
        rows[:] = blend


@lru_cache(maxsize=512)
def _make_layers(text: str, style: TextStyle) -> list[tuple[Mask, Mask]]:
    """Of the halo, if any, and of the text: the share (H, 3 W) of the background that remains, and what is added."""
    mask, _ = _make_mask(text, style.size, style.bold)
    layers = [(style.colour, mask)]
    if style.halo is not None:
        wide = cv2.GaussianBlur(cv2.dilate(mask, np.ones((3, 3))), (3, 3), 0)
        layers.insert(0, (style.halo, np.asarray(wide, dtype=np.float32)))
    weights = [(np.array(colour, dtype=np.float32), np.repeat(mask, 3, axis=1)) for colour, mask in layers]
    return [(1 - weight, weight * np.tile(colour, mask.shape[1])) for colour, weight in weights]


@lru_cache(maxsize=1024)
def _make_mask(text: str, size: int, bold: bool) -> tuple[Mask, float]:
    """Opacity in [0, 1] of a text with a border of two pixels, and its depth below the baseline [pixel]."""
    font = _load_font(bold)
    font.set_size(size, 72)
    font.set_text(text, 0.0)
    font.draw_glyphs_to_bitmap(antialiased=True)
    mask = np.pad(np.asarray(font.get_image(), dtype=np.float32) / np.float32(255), 2)
    return mask, font.get_descent() / 64


@lru_cache(maxsize=2)
def _load_font(bold: bool) -> FT2Font:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return FT2Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name))
