"""The folder of a mission's results."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Results:
    """What a mission leaves in its folder."""

    folder: Path
    final: Path  # name of the folder when it is complete
    video: bool  # False: neither mission.mp4 nor mission.html
    metrics: Sequence[str]  # import strings of plug-in metrics for the summary

    @property
    def film(self) -> Path:
        """The file of the film."""
        return self.folder / "mission.mp4"
