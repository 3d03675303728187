"""`understory frames`."""

from pathlib import Path
from typing import Annotated

import typer

from sim.facts.flight import find_scans
from sim.mission.archive import find_recording
from sim.mission.atomic_files import claim_place
from sim.scenario.quantities import parse_integer, parse_interval
from sim.terminal.commands import Recorded, find_folder
from sim.terminal.console import show_files
from sim.terminal.progress import show_counted_progress
from sim.views.frames.frame_panels import write_frames

_Folder = Annotated[Path | None, typer.Option(metavar="FOLDER", help="New folder. Default: one in DIR.")]


def frames(
    recorded: Recorded,
    uav: Annotated[str, typer.Option(metavar="I", help="Number of the UAV, from 0.")],
    time: Annotated[str, typer.Option(metavar="T[:T2]", help="The scan nearest to T seconds, or all from T to T2.")],
    out: _Folder = None,
    size: Annotated[str, typer.Option(metavar="PX", help="Largest edge of the enlarged image.")] = "896",
) -> None:
    """Render frames of a recorded mission again; mark detections, tracks, truth, and the trees that hide people."""
    start, end = parse_interval(time, "--time")
    edge = parse_integer(size, "--size", least=256, most=4096)
    recording = find_recording(recorded)
    number = parse_integer(uav, "--uav", least=0, most=recording.uav_count - 1)
    scans = find_scans(recording, start, end, number)
    span = f"{start:g}s" if end is None else f"{start:g}-{end:g}s"
    with (
        claim_place(out, find_folder(recorded) / f"frames-uav{number}-{span}") as folder,
        show_counted_progress(len(scans), "frames") as progress,
    ):
        write_frames(recording, scans, number, folder, size=edge, progress=progress)
    show_files(folder)
