"""Faults of plug-ins, and breakdowns of UAVs."""

from dataclasses import dataclass

DETECTOR, METRIC, CLIPPED = "detector: ", "metric ", "; clipped"  # words of the faults that fail no decision
BREAKDOWN = "broke down, hovers from now on"


@dataclass(frozen=True)
class Fault:
    """Fault of a planner or a detector, or the breakdown of a UAV."""

    time: float  # s
    uav: int | None  # None means the whole team
    message: str
    trace: tuple[str, ...] = ()  # last lines of the traceback in the plug-in's code, "file:line, in function: text"

    @property
    def fails_decision(self) -> bool:
        """True if the planner raised or returned no valid plan; other faults begin or end with words of their own."""
        of_others = self.message.startswith((DETECTOR, METRIC)) or self.message == BREAKDOWN
        return not of_others and not self.message.endswith(CLIPPED)
