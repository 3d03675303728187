"""Annotated frames of a recording with their panels, of scans that a user asks for by time, as PNG files."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from sim.drawing.layout import GAP
from sim.drawing.lettering import Image
from sim.drawing.palette import PAPER, uav_colour
from sim.drawing.tiles import BORDER
from sim.evaluation.summary import titled
from sim.recording.atomic_files import new_folder
from sim.recording.recording import Recording
from sim.replay.frames.annotation import annotated
from sim.replay.frames.panel import WIDTH, draw_panel
from sim.replay.frames.rerender import Rerenderer
from sim.replay.frames.sightings import Sight
from tracking.plugins.registry import InputError

_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 6]  # less than half the size of OpenCV's default
_SLACK = 1e-6  # s, for times that were typed


def draw(recording: Recording, again: Rerenderer, k: int, uav: int, *, size: int) -> Image:
    """The annotated frame of one UAV at scan k, RGB, with its panel; `size` as in `annotated`."""
    sight = Sight.of(recording, again.scenario, k, uav)
    view = annotated(again.image(k, uav), sight, size)
    side = view.shape[0] + 2 * BORDER
    mount = {"gimbal": "camera on a gimbal", "body": "camera fixed to the body"}[again.scenario.uavs[uav].mount]
    notes = [titled(recording), f"scan {k} of {len(recording.times) - 1}, {mount}"]
    if not again.scenario.sensing.renders:
        notes.append("ideal sensing: this image was not used")
    elif not again.scenario.has_frame(uav, k):
        notes.append("the camera took no image at this scan")
    panel = draw_panel(sight, notes, height=side)
    page = np.full((panel.shape[0] + 2 * GAP, side + WIDTH + 3 * GAP, 3), PAPER, dtype=np.uint8)
    page[GAP:-GAP, -GAP - WIDTH : -GAP] = panel
    framed = page[GAP : GAP + side, GAP : GAP + side]
    framed[:] = uav_colour(uav)
    framed[BORDER:-BORDER, BORDER:-BORDER] = view
    return page


def png(image: Image) -> bytes:
    """An image (H, W, 3) RGB as a PNG file has it."""
    done, data = cv2.imencode(".png", image[..., ::-1], _PNG)
    assert done
    return data.tobytes()


def write_frames(
    recording: Recording, scans: list[int], uav: int, out: Path, *, size: int, progress: Callable[[int], None]
) -> None:
    """Annotated frames of one UAV as PNG files in the new folder `out`, all or none; `progress` is told each scan."""
    with new_folder(out) as folder, Rerenderer(recording) as again:
        for k in scans:
            name = f"uav{uav}-scan{k:04d}-{recording.times[k]:.1f}s.png"
            page = draw(recording, again, k, uav, size=size)
            (folder / name).write_bytes(png(page))
            progress(k)


def scans_between(recording: Recording, start: float, end: float | None) -> list[int]:
    """Scans from `start` to `end` s, or the one nearest to `start`; InputError if a time is not in the recording."""
    times, last = recording.times, float(recording.times[-1])
    for time in (start, *([] if end is None else [end])):
        if time > last + _SLACK:
            raise InputError(f"--time: {time:g} s is not in the recording; allowed are 0 to {last:g} s")
    if end is None:
        return [int(np.argmin(np.abs(times - start)))]
    found = np.flatnonzero((times >= start - _SLACK) & (times <= end + _SLACK)).tolist()
    if not found:
        near = ", ".join(f"{times[k]:g}" for k in sorted(np.argsort(np.abs(times - start))[:2].tolist()))
        raise InputError(f"--time: no scan lies between {start:g} and {end:g} s; the nearest are at {near} s")
    return found


def check_working(recording: Recording, scans: list[int], uav: int) -> None:
    """InputError if the UAV had broken down at one of the scans."""
    works = recording.working[:, uav]
    if not np.all(works[scans]):
        last = f"its last scan is that at {recording.times[works][-1]:g} s" if np.any(works) else "it never worked"
        time = recording.times[next(k for k in scans if not works[k])]
        raise InputError(f"--time: at {time:g} s UAV {uav} had broken down; {last}")
