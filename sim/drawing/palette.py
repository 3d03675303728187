"""Colours (RGB) of videos and figures; those that tell things apart are safe for colour-blind viewers (Okabe-Ito)."""

from __future__ import annotations

Colour = tuple[int, int, int]

PAPER: Colour = (248, 245, 237)
PANEL: Colour = (255, 254, 250)
INK: Colour = (40, 38, 36)
FAINT: Colour = (150, 145, 136)
LINE: Colour = (222, 216, 204)
CANOPY: Colour = (120, 171, 112)
CANOPY_EDGE: Colour = (88, 138, 84)
TRUNK: Colour = (104, 74, 48)
ALARM: Colour = (200, 16, 46)
DETECTION: Colour = (240, 228, 66)

BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
PURPLE: Colour = (204, 121, 167)
SKY: Colour = (86, 180, 233)
VERMILLION: Colour = (213, 94, 0)

_UAVS = (BLUE, ORANGE, PURPLE, SKY)
# Darker than the UAVs' colours, so that a track is read as a track on paper, under a canopy and in a camera tile.
_TRACKS = (VERMILLION, (136, 34, 85), (51, 34, 136), (0, 98, 104), (112, 92, 0))


def uav_colour(uav: int) -> Colour:
    """One of four colours; the number beside it tells the rest."""
    return _UAVS[uav % len(_UAVS)]


def track_colour(track: int) -> Colour:
    """One of five colours; the number beside it tells the rest."""
    return _TRACKS[track % len(_TRACKS)]


def ink_on(colour: Colour) -> Colour:
    """Black or white, whichever is read better on the colour."""
    red, green, blue = colour
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else PANEL


def on_dark(colour: Colour) -> Colour:
    """The colour, lightened so that it is read on dark ground."""
    red, green, blue = (round(channel + 0.45 * (255 - channel)) for channel in colour)
    return red, green, blue
