"""One camera's frame with its detections and tracks."""

import cv2
import numpy as np

from sim.views.drawing.labels import Labels
from sim.views.drawing.lettering import TextStyle, measure_width, write
from sim.views.drawing.marks import draw_broken_mark, draw_cross, draw_detection
from sim.views.palette import FAINT, INK, LINE, PANEL, Colour
from sim.views.scene import UavMark
from tracking.geometry.camera import Camera
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Image

BORDER = 4


def draw_tile(image: Image, uav: UavMark, *, camera: Camera, frame: Image | None) -> None:
    """Fill a square RGB image with the frame of one UAV; without a frame, only with detections and tracks.

    A frame that is not square lies in the middle. A UAV that has broken down has a placeholder.
    """
    if not uav.works:
        draw_broken(image, uav.number)
        return
    _fill(image, uav.colour)
    room = image[BORDER:-BORDER, BORDER:-BORDER]
    _fill(room, LINE)
    scale = room.shape[0] / max(camera.size)
    width, height = (round(scale * edge) for edge in camera.size)
    left, top = (room.shape[1] - width) // 2, (room.shape[0] - height) // 2
    view = room[top : top + height, left : left + width]
    if frame is not None:
        enlarge = scale >= 1.0
        view[:] = cv2.resize(frame, (width, height), interpolation=cv2.INTER_NEAREST if enlarge else cv2.INTER_AREA)
    labels = Labels(view, veil=False)
    reach = max(5.0 * scale, 10.0)
    found = scale * np.array([mark.pixel for mark in uav.detections if mark.pixel is not None]).reshape(-1, 2)
    for uv in found:
        draw_detection(view, uv, reach)
    labels.reserve(found, reach)
    _draw_tracks(view, labels, uav, camera, scale)
    _name(image, uav.number, uav.colour)


def draw_broken(image: Image, uav: int) -> None:
    """Fill a square RGB image with the placeholder for a UAV that has broken down."""
    _fill(image, FAINT)
    _fill(image[BORDER:-BORDER, BORDER:-BORDER], LINE)
    middle = image.shape[0] / 2
    draw_broken_mark(image, np.array([middle, middle - 12]))
    write(image, "broken down", (middle, middle + 18), TextStyle(13, INK, True), align=0.5)
    _name(image, uav, FAINT)


def _fill(image: Image, colour: Colour) -> None:
    cv2.rectangle(image, (0, 0), image.shape[1::-1], colour, cv2.FILLED)


def _name(image: Image, uav: int, colour: Colour) -> None:
    red, green, blue = colour
    legible = INK if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else PANEL
    name = f"UAV {uav}"
    tab = TextStyle(13, legible, True)
    image[: BORDER + 18, : BORDER + measure_width(name, tab) + 6] = colour
    write(image, name, (BORDER + 1, BORDER + 8), tab)


def _draw_tracks(view: Image, labels: Labels, uav: UavMark, camera: Camera, scale: float) -> None:
    points = at_target_height(np.array([track.mean for track in uav.tracks]).reshape(-1, 2))
    pixels = scale * camera.project(uav.believed, points)[0]
    inside = np.flatnonzero(camera.sees(uav.believed, points))
    shown = [(uav.tracks[t], pixels[t]) for t in inside.tolist()]
    for track, at in shown:
        draw_cross(view, at, track.colour)
    labels.reserve(pixels[inside], 6.0)
    for track, at in shown:
        labels.put(track.name, at, TextStyle(13, track.colour, True, PANEL), gap=11.0)
