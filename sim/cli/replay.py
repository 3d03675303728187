"""`understory replay`."""

from pathlib import Path
from typing import Annotated

import typer

from sim.facts.flight import Flight, find_scans
from sim.mission.archive import find_recording
from sim.mission.atomic_files import claim_place
from sim.mission.recording import Recording
from sim.scenario.quantities import parse_interval, parse_number
from sim.terminal.commands import Recorded, check_new, find_folder
from sim.terminal.console import say, show_place
from sim.terminal.progress import show_counted_progress
from sim.views.drawing.film import AS_FLOWN
from sim.views.drawing.redrawn_film import check_layout, redraw_film, write_film
from sim.views.page.page import describe_omission, write_page
from sim.views.window import show
from tracking.errors import InputError

_SPEEDS = (0.05, 20.0)  # slowest and fastest


_Video = Annotated[bool, typer.Option("--video", help="Make the film again; this is the default.")]
_Gui = Annotated[bool, typer.Option("--gui", help="Show the world in PyBullet's window, from any side.")]
_Rerun = Annotated[
    str | None, typer.Option(metavar="FILE.rrd|spawn", help="Write a file for the Rerun viewer, or spawn the viewer.")
]
_Page = Annotated[bool, typer.Option("--page", help="Make the page again, with the film in DIR if there is one.")]
_Layout = Annotated[
    str | None, typer.Option(metavar="NAME", help="Layout of the film: map+cameras (as flown), map, cameras, or uav1.")
]
_Speed = Annotated[
    str | None, typer.Option(metavar="X", help="Factor of speed: 2 is twice as fast, 0.25 is slow motion.")
]
_Window = Annotated[str | None, typer.Option(metavar="T:T2", help="Only the scans from T to T2 seconds.")]
_File = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="New .mp4, or .html with --page. Default: replay.mp4 or mission.html in DIR."),
]


def replay(
    recorded: Recorded,
    video: _Video = False,
    gui: _Gui = False,
    rerun: _Rerun = None,
    page: _Page = False,
    layout: _Layout = None,
    speed: _Speed = None,
    time: _Window = None,
    out: _File = None,
) -> None:
    """Show a recorded mission again: as film or page, in PyBullet's window or the Rerun viewer. Nothing is planned."""
    fitting = {"--layout": layout, "--speed": speed, "--time": time, "--out": out}
    asked = {"--video": video, "--gui": gui, "--rerun": rerun is not None, "--page": page}
    _check_way(asked, [name for name, value in fitting.items() if value is not None])
    factor = 1.0 if speed is None else _parse_speed(speed)
    start, end = (0.0, None) if time is None else _parse_window(time)
    if out is not None:
        check_new(out, ".html" if page else ".mp4", "--out")
    recording = find_recording(recorded)
    folder = find_folder(recorded)
    scans = list(range(len(recording.times))) if end is None else find_scans(recording, start, end)
    if rerun is not None:
        _show_in_rerun(recording, rerun)
    elif page:
        with claim_place(out, folder / "mission", ".html") as path:
            _make_page(recording, folder, path)
    elif gui:
        show(recording, scans, speed=factor, say=say)
    else:
        with claim_place(out, folder / "replay", ".mp4") as path:
            _make_film(recording, scans, path, layout=layout, speed=factor)


def _check_way(asked: dict[str, bool], given: list[str]) -> None:
    """InputError if several ways to show a mission are asked for, or options that do not belong to the way."""
    ways = [name for name, wanted in asked.items() if wanted] or ["--video"]
    if len(ways) > 1:
        raise InputError(f"{ways[1]}: not allowed together with {ways[0]}; ask for one at a time")
    allowed = {
        "--video": ["--layout", "--speed", "--time", "--out"],
        "--gui": ["--speed", "--time"],
        "--page": ["--out"],
    }
    for name in given:
        if name not in allowed.get(ways[0], []):
            fitting = " and ".join(way for way, options in allowed.items() if name in options)
            raise InputError(f"{name}: not allowed together with {ways[0]}; it belongs to {fitting}")


def _parse_speed(text: str) -> float:
    value = parse_number(text.strip().removesuffix("x"))
    if not _SPEEDS[0] <= value <= _SPEEDS[1]:
        raise InputError(f"--speed: {text!r} is not allowed; expected a factor from {_SPEEDS[0]:g} to {_SPEEDS[1]:g}")
    return value


def _parse_window(text: str) -> tuple[float, float]:
    start, end = parse_interval(text, "--time")
    if end is None:
        raise InputError(f"--time: {text!r} is not allowed; expected a first and a last time such as 12:20")
    return start, end


def _make_film(recording: Recording, scans: list[int], path: Path, *, layout: str | None, speed: float) -> None:
    layout = layout or AS_FLOWN
    check_layout(layout, recording.setting)
    with show_counted_progress(len(scans), "scans") as progress:
        write_film(recording, scans, path, layout=layout, speed=speed, progress=progress)
    show_place("Film", path)


def _make_page(recording: Recording, folder: Path, path: Path) -> None:
    beside = folder / "mission.mp4"
    left_out = describe_omission(recording)
    film: bytes | Path | None = None if left_out else beside
    if film and not beside.is_file():
        with show_counted_progress(len(recording.times), "scans") as progress:
            film = redraw_film(recording, progress=progress)
    write_page(Flight(recording), path, video=film, place=str(folder))
    if left_out:
        say(left_out)
    show_place("Page", path)


def _show_in_rerun(recording: Recording, target: str) -> None:
    path = Path(target)
    if target != "spawn":
        check_new(path, ".rrd", "--rerun", also=", or spawn")
    try:
        from sim.views.rerun_viewer import spawn, write
    except ImportError as error:
        if (error.name or "").split(".")[0] != "rerun":
            raise
        raise InputError("--rerun: needs rerun-sdk: pip install 'rerun-sdk>=0.39,<0.42'") from error
    flight = Flight(recording)
    with show_counted_progress(len(recording.times), "scans") as progress:
        if target == "spawn":
            spawn(flight, progress=progress)
            return
        write(flight, path, progress=progress)
    show_place("Open it", f"rerun {target}")
