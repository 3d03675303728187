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

from sim.facts.metrics.fleet_facts import (
    SOURCES,
    count_bytes_sent,
    count_map_bytes,
    count_plan_bytes,
    find_handoffs,
    list_contacts,
    measure_disagreement,
    measure_times_to_find,
)
from sim.facts.metrics.holding import FAR
from sim.facts.metrics.mapping_score import MappingScore, compare_maps
from sim.facts.metrics.metric import Better, Computation, Metric, Outcome, mean
from sim.facts.metrics.score import Score
from sim.facts.metrics.trees_met import find_trees_met
from sim.facts.metrics.unmatched import Unmatched
from sim.mission.fault import BREAKDOWN, Fault
from sim.mission.recorded_links import measure_ages
from sim.mission.recording import Recording
from sim.mission.stopwatch import STAGES
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Array, Indices
from tracking.plugins.plugin_error import PluginError, plugin_call
from tracking.plugins.registry import import_plugin

_OLD = 1.0 + 1e-9  # s; the excess is more than the rounding of times


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
    return lambda outcome: mean(outcome.error_sources[:, list(SOURCES).index(name)])


def _make_unmatched_metrics(what: str, meaning: str) -> dict[str, Metric]:
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

    count = Metric(f"{what} tracks", lambda outcome: len(tracks(outcome)), digits=0, least=0.0, meaning=meaning)
    shown = _make_share(f"scans with a {what} track", share, "share of scans with such a track", better="lower")
    old = replace(
        shown,
        label=f"{shown.label} older than 1 s",
        compute=lambda outcome: share(outcome, _OLD),
        digits=3,
        meaning="the same of scans more than a second after the first track of this id began",
    )
    return {f"tracks.{what}": count, f"tracks.{what}_share": shown, f"tracks.{what}_old_share": old}


def _average_over_uavs(value: Callable[[Score], float]) -> Computation:
    """Mean over the UAVs; a UAV that breaks down counts until then."""
    return lambda outcome: mean([value(score) for score in outcome.flown])


def _make_nees(label: str, errors: Callable[[Score], Array], meaning: str, printed: int = 0) -> Metric:
    """Mean over the UAVs of each UAV's mean NEES."""

    def of(outcome: Outcome) -> float | None:
        return mean([e.mean() for e in map(errors, outcome.flown) if len(e)])

    return Metric(label, of, better="neither", least=0.0, meaning=meaning, printed=printed)


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


def _divide_maps(outcome: Outcome, of: Callable[[MappingScore], tuple[int, int]]) -> float | None:
    """Ratio of two numbers of the UAVs' own maps; None if there are none."""
    maps = compare_maps(outcome.recording)
    return _divide(*map(np.int64, of(maps))) if maps else None


def _share_known_ahead(outcome: Outcome) -> float | None:
    met = find_trees_met(outcome.recording)
    return 1.0 - float(np.mean(np.isnan([tree.ahead for tree in met]))) if met else None


def _measure_map_error(outcome: Outcome) -> float | None:
    maps = compare_maps(outcome.recording)
    return maps.error if maps and len(maps.distances) else None


def _divide(part: np.generic, whole: np.generic) -> float | None:
    return part.item() / whole.item() if whole else None


def _average_disagreement(outcome: Outcome) -> float | None:
    r = outcome.recording
    tracks = ([r.tracks_at(k, i) for i in np.flatnonzero(row).tolist()] for k, row in enumerate(r.working))
    return float(np.mean([measure_disagreement(held) for held in tracks]))


def _make_sent(
    label: str,
    sent: Callable[[Recording], Indices | None],
    reduced: Callable[[Indices], np.generic],
    unit: str,
    meaning: str,
) -> Metric:
    """Metric of the bytes that UAVs sent; None if no UAV could send."""

    def of(outcome: Outcome) -> float | None:
        found = sent(outcome.recording)
        return None if found is None else reduced(found).item()

    scale = {"kB": 1e-3, "MB": 1e-6}[unit]
    return Metric(label, of, unit, scale=scale, least=0.0, judges=False, meaning=meaning)


def _average_age(outcome: Outcome) -> float | None:
    ages = measure_ages(outcome.recording)
    return None if np.isnan(ages).all() else float(np.nanmean(ages))


def _count_plan_rounds(outcome: Outcome) -> float | None:
    return None if count_plan_bytes(outcome.recording) is None else int(outcome.recording.plan_rounds.max())


def _share_failed_decisions(outcome: Outcome) -> float | None:
    failed = {fault.time for fault in outcome.faults if fault.fails_decision}
    return mean([time in failed for time in outcome.recording.plan_times.tolist()])


def _make_planning(clock: str, spent: Callable[[Outcome], float], meaning: str) -> Metric:
    """Mean time of a decision of the whole fleet, by a clock."""

    def of(outcome: Outcome) -> float | None:
        decisions = len(outcome.recording.plan_times)
        return spent(outcome) / decisions if decisions else None

    display: dict[str, Any] = {"unit": "ms", "scale": 1000.0, "digits": 1, "in_summary": False, "judges": False}
    return Metric(f"planning per decision, {clock} time", of, meaning=meaning, least=0.0, **display)


