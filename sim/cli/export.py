"""`understory export`."""

from pathlib import Path
from typing import Annotated

import typer

from sim.recording.atomic_files import unused
from sim.terminal.options import Recorded
from sim.terminal.results import show_files


def export(
    recorded: Recorded,
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
