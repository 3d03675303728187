"""`understory track`."""

import math
import shlex
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import name_flight, track_flight
from sim.facts.metrics.summary import make_results_table
from sim.mission.atomic_files import claim_place, make_new_folder
from sim.mission.recording import Recording
from sim.running.folder import Results
from sim.running.pictures import draw_still_pictures
from sim.running.results import write_results
from sim.scenario.quantities import parse_number, parse_seed_and_repeat
from sim.terminal.commands import Overrides
from sim.terminal.console import console, print_remarks, say, show_files, show_place
from sim.terminal.progress import show_counted_progress
from sim.views.drawing.redrawn_film import write_film
from tracking.errors import InputError

_Flight = Annotated[Path, typer.Argument(metavar="FLIGHT", help="Folder of a flight's files, or a bag of ROS 2.")]
_Out = Annotated[Path | None, typer.Option(metavar="DIR", help="New folder for the results. Default: one under runs/.")]
_Origin = Annotated[str, typer.Option(metavar="X,Y", help="Place in the files [m] that becomes the area's centre.")]
_Sigma = Annotated[
    str,
    typer.Option(metavar="M", help="Standard deviation [m] to add to detections without a covariance of their own."),
]
_Video = Annotated[bool, typer.Option(help="Make mission.mp4 and mission.html, or not.")]
_Detector = Annotated[str, typer.Option(metavar="NAME", help="Detector for images.csv, or yours as module:Class.")]
_Classes = Annotated[
    str, typer.Option(metavar="NAMES", help="Classes of detections that count, as pedestrian,people. Default: people.")
]
_LeastScore = Annotated[str, typer.Option(metavar="S", help="Least score of detections that count. Default: above 0.")]
_Seed = Annotated[str, typer.Option(metavar="N", help="Decides which messages are lost, with network.loss.")]


def track(
    flight: _Flight,
    overrides: Overrides = None,
    origin: _Origin = "0,0",
    sigma: _Sigma = "0",
    detector: _Detector = "blob",
    classes: _Classes = "",
    least_score: _LeastScore = "",
    seed: _Seed = "0",
    out: _Out = None,
    video: _Video = True,
) -> None:
    """Track people in a flight from elsewhere. A new folder gets its recording, summary, film, page and timeline."""
    centre = _parse_origin(origin)
    error = _parse_sigma(sigma)
    drawn, _ = parse_seed_and_repeat(seed, "0", "--")
    scanned = read_flight(
        flight,
        overrides=overrides or (),
        origin=centre,
        sigma=error,
        detector=detector,
        classes=classes,
        least_score=_parse_score(least_score) if least_score else None,
    )
    print_remarks(*scanned.remarks)
    name = flight.resolve().name
    with claim_place(out, Path("runs") / f"track-{name}") as place, make_new_folder(place) as folder:
        scans = len(scanned.frames)
        with show_counted_progress(scans, "scans") as progress:
            outcome = track_flight(scanned, name=name_flight(flight), seed=drawn, progress=progress)
        results = Results(folder, place, video, ())
        if video:
            with show_counted_progress(scans, "pictures") as progress:
                write_film(outcome.recording, range(scans), results.film, progress=progress)
        summary = write_results(results, outcome, partial(draw_still_pictures, results), say)
    if outcome.recording.labelled:
        console.print(make_results_table(summary))
    else:
        say(_describe_tracks(outcome.recording))
    show_files(place)
    what = "People lost, when and why" if outcome.recording.labelled else "Why tracks faded"
    show_place(what, f"understory explain {shlex.quote(str(place))}")


def _describe_tracks(recording: Recording) -> str:
    count = len(set(recording.track_ids[recording.reported].tolist()))
    tracks = f"{count} track{'s' * (count != 1)} in {recording.times[-1]:.1f} s"
    return f"{tracks}; with the people in truth.csv there would be metrics, too."


def _parse_origin(text: str) -> tuple[float, float]:
    east, comma, north = text.partition(",")
    place = parse_number(east.strip()), parse_number(north.strip())
    if not comma or not all(map(math.isfinite, place)):
        raise InputError(f"--origin: {text!r} is not allowed; expected two numbers such as 457100,5428300")
    return place


def _parse_sigma(text: str) -> float:
    value = parse_number(text)
    if not 0 <= value <= 100:
        raise InputError(f"--sigma: {text!r} is not allowed; expected 0 to 100 m")
    return value


def _parse_score(text: str) -> float:
    value = parse_number(text)
    if not math.isfinite(value):
        raise InputError(f"--least-score: {text!r} is not allowed; expected a number such as 0.5")
    return value
