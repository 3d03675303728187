"""The pictures of a mission: its film, scan by scan while it flies, and then OSPA curve, timeline and page."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Any

from sim.facts.flight import Flight
from sim.facts.metrics.summary import format_planner_title
from sim.mission.recorder import Heading, Recorder
from sim.mission.snapshot import Snapshot
from sim.running.folder import Results
from sim.views.drawing.film import Film, Video
from sim.views.drawing.plots import save as save_figure
from sim.views.drawing.redrawn_film import write_film
from sim.views.page.page import describe_omission, write_page
from tracking.numerics.arrays import Image


class Pictures(AbstractContextManager["Pictures"]):
    """The pictures of a mission while it flies; if its block raises, there is no film."""

    def __init__(self, results: Results, heading: Heading) -> None:
        self._results = results
        self._video: Video | None = None
        if results.video:
            title = format_planner_title(heading.planner, heading.sees_truth)
            film = Film(heading.scenario, heading.forest, planner=title, believed=heading.believed_forest)
            self._video = Video(results.film, film, fps=heading.scenario.rates.sensing)

    def add(self, snapshot: Snapshot, images: Sequence[Image | None]) -> None:
        """Draw one scan with the images of its cameras."""
        if self._video:
            self._video.add(snapshot, images)

    def end(self) -> None:
        """Finish the film."""
        if self._video:
            self._video.close()
            self._video = None

    def draw(self, flight: Flight) -> str:
        """Draw the other pictures, and return what the page leaves out, in words."""
        return draw_still_pictures(self._results, flight)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._video and kind is not None:
            self._video.discard()


def draw_still_pictures(results: Results, flight: Flight) -> str:
    """Draw all but the film, which is there, and return what the page leaves out, in words."""
    if flight.recording.labelled:
        save_figure(flight.ospa_figure(), results.folder / "ospa.png")
        save_figure(flight.timeline_figure(), results.folder / "timeline.png")
    if not results.video:
        return ""
    write_page(flight, results.folder / "mission.html", video=results.film, place=str(results.final))
    return describe_omission(flight.recording)


def draw_again(results: Results, flight: Flight) -> str:
    """Draw all pictures of a mission that has been flown; returns as `draw_still_pictures`."""
    for part in results.folder.glob(".*.part"):  # of a process that died
        part.unlink()
    if results.video:
        write_film(flight.recording, range(flight.recording.scan_count), results.film, progress=lambda k: None)
    return draw_still_pictures(results, flight)


def draw_beside(values: Iterator[Any]) -> str:
    """Draw the pictures of a mission in a companion; returns as `draw_still_pictures`.

    values: its results and its heading, then each snapshot with the images of its cameras.
    """
    results, heading = next(values)
    recorder = Recorder(heading.repeat)
    with Pictures(results, heading) as pictures:
        for snapshot, images in values:
            recorder.add(snapshot)
            pictures.add(snapshot, images)
        pictures.end()
        return pictures.draw(Flight(heading.make_recording(recorder)))
