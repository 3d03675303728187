"""`understory compare` and `understory studies`."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from planning.registry import COMPARED
from sim.scenario.errors import InputError
from sim.scenario.loading import SCENARIOS, did_you_mean, remarks
from sim.scenario.quantities import MOST_LISTED, REPEATS, integer, integers, seconds
from sim.study.study import STUDIES, Study, adapted, is_study, read
from sim.terminal.console import console, fail, remark, show_list
from sim.terminal.options import Duration, Overrides, with_duration

if TYPE_CHECKING:  # a complaint about the input needs none of what these import
    from sim.study.engine import Backend, Options
    from sim.study.row import Row
    from sim.study.tasks import Task

_MOST_WORKERS = 1024
_SENSING = ("camera", "ideal")


def compare(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="Name (see `understory studies`), study file, or scenario.")
    ] = "forest",
    planner: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A planner; repeat for each. Default: the study's, or two of the paper's."),
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
    from sim.analysis.cells import baseline_of
    from sim.analysis.metric_choice import from_outside
    from sim.scenario.random_streams import numbered
    from sim.study.engine import Options
    from sim.study.tasks import tasks

    listed = tasks(chosen, from_outside(metric or ()))
    baseline_of(listed, baseline)
    remark(*dict.fromkeys(line for task in listed for line in remarks(task.setting)))
    options = Options(limit, folder / "recordings" if keep else None, redo)
    rows = _flown(listed, folder, options, processes, dask)
    _answer(rows, folder, chosen.description, baseline, metric or ())
    failures = [row for row in rows if row.status == "failed"]
    missing = "; the same command flies again what failed" if failures else ""
    console.print(f"Results in [bold]{escape(str(folder))}[/bold] (report.html){missing}.", soft_wrap=True)
    if failures:
        first = failures[0]
        place = f"{first.planner}, {numbered(first.seed, first.repeat)}"
        fail(f"{len(failures)} of {len(rows)} trials failed, {place}: {first.error}", code=1)


def studies() -> None:
    """List the packaged studies."""
    show_list(
        {name: read(name).description for name in STUDIES},
        "Fly one: understory compare NAME --maps 10. Yours: a .toml file, see docs/how-to/studies.md.",
    )


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


def _answer(rows: Sequence[Row], folder: Path, description: str, baseline: str | None, metrics: Sequence[str]) -> None:
    """Show tables, and write the report beside the store; exits with what is kept if that cannot be done."""
    from sim.evaluation.machine import versions
    from sim.report.report import About, write
    from sim.report.tables import show

    about = About(
        study=rows[0].study,
        description=description,
        command=shlex.join(["understory", *sys.argv[1:]]),
        versions=versions(),
        wall_s=sum(row.metrics.get("wall_s", 0.0) for row in rows),
        baseline=baseline,
        metrics=tuple(metrics),
    )
    try:
        show(rows, baseline, metrics)
        write(rows, folder, about)
    except KeyboardInterrupt:
        reason = "interrupted"
    except InputError as error:  # names were checked before, so the disk is full or the like
        reason = str(error)
    else:
        return
    fail(f"{reason}; all {len(rows)} trials are kept in {folder}, the same command writes the report", code=1)


def _flown(listed: Sequence[Task], folder: Path, options: Options, workers: int, dask: str | None) -> list[Row]:
    """Rows of all trials; exits with what is kept and how to go on if they cannot all be flown."""
    from sim.study.engine import complete
    from sim.study.store import NAME, Store, StoreError
    from sim.study.tasks import check_worlds
    from sim.terminal.study_progress import study_progress

    kept: int | None = None
    try:
        if not (folder / NAME).exists():
            check_worlds(listed)
        with _backend(workers, dask) as backend, Store.opened(folder, listed[0].study) as store:
            remark(*_apart(store.versions(), listed[0].version, store.path))
            with study_progress(len(listed)) as tell:
                try:
                    return complete(
                        listed, store, backend, options, lambda _, row, new: tell(row.status == "failed", new)
                    )
                except (KeyboardInterrupt, StoreError):
                    kept = len(store.done(listed))
                    raise
    except KeyboardInterrupt:
        reason = "interrupted"
    except StoreError as error:
        reason = str(error)
    if kept is None:
        fail(f"{reason}; no trial was flown, what {folder} holds stays", code=1)
    rest = "without --redo, the same command flies the rest" if options.redo else "the same command flies the rest"
    fail(f"{reason}; {kept} of {len(listed)} trials are kept in {folder}, {rest}", code=1)


@contextmanager
def _backend(workers: int, dask: str | None) -> Iterator[Backend]:
    if dask is None:
        from sim.study.pool import Pool

        with Pool(workers) as pool:
            yield pool
    else:
        from sim.study.cluster import connected

        with connected(dask) as cluster:
            yield cluster


def _apart(versions: dict[str, int], version: str, path: Path) -> list[str]:
    """What to say of results that another version of the package left."""
    others = ", ".join(f"{count} of version {other}" for other, count in versions.items() if other != version)
    return [f"{path}: trials of another version are kept apart, not shown: {others}"] if others else []
