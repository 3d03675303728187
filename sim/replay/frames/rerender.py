"""Frames for the eye: images of a recorded mission, rendered again from its poses and annotated."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from sim.drawing.layout import GAP
from sim.drawing.lettering import Image
from sim.drawing.palette import PAPER, uav_colour
from sim.drawing.tiles import BORDER
from sim.evaluation.summary import titled
from sim.recording.archive import load
from sim.recording.atomic_files import new_folder
from sim.recording.npz import line
from sim.recording.recording import Recording
from sim.recording.validation import check_scenario
from sim.replay.frames.annotation import annotated
from sim.replay.frames.panel import WIDTH, draw_panel
from sim.replay.frames.sightings import Sight
from sim.scenario.errors import InputError
from sim.scenario.loading import decode
from sim.scenario.scenario import Scenario
from sim.sensing.renderer import Rendered, Renderer
from sim.sensing.sensors import camera_of
from sim.world.world import World

_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 6]  # less than half the size of OpenCV's default
_SLACK = 1e-6  # s, for times that were typed


class Rerenderer:
    """The world of a recording, in which any of its frames can be rendered again; nothing flies.

    The images are those of the mission, byte for byte: they follow from the scenario, seed, repeat and the poses
    of cameras, people and UAVs alone.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.scenario = scenario_of(recording)
        people = recording.people.shape[1]
        self._world = World(self.scenario, recording.forest, people, recording.seed, repeat=recording.repeat)
        self._renderer = Renderer(self._world)

    def image(self, k: int, uav: int) -> Image:
        """The image of the UAV's camera at scan k (P, P, 3) RGB; in ideal sensing, as it would have been."""
        return self.rendered(k, uav).image

    def rendered(self, k: int, uav: int) -> Rendered:
        """The same, and the person in each of its pixels."""
        snapshot = self._recording.snapshot(k)
        self._world.place_people(snapshot.people, snapshot.headings)
        self._world.place_uavs(snapshot.poses)
        camera = camera_of(self.scenario.uavs[uav])
        return self._renderer.take(uav, snapshot.time, camera, snapshot.cameras[uav])

    def frames(self, k: int, uavs: Sequence[int]) -> list[Image | None]:
        """The images that UAVs of the mission took at scan k, at each one's place; None for the rest, and for others.

        A UAV takes none when it has broken down, between those of a slow camera, and in ideal sensing.
        """
        taken: list[Image | None] = [None] * len(self.scenario.uavs)
        if self.scenario.sensing.mode == "camera":
            for i in uavs:
                if self._recording.working[k, i] and self.scenario.has_frame(i, k):
                    taken[i] = self.image(k, i)
        return taken

    def __enter__(self) -> Rerenderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._world.close()


def rerender(recording: Recording, k: int, uav: int) -> Image:
    """The image (P, P, 3) RGB of one UAV's camera at scan k; for many, a `Rerenderer` builds its world once."""
    with Rerenderer(recording) as again:
        return again.image(k, uav)


def scenario_of(recording: Recording) -> Scenario:
    """The scenario that a recording was flown in; InputError if this program does not know it."""
    try:
        scenario = decode(json.loads(recording.scenario))
    except (ValueError, RecursionError, OverflowError) as error:
        other = "made by another understory? its summary.json names the version that reads it"
        raise InputError(f"recording: its scenario: {line(error)}; {other}") from error
    check_scenario(recording, scenario)
    return scenario


def find(folder: Path) -> Recording:
    """The recording in a run's folder, or the file itself; InputError if there is none that can be read."""
    try:
        path = folder / "mission.npz" if folder.is_dir() else folder
        if not path.exists():
            raise InputError(f"{folder} " + (_holds(folder) if folder.is_dir() else "does not exist"))
        recording = load(path)
        scenario_of(recording)
    except OSError as error:
        raise InputError(f"DIR: {folder} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"DIR: {error}") from error
    return recording


def _holds(folder: Path) -> str:
    """The kind of a folder without a recording."""
    if (folder / "study.sqlite").exists():
        return "is a study's; its report.html has the commands that fly trials again, `--keep recordings` keeps them"
    return "holds no mission.npz"


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


def draw(recording: Recording, again: Rerenderer, k: int, uav: int, *, size: int) -> Image:
    """The annotated frame of one UAV at scan k, RGB, with its panel; `size` as in `annotated`."""
    sight = Sight.of(recording, again.scenario, k, uav)
    view = annotated(again.image(k, uav), sight, size)
    side = view.shape[0] + 2 * BORDER
    mount = {"gimbal": "camera on a gimbal", "body": "camera fixed to the body"}[again.scenario.uavs[uav].mount]
    notes = [
        titled(recording),
        f"scan {k} of {len(recording.times) - 1}, {mount}",
    ]
    if again.scenario.sensing.mode == "ideal":
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
