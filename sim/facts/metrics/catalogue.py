"""The metrics by name, from which summary.json, studies and all tables take them.

A plug-in metric is a `Metric` in any module, named by its import string: `--metric package.module:NAME`.
"""

import math
from collections.abc import Callable, Iterable
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import Any, get_args

import numpy as np

from sim.facts.metrics.error_sources import SOURCES
from sim.facts.metrics.fleet_facts import count_bytes_sent, count_plan_bytes, list_contacts, measure_disagreement
from sim.facts.metrics.handoffs import find_handoffs
from sim.facts.metrics.holding import FAR
from sim.facts.metrics.metric import Better, Computation, Metric, Outcome, mean
from sim.facts.metrics.score import Score
from sim.facts.metrics.searching import measure_times_to_find
from sim.facts.metrics.unmatched import Unmatched
from sim.mission.recorded_links import measure_ages
from sim.mission.recording import Recording
from sim.sensing.fault import BREAKDOWN, Fault
from sim.sensing.stopwatch import STAGES
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Array, Indices
from tracking.plugins.plugin_error import PluginError, plugin_call
from tracking.plugins.registry import import_plugin

_OLD = 1.0 + 1e-9  # s; the excess is more than the rounding of times
_make_nonnegative = partial(Metric, least=0.0)  # `Metric` itself for one that can be negative


def _reduce_ospa(reduced: Callable[[Array], np.floating[Any]]) -> Computation:
    """Statistic of the OSPA distances [m] of all scans and all UAVs that work at the scan."""

    def of(outcome: Outcome) -> float | None:
        distance = outcome.recording.ospa[:, :, 0][outcome.recording.working]
        return float(reduced(distance)) if len(distance) else None

    return of


def _average_gospa(column: int, *, counted: bool = False) -> Computation:
    """Mean of a part of GOSPA over all scans and working UAVs, in m; if counted, in people or tracks."""

    def of(outcome: Outcome) -> float | None:
        parts = np.concatenate([score.gospa[:, column] for score in outcome.scores])
        return mean(parts**2 / (FAR**2 / 2) if counted else parts)

    return of


def _average_source(name: str) -> Computation:
    """Mean of a source of squared GOSPA over all scans and working UAVs, in m²."""
    return lambda outcome: mean(outcome.error_sources[:, SOURCES.index(name)])


def _make_unmatched_metrics(what: str) -> dict[str, Metric]:
    """Number of "false" or "duplicate" tracks, and shares of pairs of scan and working UAV that have one.

    The second share counts only scans at which the track is older than 1 s.
    """

    def tracks(outcome: Outcome) -> list[Unmatched]:
        return [track for track in outcome.unmatched if track.duplicate == (what == "duplicate")]

    def share(outcome: Outcome, least_age: float = 0.0) -> float | None:
        on, times = outcome.recording.working, outcome.recording.times
        found = np.zeros_like(on)
        for track in tracks(outcome):
            span = slice(track.first, track.last + 1)
            found[span] |= track.alone & (times[span] - times[track.since] >= least_age)[:, None]
        return mean(found[on])

    count = _make_nonnegative(f"{what} tracks", lambda outcome: len(tracks(outcome)), digits=0)
    shown = _make_nonnegative(f"scans with a {what} track", share, "%", "lower", 100.0, digits=1, most=1.0)
    old = replace(shown, label=f"{shown.label} older than 1 s", compute=lambda o: share(o, _OLD), digits=3)
    return {f"tracks.{what}": count, f"tracks.{what}_share": shown, f"tracks.{what}_old_share": old}


def _average_over_uavs(value: Callable[[Score], float]) -> Computation:
    """Mean over the UAVs; a UAV that breaks down counts until then."""
    return lambda outcome: mean([value(score) for score in outcome.flown])


def _make_nees(label: str, errors: Callable[[Score], Array]) -> Metric:
    """Mean over the UAVs of each UAV's mean NEES."""

    def of(outcome: Outcome) -> float | None:
        return mean([e.mean() for e in map(errors, outcome.flown) if len(e)])

    return _make_nonnegative(label, of, better="neither")


def _share_left_out(outcome: Outcome) -> float | None:
    """Share of pairs of a scan and a reported track that NEES does not count, of all UAVs."""
    left = sum(score.left_out for score in outcome.scores)
    return _divide(np.int64(left), np.int64(left + sum(len(score.position_nees) for score in outcome.scores)))


