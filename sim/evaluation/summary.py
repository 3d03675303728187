"""What a mission came to: numbers for a file, and a table for the terminal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from sim.evaluation.machine import machine
from sim.evaluation.metrics import mean, metrics
from sim.mission.radio import disagreement
from sim.recording.archive import digest
from sim.recording.recording import Recording
from sim.scenario.random_streams import numbered
from sim.sensing.fault import Fault
from sim.sensing.stopwatch import STAGES
from sim.world.contacts import KINDS


def summarise(
    recording: Recording,
    *,
    seconds: Mapping[str, float],
    wall_s: float,
    faults: Sequence[Fault],
    versions: Mapping[str, str],
    planning_s: Sequence[float] = (),
) -> dict[str, Any]:
    """The content of `summary.json`.

    seconds: wall time per stage, and `start_up` if known; wall_s: wall time of all; planning_s: wall time of each
    decision. Shares and means are over all pairs of scan and UAV that works; null stands where there was nothing to
    count. `sim.evaluation.metrics` says what the figures are that need the tracks.
    """
    distance = recording.ospa[:, :, 0][recording.working]
    duration = float(recording.times[-1] - recording.times[0])
    flown = wall_s - seconds.get("video", 0.0) - seconds.get("start_up", 0.0)
    return {
        "planner": recording.planner,
        "sees_truth": recording.sees_truth,
        "seed": recording.seed,
        "repeat": recording.repeat,
        "scenario": json.loads(recording.scenario),
        "recording_sha256": digest(recording),
        "machine": machine(),
        "versions": dict(versions),
        "duration_s": duration,
        "interrupted": recording.interrupted,
        "ospa": {
            "mean_m": mean(distance),
            "median_m": float(np.median(distance)) if len(distance) else None,
            "share_under_1m": mean(distance < 1.0),
        },
        "detection": _detection(recording),
        **metrics(recording),
        "real_time_factor": duration / flown if flown > 0 else None,
        "wall_s": wall_s,
        "seconds": {stage: float(seconds.get(stage, 0.0)) for stage in (*STAGES, *_others(seconds))},
        "faults": [{name: value for name, value in asdict(f).items() if name != "trace" or value} for f in faults],
        "contacts": contacts(recording),
        "network": _network(recording),
        "planning_s": [round(lap, 6) for lap in planning_s],
    }


def marked(planner: str, sees_truth: bool) -> str:
    """A planner as it is shown: one that sees the truth bounds what others can reach."""
    return f"{planner} (sees the truth: an upper bound)" if sees_truth else planner


def titled(recording: Recording) -> str:
    """Planner, seed and repeat of a recording as they are shown."""
    return f"{marked(recording.planner, recording.sees_truth)}, {numbered(recording.seed, recording.repeat)}"


def contacts(recording: Recording) -> list[dict[str, Any]]:
    """Who touched what, and from when to when [s] by scan; one that lasts from scan to scan counts once."""
    found: list[dict[str, Any]] = []
    open_: dict[tuple[int, ...], tuple[int, dict[str, Any]]] = {}
    for k, *pair in recording.contacts.tolist():
        time, (uav, kind, other) = float(recording.times[k]), pair
        last, entry = open_.get(tuple(pair), (-2, {}))
        if last < k - 1:
            entry = {"time": time, "until": time, "uav": uav, "kind": KINDS[kind], "other": other}
            found.append(entry)
        entry["until"] = time
        open_[tuple(pair)] = (k, entry)
    return found


def results_table(summary: Mapping[str, Any]) -> Table:
    """The summary as it is shown at the end of a run."""
    ospa, detection = summary["ospa"], summary["detection"]
    flown = numbered(summary["seed"], summary["repeat"])
    title = f"{marked(summary['planner'], summary['sees_truth'])}, {flown}, {summary['duration_s']:.1f} s"
    table = Table(title=title + (" (interrupted)" if summary["interrupted"] else ""), title_justify="left")
    table.add_column("result")
    table.add_column("value", justify="right")
    table.add_row("OSPA mean", _metres(ospa["mean_m"]))
    table.add_row("OSPA median", _metres(ospa["median_m"]))
    table.add_row("OSPA under 1 m", _share(ospa["share_under_1m"]))
    for name, value in _tracks(summary):
        table.add_row(name, value)
    table.add_section()
    table.add_row("detection recall", _share(detection["recall"]))
    table.add_row("detection precision", _share(detection["precision"]), end_section=True)
    sent = summary["network"]["bytes_per_scan_mean"]
    if sent:
        table.add_row("sent by a UAV per scan", f"{sent / 1000:.1f} kB")
    plans = summary["network"]["plans"]
    if plans["bytes_total"] is not None:
        size, rounds = plans["bytes_per_decision_mean"], plans["rounds"]
        table.add_row("plans of a UAV per decision", f"{size:.0f} B, {rounds} round{'s' * (rounds != 1)}")
    table.add_section()
    factor = summary["real_time_factor"]
    table.add_row("real-time factor", "-" if factor is None else f"{factor:.1f}", end_section=True)
    for stage, spent in summary["seconds"].items():
        table.add_row(stage.replace("_", "-"), f"{spent:.2f} s")
    touched = summary["contacts"]
    if touched:
        table.add_section()
        table.add_row("contacts", str(len(touched)), style="bold red")
    for contact in touched[:3]:
        table.add_row(f"  at {contact['time']:.1f} s", f"UAV {contact['uav']}, {contact['kind']} {contact['other']}")
    return table


def _tracks(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The rows about tracks that OSPA does not tell."""
    switched, nees = summary["identity"]["switches"], summary["nees"]["position"]
    return [
        ("GOSPA mean", _metres(summary["gospa"]["mean_m"])),
        ("people held", _share(summary["share_held"])),
        ("identity switches", "-" if switched is None else f"{switched:.3g}"),
        ("NEES (consistent: 2)", f"{nees['mean']:.2f}" if nees["errors"] else "-"),
    ]


