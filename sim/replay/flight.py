"""A recorded mission with its history, events, tables with units, and figures."""

import io
import sys
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sim.drawing.lettering import Image
from sim.drawing.map_view import MapView, measure_map
from sim.drawing.plots import draw_ospa_figure
from sim.evaluation.catalogue import METRICS
from sim.evaluation.metric import Outcome
from sim.evaluation.summary import format_planner_title
from sim.recording.archive import find_recording, save
from sim.recording.dataframes import make_dataframe
from sim.recording.recording import Recording
from sim.replay.columns import TABLES, make_columns, make_event_columns
from sim.replay.event import Event, find_ends
from sim.replay.events import find_events
from sim.replay.frames.frame_panels import draw_frame_page, find_scans
from sim.replay.frames.rerender import Rerenderer
from sim.replay.history import History
from sim.replay.timeline import draw_timeline
from sim.scenario.random_streams import format_seed
from sim.scenario.scenario import Scenario
from tracking.errors import InputError, check_known

_MAP = 900  # pixels, width of the map


def load(run: str | Path) -> "Flight":
    """Load the mission in a run's folder or a file `mission.npz`; InputError if none can be read."""
    _show_figures()
    return Flight(find_recording(Path(run)))


class Flight:
    """One recorded mission with its tables and figures; `recording` has the arrays, and `scenario` the settings."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.scenario: Scenario = recording.setting

    @cached_property
    def history(self) -> History:
        """The history of each person, scan by scan."""
        return History.of(self.recording)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The events of the mission, in order of time."""
        return find_events(self.recording, self.history)

    def save(self, path: str | Path) -> None:
        """Write the recording to a file, such as episode.npz, which `load` and the commands read; else InputError."""
        try:
            save(self.recording, path)
        except OSError as error:
            raise InputError(f"path: {path} cannot be written: {error.strerror or error}") from error

    def columns(self, table: str) -> dict[str, NDArray[Any]]:
        """The columns of a table, one of `TABLES`, by names with units; InputError suggests the nearest table."""
        check_known("table", table, TABLES)
        if table == "events":
            return make_event_columns(self.events)
        return make_columns(table, self.recording, self.history)

    def table(self, table: str) -> Any:  # noqa: ANN401 - a data frame of pandas or polars, both of which are optional
        """A table, one of `TABLES`, as a pandas data frame, or a polars one if pandas is not installed."""
        return make_dataframe(self.columns(table))

    def ospa_figure(self) -> Figure:
        """OSPA over time; InputError if people are unknown."""
        self._check_labels("OSPA")
        return draw_ospa_figure(self.recording.times, self.recording.ospa)

    def timeline_figure(self) -> Figure:
        """The timeline: the states of each person in the cameras and to the tracks; InputError if they are unknown."""
        self._check_labels("timeline")
        return draw_timeline(self.history, self.recording.ospa, self.events)

    def _check_labels(self, what: str) -> None:
        if not self.recording.labelled:
            raise InputError(f"the people of this flight are unknown, so it has no {what}")

    def map_figure(self, time: float) -> Figure:
        """The map at the scan nearest to `time` s, with trails of the last seconds; its axes are in metres."""
        (k,) = find_scans(self.recording, time, None, name="time")
        width, height = measure_map(self.scenario)
        size = (_MAP, round(_MAP / (width / height)))
        view = MapView(self.scenario, self.recording.forest, size)
        edges = np.array([(0, 0), size]) - 0.5  # edges of the first and the last pixel, whose centres are integers
        (left, top), (right, bottom) = (edges - np.array(size) / 2) / view.scale
        image, _ = view.draw_recorded(self.recording, k, self.history.hold_states[k])
        return _make_picture(image, (left, right, -bottom, -top))

    def frame_figure(self, time: float, uav: int) -> Figure:
        """The annotated image of a UAV's camera at the scan nearest to `time` s, rendered again."""
        uavs = len(self.scenario.uavs)
        if not 0 <= uav < uavs:
            raise InputError(f"uav: there is no UAV {uav}; allowed are 0 to {uavs - 1}")
        (k,) = find_scans(self.recording, time, None, uav, name="time")
        with Rerenderer(self.recording) as again:
            return _make_picture(draw_frame_page(again, k, uav, size=640))

    def __repr__(self) -> str:
        """The results of the mission in one line."""
        r = self.recording
        kinds = [loss.kind for loss in self.history.losses]
        lost = [loss for loss in self.history.losses if loss.kind == "person lost"]
        spans = [find_ends(r.times, loss.first, loss.last) for loss in lost]
        longest = max((end - begin for begin, end in spans), default=0.0)
        losses = f"{len(lost)}, the longest {longest:.1f} s" if lost else "none"
        if unfound := kinds.count("person not found yet"):
            losses += f", and {unfound} of people not found before"
        outcome, names = Outcome(r), ("ospa.mean_m", "ospa.share_under_1m", "share_held")
        mean, share, held = (METRICS[name].with_unit(METRICS[name](outcome)) for name in names)
        parts = [
            f"{format_planner_title(r.planner, r.sees_truth)}, {format_seed(r.seed, r.repeat)}",
            f"{r.times[-1] - r.times[0]:.1f} s, {len(r.times)} scans{' (interrupted)' * r.interrupted}",
            f"{r.poses.shape[1]} UAVs, {r.people.shape[1] if r.labelled else 'unknown'} people, {len(r.trees)} trees",
            f"OSPA mean {mean}, {share} under 1 m",
            f"people held {held}",
            f"losses {losses}",
        ]
        return f"<Flight: {'; '.join(parts)}>"


def _make_picture(image: Image, extent: tuple[float, float, float, float] | None = None) -> Figure:
    """A figure with the pixels of an image (H, W, 3) and its size; `extent` as in Matplotlib."""
    height, width = image.shape[:2]
    figure = Figure(figsize=(width / 100, height / 100), dpi=100)
    FigureCanvasAgg(figure)  # whose pixels can be asked for
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image, interpolation="none", aspect="auto", extent=extent)
    axes.autoscale(False)  # whatever else is drawn
    axes.set_axis_off()
    return figure


def _show_figures() -> None:
    """Let notebooks show figures, which they do by themselves only after an import of pyplot."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is not None:
        shown = shell.display_formatter.formatters["image/png"]
        if Figure not in shown.type_printers:
            shown.for_type(Figure, _encode_png)


def _encode_png(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=figure.dpi)
    return content.getvalue()
