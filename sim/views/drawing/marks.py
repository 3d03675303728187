"""Marks of tracks, UAVs and people in images."""

import math

import numpy as np

from sim.views.drawing.strokes import draw_disc, draw_line, draw_lines
from sim.views.palette import ALARM, DETECTION, FAINT, INK, PANEL, Colour
from sim.views.scene import PersonLook
from tracking.numerics.arrays import Array, Image

_ARMS = np.array([[(5.0 * x, 5.0 * y), (8.5 * x, 8.5 * y)] for x in (-1, 1) for y in (-1, 1)])
_ROTORS = np.array([(dx, dy) for dx in (-6.0, 6.0) for dy in (-6.0, 6.0)])


def draw_cross(image: Image, centre: Array, colour: Colour, size: float = 1.0) -> None:
    """Draw a track's mark at a pixel (2,), legible on any background, and open in the middle to show the person."""
    for ink, thickness in ((PANEL, 4), (colour, 2)):
        draw_lines(image, centre + size * _ARMS, ink, thickness=thickness)


def draw_quadrotor(image: Image, centre: Array, colour: Colour, size: float = 1.0) -> None:
    """Draw a UAV's mark at a pixel (2,)."""
    rotors = centre + size * _ROTORS
    arms = np.stack([np.broadcast_to(centre, rotors.shape), rotors], axis=1)
    for ink, wider in ((PANEL, 2), (colour, 0)):
        draw_lines(image, arms, ink, thickness=2 + wider)
        for rotor in rotors:
            draw_disc(image, rotor, 3.5 * size + wider / 2, ink)
        draw_disc(image, centre, 3.0 * size + wider / 2, ink)
    for rotor in rotors:
        draw_disc(image, rotor, 1.5 * size, PANEL)


def draw_broken_mark(image: Image, centre: Array) -> None:
    """Draw the mark of a UAV that has broken down at a pixel (2,): grey, on a red cross."""
    for ink, thickness in ((PANEL, 6), (ALARM, 3)):
        for way in (1.0, -1.0):
            arm = np.array([14.0, 14.0 * way])
            draw_line(image, np.array([centre - arm, centre + arm]), ink, thickness=thickness)
    draw_quadrotor(image, centre, FAINT)


def draw_detection(image: Image, centre: Array, reach: float) -> None:
    """Draw the mark of a detection at a pixel (2,): a ring with a radius of `reach` pixels."""
    draw_disc(image, centre, reach, INK, 4)
    draw_disc(image, centre, reach, DETECTION, 2)


def draw_person_mark(image: Image, centre: Array, heading: float, look: PersonLook, size: float = 1.0) -> None:
    """Draw a person's mark at a pixel (2,), with a ring if no UAV holds the person."""
    ahead = centre + size * 9.0 * np.array([math.cos(heading), -math.sin(heading)])
    draw_line(image, np.array([centre, ahead]), look.colour, thickness=2)
    draw_disc(image, centre, 3.4 * size, look.colour)
    if look.hollow:
        draw_disc(image, centre, 2.0 * size, PANEL)
    if look.trouble is not None:
        draw_disc(image, centre, 11.0 * size, look.trouble, 2)
