"""The files in a folder of results, of a mission or of a flight from elsewhere."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.facts.flight import Flight
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import summarise
from sim.mission.archive import save
from sim.mission.trial import Say
from sim.views.drawing.plots import save as save_figure
from sim.views.page.page import describe_omission, write_page


@dataclass(frozen=True)
class Results:
    """What a mission leaves in its folder."""

    folder: Path
    final: Path  # name of the folder when it is complete
    video: bool  # False: neither mission.mp4 nor mission.html
    metrics: Sequence[str]  # import strings of plug-in metrics for the summary


def write_results(results: Results, flight: Flight) -> None:
    """Write the files of a mission except its film, which is there, and its summary."""
    folder = results.folder
    save(flight.recording, folder / "mission.npz")
    if flight.recording.labelled:
        save_figure(flight.ospa_figure(), folder / "ospa.png")
        save_figure(flight.timeline_figure(), folder / "timeline.png")
    if results.video:
        write_page(flight, folder / "mission.html", video=folder / "mission.mp4", place=str(results.final))


def write_summary(results: Results, outcome: Outcome, say: Say) -> dict[str, Any]:
    """Write the summary and return it; `say` what the page leaves out."""
    summary = summarise(outcome, results.metrics)
    (results.folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if results.video and (left_out := describe_omission(outcome.recording)):
        say(left_out)
    return summary
