"""Curves over time, states and events for the Rerun viewer."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from sim.facts.event import IDENTITIES, UNMATCHED, Event
from sim.facts.flight import Flight
from sim.facts.metrics.fleet_facts import average_ospa
from sim.facts.metrics.holding import find_episodes
from sim.facts.people import STATES
from sim.mission.recording import Recording
from sim.views.drawing import palette
from sim.views.drawing.palette import Colour, lighten, pale, track_colour, uav_colour
from sim.views.rerun.scene import find_disagreements
from tracking.numerics.arrays import Array, Indices

_PEOPLE = (palette.SKY, palette.ORANGE, palette.VERMILLION, palette.PURPLE, palette.BLUE)
_SHADES = (palette.FAINT, palette.OUT_OF_VIEW, palette.HIDDEN, pale(palette.BLUE), palette.BLUE)
_STATES = dict(zip(STATES, _SHADES, strict=True))
_UNMATCHED = {
    "none": palette.PANEL,
    "false": palette.FALSE,
    "duplicate": pale(palette.FALSE),
    "false and duplicate": palette.FALSE,
}
_LEVELS = {
    **dict.fromkeys(("breakdown", "fault"), "ERROR"),
    **dict.fromkeys(("contact", "link lost", "person lost", *IDENTITIES, *UNMATCHED), "WARN"),
    **dict.fromkeys(("messages lost", "messages heard"), "DEBUG"),  # there may be hundreds
}


class Series(NamedTuple):
    """One curve; NaN means no value."""

    path: str
    name: str
    colour: Colour
    values: Array  # (K,)


def _list_ospa(recording: Recording) -> list[Series]:
    errors, means = recording.errors[:, :, 0], average_ospa(recording.errors)[:, 0]
    each = [Series(f"ospa/uav{i}", f"UAV {i}", uav_colour(i), error) for i, error in enumerate(errors.T)]
    return [*each, Series("ospa/mean", "mean", (255, 255, 255), means)]


def _list_tracks(recording: Recording) -> list[Series]:
    """For each track, the mean trace of its position covariance over UAVs, and the largest gap between their means."""
    numbers = recording.track_numbers
    scans = len(recording.times)
    traces, gaps = np.full((len(numbers), scans), np.nan), np.full((len(numbers), scans), np.nan)
    for k in range(scans):
        held = [track for i in range(recording.uav_count) for track in recording.tracks_at(k, i)]
        for id_ in {track.id for track in held}:
            own = [np.trace(track.belief.covariance[:2, :2]) for track in held if track.id == id_]
            traces[numbers[id_], k] = np.mean(own)
        for pair in find_disagreements(recording, k):
            gaps[pair.track, k] = round(pair.metres, 6)  # UAVs that agree may differ by rounding
    return [
        Series(f"{kind}/track{n}", f"track {n}", lighten(track_colour(n)), values)
        for kind, table in (("covariance", traces), ("agreement", gaps))
        for n, values in enumerate(table)
        if not np.all(np.isnan(values))
    ]


def _list_bytes(recording: Recording) -> list[Series]:
    return [
        Series(f"bytes/{what}/uav{i}", f"{what}, UAV {i}", colour, sent)
        for what, table in (("tracks", recording.bytes_sent), ("plans", recording.plan_bytes))
        for i, sent in enumerate(table.T.astype(float))
        for colour in [uav_colour(i) if what == "tracks" else lighten(uav_colour(i))]
    ]


def _list_visible(recording: Recording) -> list[Series]:
    """Number of pixels of each person in all images of a scan."""
    present = ~np.isnan(recording.people[:, :, 0])
    pixels = np.where(present, recording.visible.sum(axis=1), np.nan)
    return [
        Series(f"visible/person{m}", f"person {m}", _PEOPLE[m % len(_PEOPLE)], pixels[:, m])
        for m in range(pixels.shape[1])
    ]


def log_series(stream: rr.RecordingStream, recording: Recording, planning_s: Sequence[float]) -> None:
    """Log OSPA, trace of covariance, disagreement, bytes sent and visibility at each scan.

    planning_s: seconds that each decision took; may be empty.
    """
    times = recording.times
    scans = np.arange(len(recording.times))
    for series in (
        *_list_ospa(recording),
        *_list_tracks(recording),
        *_list_bytes(recording),
        *_list_visible(recording),
    ):
        _log(stream, series, times, scans)
    if len(planning_s):
        made = recording.plan_times
        took = Series("planning", "decision of the team", palette.SKY, 1000 * np.array(planning_s))
        _log(stream, took, made, np.searchsorted(times, made))


def _log(stream: rr.RecordingStream, series: Series, times: Array, scans: NDArray[np.intp]) -> None:
    path = f"plots/{series.path}"
    stream.log(path, rr.SeriesLines(colors=[series.colour], names=[series.name], widths=[1.5]), static=True)
    indexes = [rr.TimeColumn("time", duration=times), rr.TimeColumn("scan", sequence=scans)]
    stream.send_columns(path, indexes=indexes, columns=rr.Scalars.columns(scalars=series.values))


def log_states(stream: rr.RecordingStream, flight: Flight) -> None:
    """Log each person's states in the cameras and to the tracks, and tracks that stand for no person."""
    recording, people = flight.recording, flight.people
    for m in range(recording.person_count):
        _log_states(stream, f"people/{m}/cameras", recording.times, people.states[:, m], _STATES)
        _log_states(stream, f"people/{m}/tracks", recording.times, people.hold_states[:, m], palette.HOLD_COLOURS)
    kinds = np.zeros(len(recording.times), dtype=np.int64)
    for event in flight.events:
        if event.kind in UNMATCHED:
            kinds[event.first : event.last + 1] |= 1 + UNMATCHED.index(event.kind)
    _log_states(stream, "people/none/tracks", recording.times, kinds, _UNMATCHED)


def _log_states(
    stream: rr.RecordingStream, path: str, times: Array, states: Indices, colours: dict[str, Colour]
) -> None:
    """Log the beginnings of states (K,), which are indices into the names of `colours`."""
    names, spans = list(colours), find_episodes(states)
    changes = [span.first for span in spans]
    indexes = [rr.TimeColumn("time", duration=times[changes]), rr.TimeColumn("scan", sequence=changes)]
    shown = rr.StateConfiguration(values=names, labels=names, colors=list(colours.values()))
    stream.log(path, shown, static=True)
    columns = rr.StateChange.columns(state=[names[span.value] for span in spans])
    stream.send_columns(path, indexes=indexes, columns=columns)


def log_events(stream: rr.RecordingStream, events: Sequence[Event]) -> None:
    """Log each event at its time, and at the first scan that shows it."""
    for event in events:
        stream.set_time("time", duration=event.time)
        stream.set_time("scan", sequence=event.first)
        stream.log("events", rr.TextLog(f"{event.time:.1f} s: {event.sentence}", level=_LEVELS.get(event.kind, "INFO")))