def _detection(recording: Recording) -> dict[str, float | None]:
    """Of the people of whom a camera shows a pixel, how many were detected; of detections, how many were people."""
    shown = recording.visible > 0
    detections = np.sum(~np.isnan(recording.pixels[:, 0]))
    return {
        "recall": _ratio(np.sum(recording.matched & shown), np.sum(shown)),
        "precision": _ratio(np.sum(recording.matched), detections),
    }


def _network(recording: Recording) -> dict[str, Any]:
    """Bytes sent, means over pairs of scan and UAV that works, and how far the UAVs' tracks differ."""
    scans, uavs = recording.working.shape
    known = recording.bytes_sent.shape == (scans, uavs) and recording.bytes_sent.min() >= 0
    sent = recording.bytes_sent[recording.working] if known else np.zeros(0, dtype=np.int64)
    gaps = [
        disagreement([recording.tracks_at(k, i) for i in np.flatnonzero(row).tolist()])
        for k, row in enumerate(recording.working)
    ]
    return {
        "bytes_total": int(sent.sum()) if known else None,
        "bytes_per_scan_mean": float(sent.mean()) if known else None,
        "bytes_per_scan_max": int(sent.max()) if known else None,
        "disagreement_m": float(np.mean(gaps)),
        "plans": _plans(recording),
    }


def _plans(recording: Recording) -> dict[str, float | None]:
    """Bytes of plans sent, means over pairs of decision and UAV that works, and the rounds of a decision."""
    decides = np.isin(recording.times, recording.plan_times)
    known = recording.plan_bytes.shape == recording.working.shape and decides.any() and recording.plan_bytes.min() >= 0
    sent = recording.plan_bytes[recording.working & decides[:, None]] if known else np.zeros(0, dtype=np.int64)
    return {
        "bytes_total": int(sent.sum()) if known else None,
        "bytes_per_decision_mean": float(sent.mean()) if known else None,
        "bytes_per_decision_max": int(sent.max()) if known else None,
        "rounds": int(recording.plan_rounds.max()) if known else None,
    }


def _ratio(part: Any, whole: Any) -> float | None:  # noqa: ANN401 - numpy's integers
    return float(part) / float(whole) if whole else None


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} m"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _others(seconds: Mapping[str, float]) -> list[str]:
    return [stage for stage in seconds if stage not in STAGES]
