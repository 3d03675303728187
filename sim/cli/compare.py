"""`understory compare`."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planning.registry import COMPARED
from sim.scenario.loading import SCENARIOS, remarks
from sim.scenario.perception import SENSOR_MODES
from sim.scenario.quantities import MOST_LISTED, REPEATS, integer, integers, seconds
from sim.scenario.text_files import toml_file
from sim.study.cells import with_trackers
from sim.study.study import STUDIES, Study, adapted, read
from sim.terminal.commands import Duration, Overrides, with_duration
from sim.terminal.console import remark
from tracking.fusion.member import TRACKERS
from tracking.plugins.registry import InputError, check_known


def compare(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="Name (see `understory studies`), study file, or scenario.")
    ] = "forest",
    planner: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A planner; repeat for each. Default: the study's, or two of the paper's."),
    ] = None,
    tracker: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A tracker, each with each planner; repeat for each. Default: the scenario's."
        ),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="LIST", help="Seeds that every planner flies: 0-9 or 0,3,7. [default: 0-9]")
    ] = None,
    maps: Annotated[str | None, typer.Option(metavar="N", help="Seeds 0 to N - 1; the paper has 50.")] = None,
    repeats: Annotated[
        str | None, typer.Option(metavar="K", help="Flights on each map, with other noise each. [default: 1]")
    ] = None,
    sensing: Annotated[str | None, typer.Option(metavar="MODE", help="camera or ideal.")] = None,
    duration: Duration = None,
    overrides: Overrides = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of results; what is there is not flown again. Default: one under runs/."
        ),
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(metavar="NAME", help="The planner that others are compared with. Default: the first.")
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=PLANNER", help="A short name for a planner in tables and figures; repeatable."),
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="What to compare, see docs/how-to/studies.md; repeatable.")
    ] = None,
    workers: Annotated[str | None, typer.Option(metavar="N", help="Processes to fly in. Default: one a core.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on a dask cluster: tcp://host:8786.")] = None,
    timeout: Annotated[
        str | None, typer.Option(metavar="TIME", help="Wall time beyond which a trial has failed: 90, 5min.")
    ] = None,
    keep: Annotated[str | None, typer.Option(metavar="WHAT", help="recordings: keep each mission.npz.")] = None,
    redo: Annotated[bool, typer.Option("--redo", help="Fly again what is there already.")] = False,
) -> None:
    """Fly planners or trackers on the same forests, people and seeds; compare them. Goes on where it stopped."""
    changes = [*_sensing(sensing), *with_duration(overrides, duration)]
    number = None if repeats is None else integer(repeats, "--repeats", least=1, most=REPEATS)
    for name in tracker or ():
        replace(TRACKERS, field="--tracker").check(name)
    begun = with_trackers(_study(study), tracker or ())
    chosen = adapted(begun, planners=planner or (), seeds=_seeds(seeds, maps), repeats=number, overrides=changes)
    processes = integer(workers, "--workers", least=1, most=1024) if workers else os.cpu_count() or 1
    limit = None if timeout is None else seconds(timeout, "--timeout")
    if keep is not None:
        check_known("--keep", keep, ["recordings"])
    folder = out or Path("runs") / chosen.name
    # A complaint about the input needs none of what these import.
    from sim.analysis.metric_choice import from_outside
    from sim.analysis.planner_labels import baseline_of, labels_of
    from sim.cli.study_flight import fly_study, show_study
    from sim.report.report import About
    from sim.study.engine import Options
    from sim.study.tasks import tasks

    listed = tasks(chosen, from_outside(metric or ()))
    labels = labels_of(listed, label or ())
    baseline_of(listed, baseline, labels)
    remark(*dict.fromkeys(line for task in listed for line in remarks(task.setting)))
    rows = fly_study(listed, folder, Options(limit, folder / "recordings" if keep else None, redo), processes, dask)
    about = About(chosen.name, chosen.description, baseline=baseline, labels=labels, score=chosen.score)
    show_study(rows, folder, replace(about, metrics=tuple(metric or ())))


def _study(name: str) -> Study:
    """A packaged study, a study file, or one made of a scenario and flags."""
    is_file = name.endswith(".toml")
    if name in STUDIES or (is_file and Path(name).is_file() and "study" in toml_file(Path(name), "study")):
        return read(name)
    if not is_file:
        check_known("study", name, [*STUDIES, *SCENARIOS], " (or a .toml file)")
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
    replace(SENSOR_MODES, field="--sensing").check(mode)
    return [f"sensing.mode={mode}"]
