"""A recorded mission with its people, events, tables with units, and figures.

The figures are views, which stand above facts: they are imported when a figure is asked for.
"""

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sim.facts.columns import TABLES, make_columns, make_dataframe, make_event_columns
from sim.facts.event import Event
from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.holding import GRADES
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import format_recording_title
from sim.facts.mission_events import find_events
from sim.facts.people import PeopleFacts, tell_losses
from sim.mission.archive import find_recording, save
from sim.mission.recording import Recording
from sim.scenario.scenario import Scenario
from tracking.errors import InputError, check_known

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_SLACK = 1e-6  # s, tolerance for typed times


def load(run: str | Path) -> "Flight":
    """Load the mission in a run's folder or a file `mission.npz`; InputError if none can be read."""
    return Flight(find_recording(Path(run)))


def find_scans(
    recording: Recording, start: float, end: float | None, uav: int | None = None, *, name: str = "--time"
) -> list[int]:
    """Scans from `start` to `end` s, or only the one nearest to `start`.

    `name`: the option that error messages name. InputError if a time is not in the recording, or the UAV, if given,
    had broken down at one of the scans.
    """
    times = recording.times
    last = float(recording.times[-1])
    for time in (start, *([] if end is None else [end])):
        if not -_SLACK <= time <= last + _SLACK:
            raise InputError(f"{name}: {time:g} s is not in the recording; allowed are 0 to {last:g} s")
    found = [int(np.argmin(np.abs(times - start)))]
    if end is not None:
        found = np.flatnonzero((times >= start - _SLACK) & (times <= end + _SLACK)).tolist()
    if not found:
        near = ", ".join(f"{times[k]:g}" for k in sorted(np.argsort(np.abs(times - start))[:2].tolist()))
        raise InputError(f"{name}: no scan lies between {start:g} and {end:g} s; the nearest are at {near} s")
    works = recording.working[:, uav] if uav is not None else np.ones(len(times), dtype=np.bool_)
    if not works[found].all():
        until = f"its last scan is that at {times[works][-1]:g} s" if np.any(works) else "it never worked"
        time = float(times[next(k for k in found if not works[k])])
        raise InputError(f"{name}: at {time:g} s UAV {uav} had broken down; {until}")
    return found


class Flight:
    """One recorded mission with its tables and figures; `recording` has the arrays, and `scenario` the settings."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.scenario: Scenario = recording.setting

    @cached_property
    def people(self) -> PeopleFacts:
        """The state of each person, scan by scan."""
        return PeopleFacts(self.recording)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The events of the mission, in order of time."""
        return find_events(self.people)

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
        return make_columns(table, self.people)

    def table(self, table: str) -> Any:  # noqa: ANN401 - a data frame of pandas or polars, both of which are optional
        """A table, one of `TABLES`, as a pandas data frame, or a polars one if pandas is not installed."""
        return make_dataframe(self.columns(table))

    def ospa_figure(self) -> "Figure":
        """OSPA over time; InputError if people are unknown."""
        from sim.views.drawing.plots import draw_ospa_figure

        self._check_labels("OSPA")
        return draw_ospa_figure(self.recording.times, self.recording.ospa)

    def timeline_figure(self) -> "Figure":
        """The timeline: the states of each person in the cameras and to the tracks; InputError if they are unknown."""
        from sim.views.drawing.timeline import draw_timeline

        self._check_labels("timeline")
        return draw_timeline(self.people, self.recording.ospa, self.events)

    def _check_labels(self, what: str) -> None:
        if not self.recording.labelled:
            raise InputError(f"the people of this flight are unknown, so it has no {what}")

    def map_figure(self, time: float) -> "Figure":
        """The map at the scan nearest to `time` s, with trails of the last seconds; its axes are in metres."""
        from sim.views.frames.notebook import make_map_figure

        (k,) = find_scans(self.recording, time, None, name="time")
        return make_map_figure(self.recording, k, self.people.hold_states[k])

    def frame_figure(self, time: float, uav: int) -> "Figure":
        """The annotated image of a UAV's camera at the scan nearest to `time` s, rendered again."""
        from sim.views.frames.notebook import make_frame_figure

        uavs = len(self.scenario.uavs)
        if not 0 <= uav < uavs:
            raise InputError(f"uav: there is no UAV {uav}; allowed are 0 to {uavs - 1}")
        (k,) = find_scans(self.recording, time, None, uav, name="time")
        return make_frame_figure(self.recording, k, uav)

    def __repr__(self) -> str:
        """The results of the mission in one line."""
        r = self.recording
        outcome, names = Outcome(r), ("ospa.mean_m", "ospa.share_under_1m", "share_held")
        mean, share, held = (METRICS[name].with_unit(METRICS[name](outcome)) for name in names)
        parts = [
            format_recording_title(r),
            f"{r.times[-1] - r.times[0]:.1f} s, {r.scan_count} scans{' (interrupted)' * r.interrupted}",
            f"{r.uav_count} UAVs, {r.person_count if r.labelled else 'unknown'} people, {len(r.trees)} trees",
            f"OSPA mean {mean}, {share} under 1 m",
            f"people held {held}",
            *filter(None, (tell_losses(self.people, grade) for grade in GRADES if r.labelled)),
        ]
        return f"<Flight: {'; '.join(parts)}>"
