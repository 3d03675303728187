"""`understory compare`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planning.catalogue import COMPARED
from planning.planner_loading import load_planner
from sim.cli.study_flight import fly_study, make_facts, show_study
from sim.scenario.loading import SCENARIOS, STUDY_TABLES
from sim.scenario.quantities import MOST_LISTED, REPEATS, WORKERS, parse_duration, parse_integer, parse_integers
from sim.scenario.sensing import SENSOR_MODES
from sim.scenario.text_files import read_toml
from sim.study.analysis.metric_choice import find_outside_metrics
from sim.study.cells import add_trackers
from sim.study.scheduler import Options
from sim.study.study import STUDIES, Study, adapt_study, read_study
from sim.study.tasks import list_tasks
from sim.terminal.commands import Duration, Overrides, Timeout, merge_overrides
from tracking.errors import InputError, check_known
from tracking.fusion.member import TRACKERS

_Entered = Annotated[
    str, typer.Argument(metavar="STUDY", help="A packaged study (see `understory studies`), study file, or scenario.")
]
_Planners = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help=f"A planner; repeat for each. Default: the study's, or {', '.join(COMPARED)}."),
]
_Trackers = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="A tracker, flown with each planner; repeat for more. Default: the study's."),
]
_Scenarios = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="One of a study's scenarios; repeat for more. Default: all."),
]
_Seeds = Annotated[
    str | None,
    typer.Option(metavar="LIST", help="Seeds that every planner flies: 0-9 or 0,3,7. Default: the study's, or 0-9."),
]
_Maps = Annotated[str | None, typer.Option(metavar="N", help="Fly the seeds 0 to N - 1; the paper has 50 maps.")]
_Repeats = Annotated[
    str | None,
    typer.Option(metavar="K", help="Number of flights on each map, with other noise. Default: the study's, or 1."),
]
_Sensing = Annotated[
    str | None, typer.Option(metavar="MODE", help="camera: rendered frames; ideal: no images, which is faster.")
]
_Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder of results; trials in it are not flown again. Default: one under runs/."),
]
_Baseline = Annotated[
    str | None, typer.Option(metavar="NAME", help="The planner that others are compared with. Default: the first.")
]
_Labels = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=PLANNER", help="A short name for a planner in tables and figures; repeatable."),
]
_Metrics = Annotated[
    list[str] | None, typer.Option(metavar="NAME", help="What to compare, see docs/how-to/studies.md; repeatable.")
]
_Workers = Annotated[str | None, typer.Option(metavar="N", help="Number of processes that fly. Default: one per core.")]
_Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on a dask cluster, such as tcp://host:8786.")]
_Keep = Annotated[str | None, typer.Option(metavar="WHAT", help="recordings: keep each trial's mission.npz.")]
_Redo = Annotated[bool, typer.Option("--redo", help="Fly trials that have results again, and replace these.")]


def compare(
    study: _Entered = "forest",
    planner: _Planners = None,
    tracker: _Trackers = None,
    scenario: _Scenarios = None,
    seeds: _Seeds = None,
    maps: _Maps = None,
    repeats: _Repeats = None,
    sensing: _Sensing = None,
    duration: Duration = None,
    overrides: Overrides = None,
    out: _Out = None,
    baseline: _Baseline = None,
    label: _Labels = None,
    metric: _Metrics = None,
    workers: _Workers = None,
    dask: _Dask = None,
    timeout: Timeout = None,
    keep: _Keep = None,
    redo: _Redo = False,
) -> None:
    """Compare planners or trackers on the same forests, people and seeds. Started again, it flies what is missing."""
    if sensing is not None:
        replace(SENSOR_MODES, field="--sensing").check(sensing)
    changes = merge_overrides(overrides, duration, sensing)
    number = None if repeats is None else parse_integer(repeats, "--repeats", least=1, most=REPEATS)
    for name in planner or ():
        load_planner(name)
    for name in tracker or ():
        replace(TRACKERS, field="--tracker").find(name)
    chosen = adapt_study(
        add_trackers(_find_study(study), tracker or ()),
        planners=planner or (),
        scenarios=scenario or (),
        seeds=_read_seeds(seeds, maps),
        repeats=number,
        overrides=changes,
    )
    processes = _read_workers(workers, dask)
    limit = None if timeout is None else parse_duration(timeout, "--timeout")
    folder = out or Path("runs") / chosen.name
    if keep is not None:
        check_known("--keep", keep, ["recordings"])
    kept = None if keep is None else folder / "recordings"
    listed = list_tasks(chosen, find_outside_metrics(metric or ()))
    facts = make_facts(chosen, listed, baseline=baseline, labels=label or (), metrics=tuple(metric or ()))
    rows = fly_study(chosen, listed, folder, Options(limit, kept, redo), processes, dask)
    show_study(rows, folder, facts)


def _find_study(name: str) -> Study:
    """A packaged study, a study file, or a study made of a scenario."""
    is_file = name.endswith(".toml")
    if name in STUDIES or (is_file and _is_study(Path(name))):
        return read_study(name)
    if not is_file:
        check_known("study", name, [*STUDIES, *SCENARIOS], " (or a .toml file)")
    return Study(name="compare", planners=COMPARED, scenarios=(name,))


def _is_study(path: Path) -> bool:
    """True for the file of a study, False for that of a scenario; a missing file counts as the packaged one's kind."""
    return bool({*STUDY_TABLES} & {*read_toml(path, "study")}) if path.is_file() else path.stem in STUDIES


def _read_workers(workers: str | None, dask: str | None) -> int | None:
    if workers is None:
        return None
    if dask is not None:
        raise InputError("--workers: not allowed together with --dask, whose cluster has workers of its own")
    return parse_integer(workers, "--workers", least=1, most=WORKERS)


def _read_seeds(seeds: str | None, maps: str | None) -> str | None:
    if maps is None:
        if seeds is not None:
            parse_integers(seeds, "--seeds")
        return seeds
    if seeds is not None:
        raise InputError("--maps: not allowed together with --seeds; --maps 50 is --seeds 0-49")
    return f"0-{parse_integer(maps, '--maps', least=1, most=MOST_LISTED) - 1}"
