"""Pictures of a mission, drawn by a second process while it flies.

This module imports little, so that the process can start before what a mission needs is imported.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from sim.processes.companion import Companion, CompanionLost
from sim.processes.cores import count_cores

if TYPE_CHECKING:
    from sim.facts.flight import Flight
    from sim.mission.recorder import Heading
    from sim.mission.snapshot import Snapshot
    from sim.mission.trial import Say
    from sim.running.folder import Results
    from sim.running.pictures import Pictures
    from tracking.numerics.arrays import Image


def start_painter() -> AbstractContextManager[Companion | None]:
    """The process that draws pictures, which ends with the block; None if there is no second core for it."""
    return Companion("sim.running.pictures:draw_beside") if count_cores() > 1 else nullcontext()


def open_pictures(
    painter: Companion | None, results: "Results", heading: "Heading", say: "Say"
) -> "AbstractContextManager[Pictures | PicturesBeside]":
    """The pictures of a mission, drawn by this process if there is no painter."""
    if painter:
        return nullcontext(PicturesBeside(painter, results, heading, say))
    from sim.running.pictures import Pictures

    return Pictures(results, heading)


class PicturesBeside:
    """As `Pictures`, drawn by a painter; if that dies, they are drawn here after the flight, from its recording."""

    def __init__(self, painter: Companion, results: "Results", heading: "Heading", say: "Say") -> None:
        self._painter = painter
        self._results = results
        self._say = say
        self._lost: CompanionLost | None = None
        self._send((results, heading))

    def add(self, snapshot: "Snapshot", images: "Sequence[Image | None]") -> None:
        """Have one scan drawn, with the images of its cameras."""
        self._send((snapshot.plain(), images if self._results.video else ()))

    def end(self) -> None:
        """Say that there are no more scans."""
        if not self._lost:
            try:
                self._painter.end()
            except CompanionLost as lost:
                self._lost = lost

    def draw(self, flight: "Flight") -> str:
        """Wait until all pictures are drawn, and return what the page leaves out, in words."""
        if not self._lost:
            try:
                return str(self._painter.result())
            except CompanionLost as lost:
                self._lost = lost
        from sim.running.pictures import draw_again

        self._say(f"The process that draws film and page {self._lost}; they are drawn again.")
        return draw_again(self._results, flight)

    def _send(self, value: object) -> None:
        if not self._lost:
            try:
                self._painter.send(value)
            except CompanionLost as lost:
                self._lost = lost