def _compute_real_time_factor(outcome: Outcome) -> float | None:
    """Simulated time divided by wall time without start-up, film and page."""
    times = outcome.recording.times
    flown = outcome.wall_s - sum(outcome.seconds.get(name, 0.0) for name in ("start_up", "video", "page"))
    return float(times[-1] - times[0]) / flown if flown > 0 else None


def _make_share(label: str, compute: Computation, meaning: str, **display: Any) -> Metric:  # noqa: ANN401 - fields of Metric
    shown = {"unit": "%", "better": "higher", "scale": 100.0, "digits": 1, **display}
    return Metric(label, compute, meaning=meaning, least=0.0, most=1.0, **shown)


def _make_time_metric(stage: str) -> Metric:
    return Metric(
        f"time for {stage}",
        lambda outcome: float(outcome.seconds.get(stage, 0.0)),
        "s",
        least=0.0,
        judges=False,
        in_summary=False,
        meaning=f"wall time of {stage}",
    )


_NEES = "of tracks, each paired with the person whose detection, by any UAV, it took last; mean over UAVs"

_make_nonnegative = partial(Metric, least=0.0)  # `Metric` itself for one that can be negative
_of_flight = partial(Metric, least=0.0, judges=False)  # compares nothing with the people

# The home of each metric: all that summary.json, the tables of `run` and `compare`, and the reference have of it.
_ENTRIES: dict[str, Metric] = {
    "ospa.share_under_1m": _make_share(
        "scans with OSPA under 1 m",
        _reduce_ospa(lambda d: np.mean(d < 1.0)),
        "share of scans with an OSPA, p = 2, c = 50 m, under 1 m",
        printed=13,
        compared=True,
    ),
    "ospa.mean_m": _make_nonnegative(
        "OSPA mean", _reduce_ospa(np.mean), "m", meaning="mean OSPA, p = 2, c = 50 m", printed=11, compared=True
    ),
    "ospa.median_m": _make_nonnegative(
        "OSPA median", _reduce_ospa(np.median), "m", meaning="median OSPA", printed=12, compared=True
    ),
    "gospa.mean_m": _make_nonnegative(
        "GOSPA mean", _average_gospa(0), "m", meaning="mean GOSPA, p = 2, α = 2, c = 10 m", printed=21
    ),
    "gospa.localisation_m": _make_nonnegative(
        "GOSPA, localisation", _average_gospa(1), "m", meaning="its part of the errors of paired tracks"
    ),
    "gospa.missed": _make_nonnegative(
        "people missed per scan", _average_gospa(2, counted=True), meaning="mean number of missed people in a scan"
    ),
    "gospa.false": _make_nonnegative(
        "false tracks per scan", _average_gospa(3, counted=True), meaning="mean number of false tracks in a scan"
    ),
    **{
        f"gospa.squared_m2.{name}": _make_nonnegative(
            f"GOSPA squared, {name.replace('_', ' ')}",
            _average_source(name),
            "m²",
            meaning=f"part of the mean squared GOSPA: {words}",
        )
        for name, words in SOURCES.items()
    },
    **_make_unmatched_metrics(
        "false", "tracks that stand for no person within `loss_distance`, nor within 10 m for a person without one"
    ),
    **_make_unmatched_metrics(
        "duplicate", "second tracks, in the median at most `loss_distance` from a person with another track"
    ),
    "ospa2_m": _make_nonnegative(
        "OSPA(2)",
        _average_over_uavs(lambda s: s.ospa2),
        "m",
        meaning="OSPA(2): one pairing for the whole mission, so a change of person is penalised; mean over UAVs",
    ),
    "identity.switches": _make_nonnegative(
        "identity switches",
        _average_over_uavs(lambda s: s.switches),
        meaning="how often a person is held by another id than before. A person keeps a track while it is within "
        "`loss_distance` (CLEAR MOT), also after a gap, which TrackEval does not allow; mean over UAVs",
        printed=23,
    ),
    "identity.fragmentations": _make_nonnegative(
        "fragmentations",
        _average_over_uavs(lambda s: s.fragmentations),
        meaning="how often a person is held, then not held, then held again; mean over UAVs",
    ),
    "handoffs": _make_nonnegative(
        "hand-offs of people",
        lambda o: len(find_handoffs(o.recording)),
        better="neither",
        meaning="how often a person passes to another UAV: one UAV detects them no longer, and another one does, at "
        "once or later",
    ),
    "share_held": _make_share(
        "people held",
        lambda o: mean(np.concatenate([s.held[s.present] for s in o.scores])),
        "share of pairs of a scan and a person who is there in which the UAV holds the person",
        printed=22,
    ),
    "time_to_find_s": _make_nonnegative(
        "time to find a person",
        lambda o: mean(measure_times_to_find(o.recording, o.scores)),
        "s",
        meaning="mean time from the first scan at which a person is present and not under a canopy until a UAV holds "
        "them; 0 for people found before. For people never found it ends when they leave or the mission ends; people "
        "always under canopies are left out",
    ),
    "nees.position.mean": _make_nees(
        "NEES of positions (consistent: 2)", lambda s: s.position_nees, f"mean NEES of the positions {_NEES}", 24
    ),
    "nees.state.mean": _make_nees(
        "NEES of states (consistent: 4)",
        lambda s: s.state_nees,
        "the same of positions and velocities; true velocities are central differences",
    ),
    "nees.left_out_share": _make_nonnegative(
        "tracks left out of NEES",
        _share_left_out,
        "%",
        scale=100.0,
        digits=1,
        most=1.0,
        meaning="share of tracks that NEES leaves out, as they took no detection, their person has left, or another "
        "track took a later detection of that person",
        printed=25,
    ),
    "detection.recall": _make_share(
        "detection recall", _compute_recall, "share of the people shown by a pixel that was detected", printed=31
    ),
    "detection.precision": _make_share(
        "detection precision", _compute_precision, "share of detections that are people", printed=32
    ),
    "map.recall": _make_share(
        "seen trees mapped",
        lambda o: _divide_maps(o, lambda maps: (maps.found, maps.seen)),
        "of the true trees that stand where a UAV excludes unknown ones, the share on its map at the end; over all "
        "UAVs",
        judges=False,
    ),
    "map.false_share": _make_share(
        "mapped trees that are none",
        lambda o: _divide_maps(o, lambda maps: (maps.mapped - len(maps.distances), maps.mapped)),
        "share of the trees on these maps whose middle is below no crown",
        better="lower",
        judges=False,
    ),
    "map.error_m": _of_flight(
        "error of mapped trees",
        _measure_map_error,
        "m",
        meaning="root mean square of the distances of the other ones from the true places",
    ),
    "map.known_ahead": _make_share(
        "trees known before they are seen",
        _share_known_ahead,
        "share of the trees that come into the view of a UAV that it has on its map by then, from other UAVs",
        judges=False,
    ),
    "network.disagreement_m": _of_flight(
        "disagreement of UAVs",
        _average_disagreement,
        "m",
        digits=4,
        meaning="mean OSPA between the tracks of pairs of UAVs",
    ),
    "network.age_s": _of_flight(
        "age of what UAVs know from others",
        _average_age,
        "s",
        meaning="mean age of the newest scan that a UAV has of another, in a network that takes time",
    ),
    "network.bytes_per_scan_mean": _make_sent(
        "sent by a UAV per scan", count_bytes_sent, np.mean, "kB", "bytes that a UAV sends to agree on tracks in a scan"
    ),
    "network.bytes_per_scan_max": _make_sent(
        "sent by a UAV in one scan at most", count_bytes_sent, np.max, "kB", "the most of these bytes in one scan"
    ),
    "network.bytes_total": _make_sent(
        "sent by all UAVs", count_bytes_sent, np.sum, "MB", "these bytes of all UAVs and scans"
    ),
    "network.plans.bytes_total": _make_sent(
        "plans sent by all UAVs", count_plan_bytes, np.sum, "kB", "bytes of plans that all UAVs send"
    ),
    "network.maps.bytes_total": _make_sent(
        "maps sent by all UAVs", count_map_bytes, np.sum, "kB", "bytes of maps of trees that all UAVs send"
    ),
    "network.plans.rounds": _of_flight(
        "rounds of plans", _count_plan_rounds, digits=0, meaning="rounds in which plans are sent at a decision"
    ),
    "faults": _of_flight(
        "faults of plug-ins",
        lambda o: sum(f.message != BREAKDOWN for f in o.faults),
        in_summary=False,
        meaning="in studies: number of faults of planner, detectors and other plug-ins",
    ),
    "failed_decisions": _make_share(
        "decisions that failed",
        _share_failed_decisions,
        "share of decisions in which the planner raised, or returned no valid plan for a UAV, which flew an old one",
        better="lower",
        judges=False,
    ),
    "contacts": _of_flight(
        "contacts",
        lambda o: len(list_contacts(o.recording)),
        in_summary=False,
        meaning="in studies: number of contacts of UAVs with anything",
    ),
    "planning_cpu_s_per_decision": _make_planning(
        "processor",
        lambda o: o.planning_cpu_s,
        "in studies: processor time of a decision of the whole fleet, of all threads of the process that flies",
    ),
    "planning_s_per_decision": _make_planning(
        "wall", lambda o: o.seconds.get("planning", 0.0), "in studies: wall time of such a decision"
    ),
    "real_time_factor": _of_flight(
        "real-time factor",
        _compute_real_time_factor,
        "",
        "higher",
        digits=1,
        meaning="duration over wall time without start-up, film and page",
    ),
    "wall_s": _of_flight(
        "wall time per mission", lambda o: o.wall_s, "s", meaning="wall time of the run with all its files"
    ),
    **{f"seconds.{stage}": _make_time_metric(stage) for stage in STAGES},
}
METRICS = {name: replace(known, name=name) for name, known in _ENTRIES.items()}


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
