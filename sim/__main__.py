"""The command line: `understory run`, `compare`, `replay`, `explain`, `frames`, `export`, `check-planner` and lists."""

from __future__ import annotations

import errno
import os
import re
import signal
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from planning.catalogue import catalogue
from planning.registry import DEFAULT_PLANNER, PlannerError, is_ours, load_planner
from sim.cli.compare import compare, studies
from sim.cli.explain import explain
from sim.cli.replay import replay
from sim.processes.isolation import ApartError
from sim.recording.atomic_files import unused
from sim.running.isolated_run import Flight, fly_apart
from sim.scenario.errors import InputError
from sim.scenario.loading import SCENARIOS, did_you_mean, load, remarks
from sim.scenario.quantities import MOST_SEED, REPEATS, integer, interval, seconds
from sim.sensing.detectors import comes_with
from sim.terminal.console import (
    console,
    fail,
    mission_progress,
    remark,
    say,
    show_files,
    show_findings,
    show_groups,
    show_list,
    show_run,
    starting,
    trial_progress,
)
from sim.terminal.options import Duration, Overrides, with_duration

# Engine, compiler and linear algebra take a second to import: commands that fly do so themselves.

START = """[bold]Understory[/bold]: UAVs that track walking people under trees, on rendered frames.

Fly the default mission; it leaves a folder under runs/:
  [bold]understory run[/bold]

Fly another one:
  [bold]understory run --planner greedy --seed 3[/bold]
  [bold]understory run --set trees.density=75 --duration 20[/bold]

Compare planners on the same forests, people and seeds:
  [bold]understory compare --planner sma-nbo-mwtp --planner hover --seeds 0-9[/bold]

See what a camera saw in a run, annotated:
  [bold]understory frames runs/forest-sma-nbo-mwtp-seed0 --uav 1 --time 12:14[/bold]

See a run again, slowed down, or in a window to look round in:
  [bold]understory replay runs/forest-sma-nbo-mwtp-seed0 --time 12:20 --speed 0.5[/bold]
  [bold]understory replay runs/forest-sma-nbo-mwtp-seed0 --gui[/bold]

See why a person was lost: by a time, or over the whole mission:
  [bold]understory explain runs/forest-sma-nbo-mwtp-seed0 --time 12.4 --target 2[/bold]
  [bold]understory explain runs/forest-sma-nbo-mwtp-seed0[/bold]

See what there is; yours are --planner module:Class and a file.toml:
  [bold]understory planners[/bold]
  [bold]understory scenarios[/bold]
  [bold]understory check-planner module:Class[/bold]

All options of a command:
  [bold]understory run --help[/bold]"""

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # a full disk, or one that fails
# A place that nothing can be written to, or read from.
_NO_PLACE = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG, errno.ELOOP)


