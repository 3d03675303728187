"""Faults of plug-ins, and breakdowns."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """Something a planner or a detector did wrong, or the breakdown of a UAV, and to whose harm."""

    time: float  # s
    uav: int | None  # None: the whole team
    message: str
    trace: tuple[str, ...] = ()  # the last lines of the plug-in's own code, "file:line, in function: text"
