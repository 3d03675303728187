"""Faults of plug-ins, and breakdowns of UAVs."""

from dataclasses import dataclass

BREAKDOWN = "broke down, hovers from now on"


@dataclass(frozen=True)
class Fault:
    """Fault of a planner or a detector, or the breakdown of a UAV."""

    time: float  # s
    uav: int | None  # None means the whole team
    message: str
    trace: tuple[str, ...] = ()  # last lines of the traceback in the plug-in's code, "file:line, in function: text"
    fails_decision: bool = False  # True if the planner raised or returned no valid plan; recordings do not keep it
