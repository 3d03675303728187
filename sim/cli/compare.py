"""`understory compare`."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from planning.registry import COMPARED
from sim.cli import compare_options as options
from sim.scenario.errors import InputError
from sim.scenario.loading import SCENARIOS, remarks
from sim.scenario.quantities import MOST_LISTED, REPEATS, integer, integers, seconds
from sim.study.study import STUDIES, Study, adapted, is_study, read
from sim.terminal.console import console, fail, remark
from sim.terminal.options import Duration, Overrides, with_duration
from tracking.plugins.spelling import did_you_mean

if TYPE_CHECKING:  # a complaint about the input needs none of what these import
    from sim.report.report import About
    from sim.study.row import Row

_MOST_WORKERS = 1024
_SENSING = ("camera", "ideal")


def compare(
    study: options.StudyName = "forest",
    planner: options.Planners = None,
    seeds: options.Seeds = None,
    maps: options.Maps = None,
    repeats: options.Repeats = None,
    sensing: options.Sensing = None,
    duration: Duration = None,
    overrides: Overrides = None,
    out: options.Out = None,
    baseline: options.Baseline = None,
    label: options.Labels = None,
    metric: options.Metrics = None,
    workers: options.Workers = None,
    dask: options.Dask = None,
    timeout: options.Timeout = None,
    keep: options.Keep = None,
    redo: options.Redo = False,
) -> None:
    """Fly planners on the same forests, people and seeds; show the results side by side. Goes on where it stopped."""
    changes = [*_sensing(sensing), *with_duration(overrides, duration)]
    number = None if repeats is None else integer(repeats, "--repeats", least=1, most=REPEATS)
    chosen = adapted(
        _study(study), planners=planner or (), seeds=_seeds(seeds, maps), repeats=number, overrides=changes
    )
    processes = integer(workers, "--workers", least=1, most=_MOST_WORKERS) if workers else os.cpu_count() or 1
    limit = None if timeout is None else seconds(timeout, "--timeout")
    if keep not in (None, "recordings"):
        raise InputError(f"--keep: {keep!r} is unknown; {did_you_mean(keep, ['recordings'])}")
    folder = out or Path("runs") / chosen.name
    from sim.analysis.metric_choice import from_outside
    from sim.analysis.planner_labels import baseline_of, labels_of
    from sim.cli.study_flight import fly_study
    from sim.report.report import About
    from sim.study.engine import Options
    from sim.study.tasks import tasks

    listed = tasks(chosen, from_outside(metric or ()))
    labels = labels_of(listed, label or ())
    baseline_of(listed, baseline, labels)
    remark(*dict.fromkeys(line for task in listed for line in remarks(task.setting)))
    rows = fly_study(listed, folder, Options(limit, folder / "recordings" if keep else None, redo), processes, dask)
    shown = About(chosen.name, chosen.description, baseline=baseline, labels=labels, metrics=tuple(metric or ()))
    _show(rows, folder, shown)


def _study(name: str) -> Study:
    """A packaged study, a study file, or one made of a scenario and flags."""
    if name in STUDIES or (name.endswith(".toml") and is_study(Path(name))):
        return read(name)
    if name not in SCENARIOS and not name.endswith(".toml"):
        names = [*STUDIES, *SCENARIOS]
        raise InputError(f"study: {name!r} is unknown; {did_you_mean(name, names)} (or a .toml file)")
    return Study(name="compare", planners=COMPARED, scenarios=(name,))


def _seeds(seeds: str | None, maps: str | None) -> str | None:
    if maps is None:
        if seeds is not None:
            integers(seeds, "--seeds")
        return seeds
    if seeds is not None:
        raise InputError("--maps: not allowed together with --seeds; --maps 50 is --seeds 0-49")
    return f"0-{integer(maps, '--maps', least=1, most=MOST_LISTED) - 1}"


def _sensing(mode: str | None) -> list[str]:
    if mode is None:
        return []
    if mode not in _SENSING:
        raise InputError(f"--sensing: {mode!r} is unknown; {did_you_mean(mode, _SENSING)}")
    return [f"sensing.mode={mode}"]


def _show(rows: Sequence[Row], folder: Path, about: About) -> None:
    """Print tables and write the report; exit with code 1 if that cannot be done or trials have failed."""
    from sim.scenario.random_streams import numbered

    _report(rows, folder, about)
    failures = [row for row in rows if row.status == "failed"]
    missing = "; the same command flies again what failed" if failures else ""
    console.print(f"Results in [bold]{escape(str(folder))}[/bold] (report.html){missing}.", soft_wrap=True)
    if failures:
        first = failures[0]
        place = f"{first.planner}, {numbered(first.seed, first.repeat)}"
        fail(f"{len(failures)} of {len(rows)} trials failed, {place}: {first.error}", code=1)


def _report(rows: Sequence[Row], folder: Path, about: About) -> None:
    """Show tables, and write the report beside the store; exits with what is kept if that cannot be done."""
    from sim.evaluation.machine import versions
    from sim.report.report import write
    from sim.report.terminal import show

    command, wall = shlex.join(["understory", *sys.argv[1:]]), sum(row.metrics.get("wall_s", 0.0) for row in rows)
    try:
        show(rows, about.baseline, about.metrics, labels=about.labels)
        write(rows, folder, replace(about, command=command, versions=versions(), wall_s=wall))
    except KeyboardInterrupt:
        reason = "interrupted"
    except InputError as error:  # names were checked before, so the disk is full or the like
        reason = str(error)
    else:
        return
    fail(f"{reason}; all {len(rows)} trials are kept in {folder}, the same command writes the report", code=1)
