"""The summary of a mission: the content of summary.json, and a table for the terminal."""

import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from sim.facts.metrics.catalogue import METRICS, evaluate, find_metric
from sim.facts.metrics.fleet_facts import count_plan_bytes, list_contacts
from sim.facts.metrics.holding import FAR
from sim.facts.metrics.metric import UNKNOWN, Metric, Outcome, mean
from sim.facts.metrics.score import Score
from sim.mission.archive import compute_digest
from sim.mission.recording import Recording
from sim.scenario.random_streams import format_seed
from sim.world.contacts import describe_body
from tracking.metrics.nees import nees_interval
from tracking.numerics.arrays import Array


def summarise(outcome: Outcome, asked: Sequence[str] = ()) -> dict[str, Any]:
    """The content of `summary.json`: all metrics, and facts beside them such as versions, machine and faults.

    asked: import strings of plug-in metrics. Shares and means are over all pairs of scan and working UAV; null means
    that there was nothing to count.
    """
    recording = outcome.recording
    values = evaluate(outcome, asked)
    own = {name: values[name] for name, known in METRICS.items() if known.in_summary}
    numbers = _nest({**_list_parts(outcome), **own})
    return {
        "planner": recording.planner,
        "sees_truth": recording.sees_truth,
        "seed": recording.seed,
        "repeat": recording.repeat,
        "scenario": json.loads(recording.scenario),
        "recording_sha256": compute_digest(recording),
        "machine": describe_machine(),
        "versions": list_versions(),
        "duration_s": float(recording.times[-1] - recording.times[0]),
        "interrupted": recording.interrupted,
        **numbers,
        **({"metrics": {name: _put_in_unit(find_metric(name), values[name]) for name in asked}} if asked else {}),
        "seconds": dict(outcome.seconds),
        "faults": [
            {"time": f.time, "uav": f.uav, "message": f.message, **({"trace": f.trace} if f.trace else {})}
            for f in outcome.faults
        ],
        "contacts": list_contacts(recording),
        "planning_s": [round(lap, 6) for lap in outcome.planning_s],
    }


