"""`understory replay`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from sim.atomic import unused
from sim.console import console, trial_progress
from sim.errors import InputError
from sim.quantity import interval

if TYPE_CHECKING:  # a complaint about the input needs none of what these import
    from sim.recording import Recording

_SPEEDS = (0.05, 20.0)  # slowest and fastest


def replay(
    recorded: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or its mission.npz.")],
    video: Annotated[bool, typer.Option("--video", help="Make the film again; so it is without an option.")] = False,
    gui: Annotated[bool, typer.Option("--gui", help="Show the world in PyBullet's window, from any side.")] = False,
    rerun: Annotated[
        str | None, typer.Option(metavar="FILE.rrd|spawn", help="Write a file for the Rerun viewer, or open it.")
    ] = None,
    layout: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of the film: map+cameras (as flown), map, cameras, or uav1.")
    ] = None,
    speed: Annotated[str | None, typer.Option(metavar="X", help="2: twice as fast; 0.25: slow motion.")] = None,
    time: Annotated[str | None, typer.Option(metavar="T:T2", help="Only the scans from T to T2.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="New file of the film. Default: replay.mp4 in DIR.")
    ] = None,
) -> None:
    """Show a recorded mission again: as a film, in PyBullet's window or in the Rerun viewer. Nothing is planned."""
    fitting = {"--layout": layout, "--speed": speed, "--time": time, "--out": out}
    way = _way(video, gui, rerun is not None, [name for name, value in fitting.items() if value is not None])
    factor = _speed(speed or "1")
    start, end = (0.0, math.inf) if time is None else _window(time)
    from sim.frames import find

    recording = find(recorded)
    if rerun is not None:
        _rerun(recording, rerun)
        return


def _way(video: bool, gui: bool, rerun: bool, given: list[str]) -> str:
    """How to show it; InputError where several ways, or options that do not belong to the one, are asked for."""
    ways = [name for name, asked in (("--video", video), ("--gui", gui), ("--rerun", rerun)) if asked] or ["--video"]
    if len(ways) > 1:
        raise InputError(f"{ways[1]}: not allowed together with {ways[0]}; ask for one at a time")
    allowed = {"--video": ["--layout", "--speed", "--time", "--out"], "--gui": ["--speed", "--time"], "--rerun": []}
    for name in given:
        if name not in allowed[ways[0]]:
            raise InputError(f"{name}: not allowed together with {ways[0]}; it belongs to --video")
    return ways[0]


def _speed(text: str) -> float:
    try:
        value = float(text.strip().removesuffix("x"))
    except ValueError:
        value = math.nan
    if not _SPEEDS[0] <= value <= _SPEEDS[1]:
        raise InputError(f"--speed: {text!r} is not allowed; expected a factor from {_SPEEDS[0]:g} to {_SPEEDS[1]:g}")
    return value


def _window(text: str) -> tuple[float, float]:
    start, end = interval(text, "--time")
    if end is None:
        raise InputError(f"--time: {text!r} is not allowed; expected a first and a last time such as 12:20")
    return start, end


def _rerun(recording: Recording, target: str) -> None:
    """Write the recording for the Rerun viewer to a new file, or open it in the viewer."""
    from sim.frames import scenario_of

    path = Path(target)
    if target != "spawn" and path.suffix != ".rrd":
        raise InputError(f"--rerun: {target!r} is not allowed; expected a new file FILE.rrd, or spawn")
    if target != "spawn" and path.exists():
        raise InputError(f"--rerun: {target} exists; name a new file")
    try:
        from sim.replay import rerun_view
    except ImportError as error:
        raise InputError("--rerun: needs rerun-sdk: pip install 'understory[rerun]'") from error
    with trial_progress(len(recording.times), "scans") as progress:
        if target == "spawn":
            rerun_view.spawn(recording, scenario_of(recording), progress=progress)
            return
        rerun_view.write(recording, scenario_of(recording), path, progress=progress)
    console.print(f"Open it: [bold]rerun {escape(target)}[/bold]", soft_wrap=True)
