"""`understory frames`."""

from pathlib import Path
from typing import Annotated

import typer

from sim.recording.atomic_files import unused
from sim.scenario.quantities import integer, interval
from sim.terminal.options import Recorded
from sim.terminal.progress import trial_progress
from sim.terminal.results import show_files


def frames(
    recorded: Recorded,
    uav: Annotated[str, typer.Option(metavar="I", help="The UAV of the camera, from 0.")],
    time: Annotated[str, typer.Option(metavar="T[:T2]", help="The scan nearest to T, or all from T to T2.")],
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="New folder. Default: one in DIR.")] = None,
    size: Annotated[str, typer.Option(metavar="PX", help="Edge of the camera's image, at most.")] = "896",
) -> None:
    """Render frames of a recorded mission again; mark detections, tracks, truth, and the trees that hide people."""
    start, end = interval(time, "--time")
    edge = integer(size, "--size", least=256, most=4096)
    from sim.replay.frames.pages import check_working, scans_between, write_frames
    from sim.replay.frames.rerender import find

    recording = find(recorded)
    number = integer(uav, "--uav", least=0, most=recording.poses.shape[1] - 1)
    scans = scans_between(recording, start, end)
    check_working(recording, scans, number)
    span = f"{start:g}s" if end is None else f"{start:g}-{end:g}s"
    folder = out or unused((recorded if recorded.is_dir() else recorded.parent) / f"frames-uav{number}-{span}")
    with trial_progress(len(scans), "frames") as progress:
        write_frames(recording, scans, number, folder, size=edge, progress=progress)
    show_files(folder)
