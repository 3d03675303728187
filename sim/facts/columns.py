"""Tables of a recording, with units in the names of columns."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.facts.event import Event, find_ends
from sim.facts.metrics.mapping_score import compare_map
from sim.facts.metrics.score import estimate_velocities
from sim.facts.people import PeopleFacts
from sim.facts.sightings import STATES
from sim.mission.recording import Recording
from sim.world.stem_map import TREE_COLUMNS
from tracking.errors import InputError

Column = NDArray[Any]
Columns = dict[str, Column]
TABLES = ("people", "uavs", "sightings", "measurements", "tracks", "ospa", "plans", "trees", "maps", "losses", "events")


def make_columns(name: str, facts: PeopleFacts) -> Columns:
    """The columns of any table of `TABLES` but `events`, for which see `make_event_columns`."""
    of_people = {"people": _list_people, "sightings": _list_sightings, "losses": _list_losses}
    plain = {"uavs": _list_uavs, "measurements": _list_measurements, "tracks": _list_tracks}
    plain |= {"ospa": _list_ospa, "plans": _list_plans, "trees": _list_trees, "maps": _list_maps}
    return of_people[name](facts) if name in of_people else plain[name](facts.recording)


def _list_people(facts: PeopleFacts) -> Columns:
    r = facts.recording
    k, m = np.nonzero(r.present)
    v = estimate_velocities(r)[k, m]
    return {
        "time_s": r.times[k],
        "person": m,
        **_split_xy("", "m", r.people[k, m]),
        **_split_xy("v", "m_per_s", v),
        "heading_rad": r.headings[k, m],
        "state": _make_text_column([STATES[state] for state in facts.states[k, m]]),
        "held_by_uavs": facts.held[k, m],
    }


def _list_sightings(facts: PeopleFacts) -> Columns:
    """A row for each person inside a frame, or with a track."""
    r = facts.recording
    k, i, m = np.nonzero(facts.views.inside | facts.shown | (facts.tracks >= 0))
    return {
        "time_s": r.times[k],
        "uav": i,
        "person": m,
        "inside": facts.views.inside[k, i, m],
        "hidden_by_tree": facts.views.hidden_by[k, i, m],
        "visible_px": r.visible[k, i, m],
        "detected": facts.detected[k, i, m],
        "held_by_track": r.numbers_of(facts.tracks[k, i, m]),
    }


def _list_maps(r: Recording) -> Columns:
    """A row for each map that a UAV began to believe; none if all were given one."""
    k, i = np.nonzero(r.new_maps)
    scores = [compare_map(r.believed_at(*cell), r.forest) for cell in zip(k.tolist(), i.tolist(), strict=True)]
    return {
        "time_s": r.times[k],
        "uav": i,
        **{
            f"trees_{name}": np.array([getattr(score, name) for score in scores], dtype=np.int64)
            for name in ("seen", "found", "mapped")
        },
        "trees_true": np.array([len(score.distances) for score in scores], dtype=np.int64),
        "error_m": np.array([score.error for score in scores], dtype=float),
    }


def _list_losses(facts: PeopleFacts) -> Columns:
    """A row for each span in which no UAV held a person who was there, with one grade."""
    spans = facts.unheld
    begin, end = np.array([find_ends(facts.recording.times, span.first, span.last) for span in spans]).reshape(-1, 2).T
    return {
        "person": np.array([span.person for span in spans], dtype=np.int64),
        "grade": _make_text_column([span.grade for span in spans]),
        "from_s": begin,
        "until_s": end,
        "held_before": np.array([span.found for span in spans], dtype=np.bool_),
        **{
            f"scans_{where}": np.array([span.scans[n] for span in spans], dtype=np.int64)
            for n, where in enumerate(("without_track", "outside_ellipse", "inside_ellipse"))
        },
    }


def make_event_columns(events: Sequence[Event]) -> Columns:
    """The columns of the table of events."""
    return {
        "time_s": np.array([event.time for event in events], dtype=float),
        "kind": _make_text_column([event.kind for event in events]),
        "text": _make_text_column([event.sentence for event in events]),
    }


def _list_uavs(r: Recording) -> Columns:
    k, i = (index.ravel() for index in np.indices((r.scan_count, r.uav_count)))
    return {
        "time_s": r.times[k],
        "uav": i,
        **_split_xy("", "m", r.poses[k, i]),
        "z_m": r.poses[k, i, 2],
        **_split_xy("command_v", "m_per_s", r.commands[k, i]),
        "works": r.working[k, i],
        "sent_bytes": r.bytes_sent[k, i],
        "sent_plans_bytes": r.plan_bytes[k, i],
        **({} if r.map_bytes is None else {"sent_maps_bytes": r.map_bytes[k, i]}),
    }


def _list_measurements(r: Recording) -> Columns:
    k, i = r.cells(r.measurement_offsets)
    covariance = _split_covariance(r.measurement_covariances)
    pixels = {"u_px": r.pixels[:, 0], "v_px": r.pixels[:, 1]}
    return {"time_s": r.times[k], "uav": i, **_split_xy("", "m", r.measurements), **covariance, **pixels}


def _list_tracks(r: Recording) -> Columns:
    k, i = r.cells(r.track_offsets)
    return {
        "time_s": r.times[k],
        "uav": i,
        "track": r.numbers_of(r.track_ids),
        **_split_xy("", "m", r.track_means),
        **_split_xy("v", "m_per_s", r.track_means[:, 2:]),
        **_split_covariance(r.track_covariances),
        "existence": r.track_existence,
    }


def _list_ospa(r: Recording) -> Columns:
    k, i = np.nonzero(~np.isnan(r.errors[:, :, 0]))
    parts = dict(zip(("ospa_m", "localisation_m", "cardinality_m"), r.errors[k, i].T, strict=True))
    return {"time_s": r.times[k], "uav": i, **parts}


def _list_plans(r: Recording) -> Columns:
    e, i, step = np.nonzero(~np.isnan(r.plans[..., 0]))
    return {"time_s": r.plan_times[e], "uav": i, "step": step, **_split_xy("v", "m_per_s", r.plans[e, i, step])}


def _list_trees(r: Recording) -> Columns:
    rows = np.column_stack([r.trees, np.full(len(r.trees), np.inf)])[:, : len(TREE_COLUMNS)]  # recorded if porous
    return {"tree": np.arange(len(rows)), **dict(zip(TREE_COLUMNS, rows.T, strict=True))}


def _split_xy(prefix: str, unit: str, values: Column) -> Columns:
    return {f"{prefix}x_{unit}": values[:, 0], f"{prefix}y_{unit}": values[:, 1]}


def _split_covariance(covariances: Column) -> Columns:
    return {"xx_m2": covariances[:, 0, 0], "xy_m2": covariances[:, 0, 1], "yy_m2": covariances[:, 1, 1]}


def _make_text_column(texts: list[str]) -> Column:
    return np.array(texts, dtype=object)


def make_dataframe(columns: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a frame of pandas or polars, both optional
    """Columns of equal length as a pandas data frame, or a polars one without pandas; InputError without both."""
    for library in ("pandas", "polars"):
        try:
            made = import_module(library).DataFrame
        except (ImportError, AttributeError):  # AttributeError: a folder with the library's name was imported
            continue
        return made(dict(columns))
    raise InputError("tables need pandas or polars; neither is installed: pip install pandas")