@cache
def describe_machine() -> dict[str, str]:
    """The processor, on which times depend and recordings do not."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {"processor": names[0] if names else platform.processor() or platform.machine()}


def list_versions() -> dict[str, str]:
    """Versions of Python and of the packages on which a result depends."""
    packages = ("understory", "pybullet", "numpy", "scipy", "numba", "opencv-python-headless")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}


def _put_in_unit(asked: Metric, value: float | None) -> dict[str, Any]:
    """A plug-in metric with its value in its unit."""
    return {"label": asked.label, "unit": asked.unit, "value": None if value is None else value * asked.scale}


def _list_parts(outcome: Outcome) -> dict[str, Any]:
    """Entries beside the metrics, by dotted key: bounds, intervals, people and UAVs."""
    people = np.zeros(outcome.recording.person_count)
    held, present = (
        sum((getattr(s, name).sum(axis=0) for s in outcome.scores), people) for name in ("held", "present")
    )
    sent = count_plan_bytes(outcome.recording)
    return {
        "gospa.cut_off_m": FAR,
        "identity.within_m": outcome.recording.setting.loss_distance,
        **_make_interval("nees.position", [s.position_nees for s in outcome.flown], 2),
        **_make_interval("nees.state", [s.state_nees for s in outcome.flown], 4),
        "people_held": [float(h) / float(p) if p else None for h, p in zip(held, present, strict=True)],
        "network.plans.bytes_per_decision_mean": None if sent is None else float(sent.mean()),
        "network.plans.bytes_per_decision_max": None if sent is None else int(sent.max()),
        "uavs": [_summarise_uav(s) for s in outcome.scores],
    }


def _make_interval(key: str, errors: Sequence[Array], dof: int) -> dict[str, Any]:
    """95 % interval of the mean NEES of consistent tracks, with as many independent errors as one UAV has.

    UAVs that share all information make equal errors, so the fleet has no more independent errors than one UAV.
    """
    counted = [len(e) for e in errors if len(e)]
    count = round(float(np.mean(counted))) if counted else 0
    interval = list(nees_interval(count, dof)) if counted else None
    return {f"{key}.interval_95": interval, f"{key}.errors": count}


def _summarise_uav(score: Score) -> dict[str, Any]:
    return {
        "ospa_m": mean(score.ospa),
        "gospa_m": mean(score.gospa[:, 0]),
        "ospa2_m": score.ospa2 if len(score.gospa) else None,
        "switches": score.switches,
        "fragmentations": score.fragmentations,
        "position_nees": mean(score.position_nees),
        "state_nees": mean(score.state_nees),
        "share_held": mean(score.held[score.present]),
    }


def _nest(values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested tables of values with dotted keys."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        *tables, last = key.split(".")
        place = found
        for name in tables:
            place = place.setdefault(name, {})
        place[last] = value
    return found


def _read_value(summary: Mapping[str, Any], known: Metric) -> float | None:
    found: Any = summary
    for name in known.name.split("."):
        found = found[name]
    return None if found is None else float(found)


def format_planner_title(planner: str, sees_truth: bool) -> str:
    """Displayed name of a planner, with a remark if it sees the truth and so is an upper bound."""
    return f"{planner} (sees the truth: an upper bound)" if sees_truth else planner


def format_recording_title(recording: Recording) -> str:
    """Displayed planner, seed and repeat of a recording; the name of a flight from elsewhere."""
    planner = format_planner_title(recording.planner, recording.sees_truth)
    return f"{planner}, {format_seed(recording.seed, recording.repeat)}" if recording.frames is None else planner


def make_results_table(summary: Mapping[str, Any]) -> Table:
    """The summary as a table, as shown at the end of a run."""
    flown = format_seed(summary["seed"], summary["repeat"])
    title = f"{format_planner_title(summary['planner'], summary['sees_truth'])}, {flown}, {summary['duration_s']:.1f} s"
    table = Table(title=escape(title) + " (interrupted)" * summary["interrupted"], title_justify="left")
    table.add_column("result")
    table.add_column("value", justify="right")
    printed = sorted((known for known in METRICS.values() if known.printed), key=lambda known: known.printed)
    for _, section in groupby(printed, key=lambda known: known.printed // 10):
        for known in section:
            table.add_row(known.label, known.with_unit(_read_value(summary, known)))
        table.add_section()
    for name, own in summary.get("metrics", {}).items():
        table.add_row(escape(own["label"] or name), escape(Metric("", unit=own["unit"]).with_unit(own["value"])))
    table.add_section()
    for row in (*_list_unmatched_rows(summary["tracks"]), *_list_sent_rows(summary["network"])):
        table.add_row(*row)
    table.add_section()
    factor = METRICS["real_time_factor"]
    table.add_row(f"{factor.label} without start-up, film, page", factor.with_unit(_read_value(summary, factor)))
    all_told = summary["duration_s"] / summary["wall_s"] if summary["wall_s"] else None
    table.add_row("wall-clock factor with these", factor.with_unit(all_told), end_section=True)
    for stage, spent in summary["seconds"].items():
        table.add_row(stage.replace("_", "-"), f"{spent:.2f} s")
    failed = METRICS["failed_decisions"]
    if share := _read_value(summary, failed):
        table.add_section()
        table.add_row(failed.label, failed.with_unit(share), style="bold red")
    found = summary["contacts"]
    if found:
        table.add_section()
        table.add_row("contacts", str(len(found)), style="bold red")
    for contact in found[:3]:
        text = f"UAV {contact['uav']} touched {describe_body(contact['kind'], contact['other'])}"
        table.add_row(f"  at {contact['time']:.1f} s", text)
    return table


def _list_unmatched_rows(tracks: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    """Rows about tracks that stand for no person: their number, and the share of scans that have one."""
    for what in ("false", "duplicate"):
        share = METRICS[f"tracks.{what}_share"].text(tracks[f"{what}_share"] or 0.0)
        none = UNKNOWN if tracks[what] is None else "none"
        yield METRICS[f"tracks.{what}"].label, f"{tracks[what]}, {share} % of scans" if tracks[what] else none


def _list_sent_rows(network: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    if network["bytes_per_scan_mean"]:
        yield "sent by a UAV per scan", f"{network['bytes_per_scan_mean'] / 1000:.1f} kB"
    if network["age_s"] is not None:
        yield METRICS["network.age_s"].label, METRICS["network.age_s"].with_unit(network["age_s"])
    plans = network["plans"]
    if plans["bytes_total"] is not None:
        size, rounds = plans["bytes_per_decision_mean"], plans["rounds"]
        yield "plans of a UAV per decision", f"{size:.0f} B, {rounds} round{'s' * (rounds != 1)}"
