"""How far a study is, while it flies."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from sim.terminal.console import console


@contextmanager
def study_progress(total: int) -> Iterator[Callable[[bool, bool], None]]:
    """A bar that is told of each trial whether it failed, and whether it was flown just now."""
    columns = (SpinnerColumn(), BarColumn(bar_width=20), MofNCompleteColumn(), TextColumn("trials{task.description}"))
    start, flown, failures = time.monotonic(), 0, 0
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(
            "" if total == 0 else ", starting up; the first time, code is compiled: about a minute", total=total
        )

        def tell(failed: bool, fresh: bool) -> None:
            nonlocal flown, failures
            flown, failures = flown + fresh, failures + failed
            progress.advance(task)
            left = total - int(progress.tasks[0].completed)
            progress.update(task, description=pace(flown, left, failures, time.monotonic() - start))

        yield tell


def pace(flown: int, left: int, failures: int, seconds: float) -> str:
    """Rate, remaining time and failures in words: ", 12.0 a minute, 1:40 left, 2 failed"."""
    parts = []
    if flown and seconds > 0:
        parts.append(f"{60 * flown / seconds:.1f} a minute")
        if left:
            minutes, rest = divmod(round(left * seconds / flown), 60)
            parts.append(
                f"{minutes // 60}:{minutes % 60:02}:{rest:02} left" if minutes >= 60 else f"{minutes}:{rest:02} left"
            )
    if failures:
        parts.append(f"{failures} failed")
    return "".join(f", {part}" for part in parts)
