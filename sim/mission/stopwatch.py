"""Stopwatch for the stages of a mission."""

import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STAGES = ("physics", "rendering", "detection", "tracking", "planning", "video")


class Stopwatch:
    """Wall time per stage [s]: `laps`, one per measured block, and their sums; for planning also processor time."""

    def __init__(self) -> None:
        self.laps: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self.planning_cpu_s = 0.0  # sum over all threads of this process

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of each stage so far."""
        return {stage: math.fsum(laps) for stage, laps in self.laps.items()}

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Count the time of the block as part of `stage`."""
        laps = self.laps[stage]
        start = time.perf_counter()
        try:
            yield
        finally:
            laps.append(time.perf_counter() - start)

    @contextmanager
    def planning(self) -> Iterator[None]:
        """Count wall time and processor time of the block as part of planning; processor time takes 2 µs to read."""
        start = time.process_time()
        try:
            with self.measure("planning"):
                yield
        finally:
            self.planning_cpu_s += time.process_time() - start


def find_process_start() -> float:
    """Value that `time.perf_counter` had when this process started, to 10 ms; now, if the system does not tell."""
    now = time.perf_counter()
    try:
        text = Path("/proc/self/stat").read_text(encoding="utf-8", errors="replace")
        ticks = int(text.rpartition(")")[2].split()[19])  # since the system's start
        return now - (time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK"))
    except (OSError, AttributeError, ValueError):  # not Linux
        return now
