"""Tables of a recording, with units in the names of columns."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.evaluation.score import estimate_velocities
from sim.recording.recording import Recording
from sim.replay.event import Event, find_ends
from sim.replay.history import STATES, History

Column = NDArray[Any]
Columns = dict[str, Column]
TABLES = ("people", "uavs", "sightings", "measurements", "tracks", "ospa", "plans", "trees", "losses", "events")


def columns(name: str, recording: Recording, history: History) -> Columns:
    """The columns of any table of `TABLES` but `events`, for which see `event_columns`."""
    if name in ("people", "sightings", "losses"):
        return {"people": _people, "sightings": _sightings, "losses": _losses}[name](recording, history)
    plain = {"uavs": _uavs, "measurements": _measurements, "tracks": _tracks, "ospa": _ospa, "plans": _plans}
    return {**plain, "trees": _trees}[name](recording)


def _people(r: Recording, history: History) -> Columns:
    k, m = np.nonzero(history.present)
    v = estimate_velocities(r)[k, m]
    return {
        "time_s": r.times[k],
        "person": m,
        **_xy("", "m", r.people[k, m]),
        **_xy("v", "m_per_s", v),
        "heading_rad": r.headings[k, m],
        "state": _words([STATES[state] for state in history.states[k, m]]),
        "held_by_uavs": history.held[k, m],
    }


def _sightings(r: Recording, history: History) -> Columns:
    """A row for each person inside a frame, or with a track."""
    k, i, m = np.nonzero(history.inside | history.shown | (history.tracks >= 0))
    return {
        "time_s": r.times[k],
        "uav": i,
        "person": m,
        "inside": history.inside[k, i, m],
        "hidden_by_tree": history.hidden_by[k, i, m],
        "visible_px": r.visible[k, i, m],
        "detected": history.detected[k, i, m],
        "held_by_track": r.numbers_of(history.tracks[k, i, m]),
    }


def _losses(r: Recording, history: History) -> Columns:
    lost = history.losses
    begin, end = np.array([find_ends(r.times, loss.first, loss.last) for loss in lost]).reshape(-1, 2).T
    return {
        "person": np.array([loss.person for loss in lost], dtype=np.int64),
        "from_s": begin,
        "until_s": end,
        "held_before": np.array([loss.found for loss in lost], dtype=np.bool_),
        **{
            f"scans_{where}": np.array([loss.scans[n] for loss in lost], dtype=np.int64)
            for n, where in enumerate(("without_track", "outside_ellipse", "inside_ellipse"))
        },
    }


def event_columns(events: Sequence[Event]) -> Columns:
    """The columns of the table of events."""
    return {
        "time_s": np.array([event.time for event in events], dtype=float),
        "kind": _words([event.kind for event in events]),
        "text": _words([event.sentence for event in events]),
    }


def _uavs(r: Recording) -> Columns:
    k, i = (index.ravel() for index in np.indices(r.poses.shape[:2]))
    return {
        "time_s": r.times[k],
        "uav": i,
        **_xy("", "m", r.poses[k, i]),
        "z_m": r.poses[k, i, 2],
        **_xy("command_v", "m_per_s", r.commands[k, i]),
        "works": r.working[k, i],
        "sent_bytes": r.bytes_sent[k, i],
        "sent_plans_bytes": r.plan_bytes[k, i],
    }


def _measurements(r: Recording) -> Columns:
    k, i = r.cells(r.measurement_offsets)
    covariance = _covariance(r.measurement_covariances)
    pixels = {"u_px": r.pixels[:, 0], "v_px": r.pixels[:, 1]}
    return {"time_s": r.times[k], "uav": i, **_xy("", "m", r.measurements), **covariance, **pixels}


def _tracks(r: Recording) -> Columns:
    k, i = r.cells(r.track_offsets)
    return {
        "time_s": r.times[k],
        "uav": i,
        "track": r.numbers_of(r.track_ids),
        **_xy("", "m", r.track_means),
        **_xy("v", "m_per_s", r.track_means[:, 2:]),
        **_covariance(r.track_covariances),
        "existence": r.track_existence,
    }


def _ospa(r: Recording) -> Columns:
    k, i = np.nonzero(r.working)
    parts = dict(zip(("ospa_m", "localisation_m", "cardinality_m"), r.ospa[k, i].T, strict=True))
    return {"time_s": r.times[k], "uav": i, **parts}


def _plans(r: Recording) -> Columns:
    e, i, step = np.nonzero(~np.isnan(r.plans[..., 0]))
    return {"time_s": r.plan_times[e], "uav": i, "step": step, **_xy("v", "m_per_s", r.plans[e, i, step])}


def _trees(r: Recording) -> Columns:
    parts = ["x_m", "y_m", "canopy_radius_m", "canopy_base_m", "canopy_top_m", "trunk_radius_m"]
    parts += ["leaf_area_density_m2_per_m3"]
    rows = np.column_stack([r.trees, np.full(len(r.trees), np.inf)])[:, : len(parts)]  # recorded if any is porous
    return {"tree": np.arange(len(rows)), **dict(zip(parts, rows.T, strict=True))}


def _xy(prefix: str, unit: str, values: Column) -> Columns:
    return {f"{prefix}x_{unit}": values[:, 0], f"{prefix}y_{unit}": values[:, 1]}


def _covariance(covariances: Column) -> Columns:
    return {"xx_m2": covariances[:, 0, 0], "xy_m2": covariances[:, 0, 1], "yy_m2": covariances[:, 1, 1]}


def _words(texts: list[str]) -> Column:
    return np.array(texts, dtype=object)