class Commands(TyperGroup):
    """Commands that answer an unknown name with the nearest one."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - types that differ between typer's versions
        """The command of that name; InputError if there is none."""
        command = super().get_command(ctx, cmd_name)
        if command is None and not cmd_name.startswith("-"):
            raise InputError(f"command: {cmd_name!r} is unknown; {did_you_mean(cmd_name, self.list_commands(ctx))}")
        return command


app = typer.Typer(cls=Commands, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich")

Scenario = Annotated[str, typer.Argument(metavar="SCENARIO", help="Name (see `understory scenarios`) or .toml file.")]


@app.callback(invoke_without_command=True)
def start(context: typer.Context) -> None:
    """UAVs that track walking people under trees, on rendered frames: fly missions and compare planners."""
    if context.invoked_subcommand is None:
        console.print(START)


@app.command()
def run(
    scenario: Scenario = "forest",
    planner: Annotated[
        str, typer.Option(metavar="NAME", help="Name (see `understory planners`) or yours, module:Class.")
    ] = DEFAULT_PLANNER,
    seed: Annotated[str, typer.Option(metavar="N", help="Gives forest, people, noise and planner their chance.")] = "0",
    repeat: Annotated[
        str, typer.Option(metavar="N", help="Another chance of noise, network and planner on the seed's map.")
    ] = "0",
    duration: Duration = None,
    overrides: Overrides = None,
    metric: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A metric of yours, module:NAME; repeatable."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="New folder for the results. Default: one under runs/.")
    ] = None,
    video: Annotated[bool, typer.Option(help="Make mission.mp4 and mission.html, or not.")] = True,
    timeout: Annotated[
        str | None, typer.Option(metavar="TIME", help="Wall time beyond which the run has failed: 90, 5min.")
    ] = None,
) -> None:
    """Fly one mission; leave recording, summary, video, page, OSPA curve and timeline in a new folder."""
    setting = load(scenario, with_duration(overrides, duration))
    number = integer(seed, "--seed", least=0, most=MOST_SEED)
    again = integer(repeat, "--repeat", least=0, most=REPEATS - 1)
    limit = None if timeout is None else seconds(timeout, "--timeout")
    # Other people's code runs in a process of its own, as nothing else holds what it may do.
    trusted = comes_with(setting.sensing.detector) and is_ours(planner) and not metric
    if trusted:
        load_planner(planner)
    remark(*remarks(setting))
    place = Path("runs") / f"{Path(scenario).stem}-{_plain(planner)}-seed{number}"
    folder = out or unused(place.with_name(f"{place.name}-repeat{again}") if again else place)
    with mission_progress(setting) as progress:
        if trusted and limit is None:
            from sim.mission.mission import Trial
            from sim.running.run import run as fly

            summary = fly(Trial(setting, planner, number, again), folder, video=video, progress=progress, say=say)
        else:
            flight = Flight(setting, planner, number, again, video, tuple(metric or ()))
            summary = fly_apart(flight, folder, timeout=limit, progress=progress, say=say)
    show_run(summary, folder)


app.command()(compare)


@app.command()
def frames(
    recorded: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or its mission.npz.")],
    uav: Annotated[str, typer.Option(metavar="I", help="Whose camera, from 0.")],
    time: Annotated[str, typer.Option(metavar="T[:T2]", help="The scan nearest to T, or all from T to T2.")],
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="New folder. Default: one in DIR.")] = None,
    size: Annotated[str, typer.Option(metavar="PX", help="Edge of the camera's image, at most.")] = "896",
) -> None:
    """Render frames of a recorded mission again; mark detections, tracks, truth, and which tree hides whom."""
    start, end = interval(time, "--time")
    edge = integer(size, "--size", least=256, most=4096)
    from sim.replay.frames.pages import write_frames
    from sim.replay.frames.rerender import find
    from sim.replay.frames.scans import check_working, scans_between

    recording = find(recorded)
    number = integer(uav, "--uav", least=0, most=recording.poses.shape[1] - 1)
    scans = scans_between(recording, start, end)
    check_working(recording, scans, number)
    span = f"{start:g}s" if end is None else f"{start:g}-{end:g}s"
    folder = out or unused((recorded if recorded.is_dir() else recorded.parent) / f"frames-uav{number}-{span}")
    with trial_progress(len(scans), "frames") as progress:
        write_frames(recording, scans, number, folder, size=edge, progress=progress)
    show_files(folder)


app.command()(replay)
app.command()(explain)


@app.command()
def export(
    recorded: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or its mission.npz.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help="csv, stonesoup or mot: see docs/how-to/tracking.md.")],
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="New folder. Default: one in DIR.")] = None,
) -> None:
    """Write a recorded mission's scans, tracks and truth as text for other tools."""
    from sim.replay.export import export as write
    from sim.replay.export import writer
    from sim.replay.frames.rerender import find

    writer(to)
    recording = find(recorded)
    folder = out or unused((recorded if recorded.is_dir() else recorded.parent) / f"export-{to}")
    write(recording, to, folder)
    show_files(folder)


@app.command()
def planners() -> None:
    """List the planners: what each is, which package brings it, and its options."""
    show_groups(
        catalogue(),
        "With options: --planner 'sma-nbo-mwtp(horizon=3, beta=0.2)'.\n"
        "Yours: --planner module:Class, with module.py in the current folder or installed.",
    )


@app.command()
def scenarios() -> None:
    """List the packaged scenarios."""
    show_list(
        {name: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for name, path in SCENARIOS.items()},
        "Yours: a .toml file with the keys that differ. One key: --set key=value.",
    )


app.command()(studies)


@app.command("check-planner")
def check_planner(
    planner: Annotated[
        str, typer.Argument(metavar="PLANNER", help="Name, with options or not, or yours, module:Class.")
    ],
) -> None:
    """Check that a planner keeps to what planners must, on situations made for that; exit code 1 if it does not."""
    load_planner(planner)
    from planning.conformance.checks import check
    from sim.mission.warmup import announced

    with starting(), announced(say):
        findings = check(planner)
    failed = sum(finding.passed is False for finding in findings)
    show_findings(findings, failed)
    if failed:
        sys.exit(1)


def _plain(planner: str) -> str:
    """A planner's text as part of a folder's name that no shell minds."""
    return re.sub(r"[^\w.=-]+", "-", planner.replace(":", ".")).strip("-")


def main() -> None:
    """Entry point: exit code 0 done, 2 the input is wrong (one line says what), 1 anything else."""
    sys.path.append(os.getcwd())  # so that a planner in the current folder can be named; last, so it hides nothing
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # what schedulers send is Ctrl-C to us
    try:
        if app(standalone_mode=False):  # typer's exit code, which only Ctrl-C makes other than zero
            fail("interrupted; nothing is kept", code=1)
    except (InputError, PlannerError, ApartError) as error:
        fail(str(error), code=1 if isinstance(error, ApartError) else 2)
    except (KeyboardInterrupt, typer.Abort):
        fail("interrupted; nothing is kept", code=1)
    except OSError as error:
        if error.errno not in (*_NO_ROOM, *_NO_PLACE):
            raise
        code = 1 if error.errno in _NO_ROOM else 2
        fail(f"{error.filename or 'a file'}: {error.strerror}; nothing is kept", code=code)
    except Exception as error:
        # Typer's own complaints about arguments; their class differs between its versions.
        if not hasattr(error, "format_message"):
            raise
        fail(error.format_message(), code=2)


if __name__ == "__main__":
    main()
