"""The film of a mission: the map, and each camera's frame with its detections."""

import math
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from av.container import OutputContainer
from av.video.stream import VideoStream

from sim.mission.atomic_files import make_part_path
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from sim.views.drawing.layout import GAP, Box, Parts, arrange_parts
from sim.views.drawing.legend import draw_legend
from sim.views.drawing.lettering import TextStyle, write
from sim.views.drawing.map_view import MapView
from sim.views.drawing.strokes import draw_disc, draw_line
from sim.views.drawing.tiles import draw_tile
from sim.views.palette import FAINT, PAPER, VERMILLION
from sim.views.scene import Scene, SceneMaker, measure_map
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array, Image

AS_FLOWN = "map+cameras"  # the layout of a run's film
WIDTH, HEIGHT = 1280, 720
_HEADER, _LEGEND = 48, 40
_LOW, _HIGH = 0.1, 50.0  # m, range of the curve of OSPA
_PANEL = Box(GAP, _HEADER, WIDTH - 2 * GAP, HEIGHT - _HEADER - _LEGEND)
_BT601 = 6  # OpenCV's colour matrix, which the file must name because players assume another one for HD


def lay_out_parts(scenario: Scenario, layout: str = AS_FLOWN) -> Parts:
    """Boxes of the map and the cameras in a film; `layout` as in `sim.views.drawing.layout.arrange_parts`."""
    width, height = measure_map(scenario)
    return arrange_parts(_PANEL, width / height, len(scenario.uavs), layout if scenario.sensing.renders else "map")


class Film:
    """Draws snapshots, in order of time, as frames of 1280 x 720.

    Tracks are numbered in the order of their appearance, because their ids are too long to read.
    """

    def __init__(
        self,
        scenario: Scenario,
        forest: Forest,
        *,
        planner: str,
        layout: str = AS_FLOWN,
        labelled: bool = True,
        believed: Forest | None = None,
    ) -> None:
        """Lay out the film; `layout` as in `layout.arrange_parts`. Ideal sensing has no cameras to show.

        believed: the map of trees that UAVs believe, where it may differ. labelled: False if people are unknown; the
        film then shows detections on the map, and no OSPA.
        """
        self._labelled = labelled
        self._cameras = [uav.believed_camera for uav in scenario.uavs]  # through which UAVs see their tracks
        self._layout = lay_out_parts(scenario, layout)
        room = self._layout.map or _PANEL
        self._map = MapView(scenario, forest, (room.width, room.height), believed)
        self._scenes = SceneMaker(scenario, labelled=labelled)
        self._last: dict[int, Image] = {}  # each tile as of its camera's last frame
        first = "UAV 0" if scenario.uavs[0].fails_at is None else "first UAV that works"
        # scans in which each camera takes a frame
        self.cycle = max(scenario.frame_scans(i) for i in range(len(scenario.uavs)))
        self._empty = np.full((HEIGHT, WIDTH, 3), PAPER, dtype=np.uint8)
        header = self._empty[:_HEADER, GAP:-GAP]
        write(header, planner, (96, _HEADER / 2), TextStyle(18))
        if labelled:
            write(header, "OSPA, mean of UAVs", (header.shape[1] - 424, _HEADER / 2), TextStyle(13, FAINT), align=1.0)
        self._sparkline = _Sparkline(header[6:-4, -300:].copy(), scenario.duration)
        legend = self._empty[-_LEGEND:, GAP:-GAP]
        owner = first if self._layout.map else None
        tiles = bool(self._layout.tiles)
        draw_legend(
            legend,
            scenario,
            owner=owner,
            tiles=tiles,
            scale=self._map.scale,
            forest=forest,
            believed_forest=believed,
            labelled=labelled,
        )

    @property
    def cameras(self) -> tuple[int, ...]:
        """UAVs with an image in the film."""
        return tuple(self._layout.tiles)

    def draw(self, snapshot: Snapshot, frames: Sequence[Image | None] | None) -> Image:
        """One frame (720, 1280, 3) RGB; `frames` holds each camera's image (H, W, 3) RGB, if there are any."""
        scene = self._take(snapshot)
        image = self._empty.copy()
        if self._layout.map is not None:
            self._map.draw(scene, image[self._layout.map.slices])
        self._draw_tiles(image, scene, frames)
        self._draw_header(image[:_HEADER, GAP:-GAP], scene)
        return image

    def follow(self, snapshot: Snapshot, frames: Sequence[Image | None] | None) -> None:
        """Process a snapshot that is not shown, so that later ones are drawn as in the whole film.

        `frames` as in `draw`; only the last frame of each camera is used, and only if the camera is slower than scans.
        """
        scene = self._take(snapshot)
        if frames is not None:
            self._draw_tiles(self._empty.copy(), scene, frames)

    def _take(self, snapshot: Snapshot) -> Scene:
        """The scene of the next snapshot; the curve of OSPA grows."""
        self._sparkline.add(snapshot.time, snapshot.error)
        return self._scenes.add(snapshot)

    def _draw_tiles(self, image: Image, scene: Scene, frames: Sequence[Image | None] | None) -> None:
        for i, tile in self._layout.tiles.items():
            uav = scene.uavs[i]
            frame = None if frames is None else frames[i]
            if uav.works and frames is not None and frame is None and i in self._last:
                image[tile.slices] = self._last[i]
            else:
                draw_tile(image[tile.slices], uav, camera=self._cameras[i], frame=frame)
                self._last[i] = image[tile.slices].copy()

    def _draw_header(self, image: Image, scene: Scene) -> None:
        big, error = TextStyle(20, bold=True), scene.error
        write(image, f"{scene.time:.1f} s", (72, _HEADER / 2), big, align=1.0)
        if not self._labelled:
            return
        text = "-" if math.isnan(error) else f"{error:.2f} m"
        write(image, text, (image.shape[1] - 314, _HEADER / 2), big, align=1.0)
        self._sparkline.draw(image[6:-4, -300:])


