"""Images of the cameras for the Rerun viewer, with detections, projected tracks and data association."""

from collections.abc import Sequence

import cv2
import numpy as np
import rerun as rr

from sim.facts.rerender import Rerenderer
from sim.facts.tracking_replay import replay_tracking
from sim.facts.words import name_track, number_snapshot
from sim.views.drawing.palette import DETECTION, lighten, track_colour
from sim.views.drawing.tiles import draw_broken
from sim.views.rerun.scene import find_broken
from tracking.account import Association
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Image
from tracking.track import Track, beliefs_of

_QUALITY = 90  # JPEG quality
_BOX = 0.035  # half the width of a detection's mark, as a share of the image
_TILE = 160  # pixels, edge of a drawing with legible words
_SLIGHT = 0.01  # weight below which no line is drawn


class Cameras:
    """Logs camera images scan by scan."""

    def __init__(self, stream: rr.RecordingStream, again: Rerenderer) -> None:
        self._stream, self._again = stream, again
        self._recording, self._uavs = again.recording, again.recording.setting.uavs
        self._replay, self._taken = replay_tracking(again.recording), again.recording.frames_taken

    def log(self, k: int) -> None:
        """Log scan k: the images that cameras took, and placeholders for UAVs that broke down."""
        for i in find_broken(self._recording, k):
            self._log_breakdown(i)
        tracks = number_snapshot(self._recording, k).tracks
        for i, uav in enumerate(self._uavs):
            if not self._taken[k, i]:
                continue
            root = f"world/camera/{i}"
            self._log_image(i, self._again.image(k, i))
            spots = self._spots(k, i)
            inside = spots[~np.isnan(spots).any(axis=1)]
            half = np.full(inside.shape, _BOX * uav.pixels)  # equally large in all images
            frames = rr.Boxes2D(centers=inside, half_sizes=half, radii=rr.Radius.ui_points(1), colors=[DETECTION])
            self._stream.log(f"{root}/detections", frames)
            self._log_tracks(k, i, tracks[i])
            association = self._replay.association(k, i)
            if association:
                self._log_association(k, i, association, spots)

    def _log_image(self, uav: int, image: Image) -> None:
        made, content = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        assert made
        encoded = rr.EncodedImage(contents=content.tobytes(), media_type="image/jpeg", draw_order=-10)
        self._stream.log(f"world/camera/{uav}/image", encoded)

    def _log_breakdown(self, uav: int) -> None:
        tile = np.empty((_TILE, _TILE, 3), dtype=np.uint8)
        draw_broken(tile, uav)
        self._log_image(
            uav, np.asarray(cv2.resize(tile, self._uavs[uav].true_camera.size, interpolation=cv2.INTER_AREA), np.uint8)
        )
        root = f"world/camera/{uav}"
        for path in (f"{root}/detections", f"{root}/tracks", f"{root}/association", f"association/{uav}"):
            self._stream.log(path, rr.Clear(recursive=False))

    def _project(self, k: int, uav: int, places: Array) -> Array:
        """Pixels (N, 2) of the mid-height of people at places (N, 2 or more) m; NaN outside the image."""
        camera, pose = self._uavs[uav].true_camera, self._recording.believed_camera_at(k, uav)
        points = at_target_height(places[:, :2])
        return np.where(camera.sees(pose, points)[:, None], camera.project(pose, points)[0], np.nan)

    def _spots(self, k: int, uav: int) -> Array:
        """Pixels (N, 2) of the measurements; in ideal sensing, of their ground points."""
        pixels = self._recording.pixels_at(k, uav)
        places = self._recording.scan_at(k, uav).measurements
        return pixels if len(pixels) == len(places) else self._project(k, uav, places)

    def _log_tracks(self, k: int, uav: int, tracks: Sequence[Track]) -> None:
        marks = self._project(k, uav, beliefs_of(tracks).means)
        shown = np.flatnonzero(~np.isnan(marks[:, 0])).tolist()
        points = rr.Points2D(
            marks[shown],
            radii=rr.Radius.ui_points(3),
            colors=[lighten(track_colour(tracks[j].id)) for j in shown],
            labels=[name_track(tracks[j]) for j in shown],
            show_labels=True,
        )
        self._stream.log(f"world/camera/{uav}/tracks", points)

    def _log_association(self, k: int, uav: int, association: Association, spots: Array) -> None:
        """Log a table of weights, and lines from predicted tracks to measurements, which are wider for larger ones."""
        weights, numbers = association.weights(), self._recording.numbers_of(association.ids).tolist()
        marks = self._project(k, uav, association.before.means)
        ends = ~np.isnan(marks[:, :1]) & ~np.isnan(spots[:, 0])
        pairs = np.argwhere((weights >= _SLIGHT) & ends).tolist()
        lines = rr.LineStrips2D(
            [np.array([marks[t], spots[n]]) for t, n in pairs],
            colors=[lighten(track_colour(numbers[t])) for t, _ in pairs],
            radii=rr.Radius.ui_points([0.5 + 1.5 * float(weights[t, n]) for t, n in pairs]),
            labels=[f"{numbers[t]}: {weights[t, n]:.2f}" for t, n in pairs],
            show_labels=False,
        )
        self._stream.log(f"world/camera/{uav}/association", lines)
        words = rr.TextDocument(format_association(association, numbers), media_type="text/markdown")
        self._stream.log(f"association/{uav}", words)


def format_association(association: Association, numbers: Sequence[int]) -> str:
    """The association weights in Markdown: a row for each track, with these numbers, and a column per measurement."""
    heads = ["track", "none", *(f"detection {n}" for n in range(len(association.measurements)))]
    lines = [heads, ["---"] * len(heads)]
    rows = zip(numbers, association.after.missed, association.gated(), association.weights(), strict=True)
    for number, missed, gated, weights in rows:
        cells = [f"{weight:.2f}" if inside else "-" for weight, inside in zip(weights, gated, strict=True)]
        lines.append([str(number), f"{missed:.2f}", *cells])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
