"""Faults of plug-ins, and breakdowns."""

from dataclasses import dataclass

BREAKDOWN = "broke down, hovers from now on"


@dataclass(frozen=True)
class Fault:
    """Fault of a planner or a detector, or the breakdown of a UAV."""

    time: float  # s
    uav: int | None  # None: the whole team
    message: str
    trace: tuple[str, ...] = ()  # the last lines of the plug-in's own code, "file:line, in function: text"