def _compute_recall(outcome: Outcome) -> float | None:
    """Share of detected people among those that a camera shows with at least one pixel."""
    r = outcome.recording
    return _divide(np.sum(r.matched & (r.visible > 0)), np.sum(r.visible > 0))


def _compute_precision(outcome: Outcome) -> float | None:
    """Share of detections that were people."""
    r = outcome.recording
    return _divide(np.sum(r.matched), np.sum(~np.isnan(r.pixels[:, 0])))


def _divide(part: np.generic, whole: np.generic) -> float | None:
    return part.item() / whole.item() if whole else None


def _average_disagreement(outcome: Outcome) -> float | None:
    r = outcome.recording
    tracks = ([r.tracks_at(k, i) for i in np.flatnonzero(row).tolist()] for k, row in enumerate(r.working))
    return float(np.mean([measure_disagreement(held) for held in tracks]))


def _make_sent(
    label: str, sent: Callable[[Recording], Indices | None], reduced: Callable[[Indices], np.generic], unit: str
) -> Metric:
    """Metric of the bytes that UAVs sent; None if no UAV could send."""

    def of(outcome: Outcome) -> float | None:
        found = sent(outcome.recording)
        return None if found is None else reduced(found).item()

    return _make_nonnegative(label, of, unit, scale={"kB": 1e-3, "MB": 1e-6}[unit])


def _average_age(outcome: Outcome) -> float | None:
    ages = measure_ages(outcome.recording)
    return None if np.isnan(ages).all() else float(np.nanmean(ages))


def _count_plan_rounds(outcome: Outcome) -> float | None:
    return None if count_plan_bytes(outcome.recording) is None else int(outcome.recording.plan_rounds.max())


def _make_planning(clock: str, spent: Callable[[Outcome], float]) -> Metric:
    """Mean time of a decision of the whole fleet, by a clock."""

    def of(outcome: Outcome) -> float | None:
        decisions = len(outcome.recording.plan_times)
        return spent(outcome) / decisions if decisions else None

    return _make_nonnegative(f"planning per decision, {clock} time", of, "ms", scale=1000.0, digits=1, in_summary=False)


def _compute_real_time_factor(outcome: Outcome) -> float | None:
    """Simulated time divided by wall time without start-up, film and page."""
    times = outcome.recording.times
    flown = outcome.wall_s - sum(outcome.seconds.get(name, 0.0) for name in ("start_up", "video", "page"))
    return float(times[-1] - times[0]) / flown if flown > 0 else None


def _make_share(label: str, compute: Computation) -> Metric:
    return _make_nonnegative(label, compute, "%", "higher", 100.0, digits=1, most=1.0)


def _make_time_metric(stage: str) -> Metric:
    return _make_nonnegative(f"time for {stage}", lambda o: float(o.seconds.get(stage, 0.0)), "s", in_summary=False)


# First parts of the names of metrics that compare nothing with the people.
_OF_FLEET = {"network", "faults", "contacts", "planning_s_per_decision", "planning_cpu_s_per_decision"}
_OF_FLEET |= {"real_time_factor", "wall_s", "seconds"}


def _name_metrics(metrics: dict[str, Metric]) -> dict[str, Metric]:
    """The metrics with their names, and whether they compare with the people."""
    return {n: replace(known, name=n, judges=n.split(".")[0] not in _OF_FLEET) for n, known in metrics.items()}