class _Sparkline:
    """The mean OSPA of the fleet so far, on a logarithmic scale, as a line that grows in an RGB image of its own."""

    def __init__(self, image: Image, duration: float) -> None:
        self._image = image
        self._duration = duration
        self._extent = image.shape[1] - 34
        self._last: Array | None = None  # (2,) pixel
        metre = self._level(1.0)
        draw_line(image, np.array([(0, metre), (self._extent, metre)]), FAINT)
        write(image, "1 m", (self._extent + 6, metre), TextStyle(12, FAINT))

    def add(self, time: float, ospa: float) -> None:
        """Add one value [m], or NaN for none."""
        if math.isnan(ospa):
            return
        now = np.array([min(time / self._duration, 1.0) * self._extent, self._level(ospa)])
        if self._last is not None:
            draw_line(self._image, np.array([self._last, now]), VERMILLION)
        self._last = now

    def draw(self, image: Image) -> None:
        """Draw the line so far, with a mark at the last value."""
        image[:] = self._image
        if self._last is not None:
            draw_disc(image, self._last, 3.0, VERMILLION)

    def _level(self, ospa: float) -> float:
        """Pixels from the top, at 8 to 92 % of the height."""
        share = math.log(min(max(ospa, _LOW), _HIGH) / _LOW) / math.log(_HIGH / _LOW)
        return (0.92 - 0.84 * share) * float(self._image.shape[0])


def add_stream(container: OutputContainer, fps: int | Fraction, **options: str) -> VideoStream:
    """A stream for the frames of a film; options of x264."""
    stream = container.add_stream("libx264", rate=fps, options=options)
    stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    stream.codec_context.colorspace = _BT601
    stream.codec_context.gop_size = math.ceil(5 * fps)
    return stream


class Video(AbstractContextManager["Video"]):
    """An H.264 file for browsers, written frame by frame; it appears at `path` when it is closed.

    As a context manager, it is closed at the end of the block, and leaves no file if the block raises.
    """

    def __init__(self, path: Path, film: Film, *, fps: int | Fraction) -> None:
        self._path = path
        self._part = make_part_path(path)
        self._film = film
        self._container = av.open(str(self._part), "w", format="mp4", options={"movflags": "faststart"})
        self._stream = add_stream(self._container, fps, preset="veryfast", crf="23")
        self._frames = 0

    def add(self, snapshot: Snapshot, frames: Sequence[Image | None] | None) -> None:
        """Append one snapshot; `frames` holds each camera's image (H, W, 3) RGB, if there are any."""
        image = self._film.draw(snapshot, frames)
        yuv = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        planes = av.VideoFrame.from_ndarray(yuv, format="yuv420p")
        planes.pts = self._frames
        self._frames += 1
        self._container.mux(self._stream.encode(planes))

    def close(self) -> None:
        """Finish the file, which any number of frames makes playable; without frames there is no file."""
        if self._frames == 0:
            self.discard()
            return
        try:
            self._container.mux(self._stream.encode(None))
            self._container.close()
            os.replace(self._part, self._path)
        except BaseException:
            self.discard()
            raise

    def discard(self) -> None:
        """Remove the unfinished file."""
        with suppress(OSError):  # the disk may be full, which may be the reason to discard
            self._container.close()
        with suppress(OSError):
            self._part.unlink()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()