METRICS = _name_metrics(
    {
        "ospa.share_under_1m": _make_share("scans with OSPA under 1 m", _reduce_ospa(lambda d: np.mean(d < 1.0))),
        "ospa.mean_m": _make_nonnegative("OSPA mean", _reduce_ospa(np.mean), "m"),
        "ospa.median_m": _make_nonnegative("OSPA median", _reduce_ospa(np.median), "m"),
        "gospa.mean_m": _make_nonnegative("GOSPA mean", _average_gospa(0), "m"),
        "gospa.localisation_m": _make_nonnegative("GOSPA, localisation", _average_gospa(1), "m"),
        "gospa.missed": _make_nonnegative("people missed per scan", _average_gospa(2, counted=True)),
        "gospa.false": _make_nonnegative("false tracks per scan", _average_gospa(3, counted=True)),
        **{
            f"gospa.squared_m2.{name}": _make_nonnegative(
                f"GOSPA squared, {name.replace('_', ' ')}", _average_source(name), "m²"
            )
            for name in SOURCES
        },
        **_make_unmatched_metrics("false"),
        **_make_unmatched_metrics("duplicate"),
        "ospa2_m": _make_nonnegative("OSPA(2)", _average_over_uavs(lambda s: s.ospa2), "m"),
        "identity.switches": _make_nonnegative("identity switches", _average_over_uavs(lambda s: s.switches)),
        "identity.fragmentations": _make_nonnegative("fragmentations", _average_over_uavs(lambda s: s.fragmentations)),
        "handoffs": _make_nonnegative(
            "hand-offs of people", lambda o: len(find_handoffs(o.recording)), better="neither"
        ),
        "share_held": _make_share("people held", lambda o: mean(np.concatenate([s.held[s.present] for s in o.scores]))),
        "time_to_find_s": _make_nonnegative(
            "time to find a person", lambda o: mean(measure_times_to_find(o.recording, o.scores)), "s"
        ),
        "nees.position.mean": _make_nees("NEES of positions (consistent: 2)", lambda s: s.position_nees),
        "nees.state.mean": _make_nees("NEES of states (consistent: 4)", lambda s: s.state_nees),
        "nees.left_out_share": _make_nonnegative(
            "tracks left out of NEES", _share_left_out, "%", scale=100.0, digits=1, most=1.0
        ),
        "detection.recall": _make_share("detection recall", _compute_recall),
        "detection.precision": _make_share("detection precision", _compute_precision),
        "network.disagreement_m": _make_nonnegative("disagreement of UAVs", _average_disagreement, "m", digits=4),
        "network.age_s": _make_nonnegative("age of what UAVs know from others", _average_age, "s"),
        "network.bytes_per_scan_mean": _make_sent("sent by a UAV per scan", count_bytes_sent, np.mean, "kB"),
        "network.bytes_per_scan_max": _make_sent("sent by a UAV in one scan at most", count_bytes_sent, np.max, "kB"),
        "network.bytes_total": _make_sent("sent by all UAVs", count_bytes_sent, np.sum, "MB"),
        "network.plans.bytes_total": _make_sent("plans sent by all UAVs", count_plan_bytes, np.sum, "kB"),
        "network.plans.rounds": _make_nonnegative("rounds of plans", _count_plan_rounds, digits=0),
        "faults": _make_nonnegative(
            "faults of plug-ins", lambda o: sum(f.message != BREAKDOWN for f in o.faults), in_summary=False
        ),
        "contacts": _make_nonnegative("contacts", lambda o: len(list_contacts(o.recording)), in_summary=False),
        "planning_cpu_s_per_decision": _make_planning("processor", lambda o: o.planning_cpu_s),
        "planning_s_per_decision": _make_planning("wall", lambda o: o.seconds.get("planning", 0.0)),
        "real_time_factor": _make_nonnegative("real-time factor", _compute_real_time_factor, "", "higher", digits=1),
        "wall_s": _make_nonnegative("wall time per mission", lambda o: o.wall_s, "s"),
        **{f"seconds.{stage}": _make_time_metric(stage) for stage in STAGES},
    }
)


def find_metric(name: str) -> Metric:
    """The metric with this name or import string; InputError if there is none."""
    if name in METRICS:
        return METRICS[name]
    if ":" not in name:
        check_known("--metric", name, METRICS, " (or yours, module:NAME)")
    try:
        found = import_plugin(name)
    except ImportError as error:
        raise InputError(f"--metric: {name!r} cannot be imported: {error}") from error
    if not isinstance(found, Metric):
        raise InputError(f"--metric: {name!r} is not a metric; expected a sim.facts.metrics.metric.Metric")
    check_known(f"--metric: {name}: better", found.better, get_args(Better))
    return replace(found, name=name)


def evaluate(outcome: Outcome, asked: Iterable[str] = ()) -> dict[str, float | None]:
    """Values of all metrics of the registry and of those asked for; None if there is nothing to count.

    A metric that is asked for gets a copy. If its value is not finite, or it raises, it is None; an error adds a fault.
    """
    found = {name: known(outcome) for name, known in METRICS.items()}
    for name in asked:
        try:
            with plugin_call():
                asked_for = find_metric(name)
            with plugin_call(asked_for, "of"):
                value = asked_for(deepcopy(outcome))
                found[name] = float(value) if value is not None and math.isfinite(value) else None
        except PluginError as error:
            text = f"metric {name}: {error.with_place}"
            outcome.faults.append(Fault(float(outcome.recording.times[-1]), None, text, error.trace))
            found |= {name: None, "faults": METRICS["faults"](outcome)}
    return found
