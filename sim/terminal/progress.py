"""Progress bars for flights and drawings."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import fmean

from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

from sim.mission.trial import ScanProgress
from sim.scenario.scenario import Scenario
from sim.terminal.console import console

START_UP = "starting up"


@contextmanager
def show_mission_progress(scenario: Scenario) -> Iterator[Callable[[ScanProgress], None]]:
    """A bar with the simulated time and the running mean of the OSPA distance."""
    last = scenario.scan_times[-1]
    total, count = 0.0, 0  # sum and number of the distances so far
    columns = (BarColumn(bar_width=20), TextColumn("{task.description}"))
    with _show_bar(len(scenario.scan_times), *columns) as advance:

        def show(moment: ScanProgress) -> None:
            nonlocal total, count
            total, count = total + sum(moment.distances), count + len(moment.distances)
            error = f"{fmean(moment.distances):.2f} m" if moment.distances else "-"
            advance(f"{moment.time:.1f} of {last:g} s, OSPA {error}, mean {total / count:.2f} m")

        yield show


@contextmanager
def show_counted_progress(total: int, what: str) -> Iterator[Callable[[object], None]]:
    """A bar with the number of frames or scans done."""
    with _show_bar(total, BarColumn(bar_width=40), MofNCompleteColumn(), TextColumn(what)) as advance:
        yield lambda outcome: advance("")


@contextmanager
def _show_bar(total: int, *columns: BarColumn | MofNCompleteColumn | TextColumn) -> Iterator[Callable[[str], None]]:
    """Yield a function that advances a bar and describes what is done.

    The bar is shown from its first call on, so that none precedes an error of the start.
    """
    progress = Progress(SpinnerColumn(), *columns, TimeRemainingColumn(), console=console)
    task = progress.add_task("", total=total)
    with console.status(START_UP) as status:  # disappears before the progress or an error message

        def advance(description: str) -> None:
            if not progress.live.is_started:
                status.stop()
                progress.start()
            progress.update(task, advance=1, description=description)

        def debug(*_: object) -> None:
            """Stop the bar until the next call, because it would be drawn over the debugger's prompt."""
            import pdb  # here, since its import takes a tenth of a second

            status.stop()
            progress.stop()
            pdb.Pdb().set_trace(sys._getframe(1))

        before, sys.breakpointhook = sys.breakpointhook, debug
        try:
            yield advance
        finally:
            sys.breakpointhook = before
            if progress.live.is_started:  # otherwise an empty line would precede an error message
                progress.stop()


@contextmanager
def show_study_progress(total: int) -> Iterator[Callable[[bool, bool], None]]:
    """A bar with the number of trials done; called with two flags: the trial failed, and it was flown just now."""
    columns = (SpinnerColumn(), BarColumn(bar_width=20), MofNCompleteColumn(), TextColumn("trials{task.description}"))
    start = time.monotonic()
    flown = 0
    failures = 0
    with Progress(*columns, console=console) as progress:
        starting = ", starting up; the first time, code is compiled: about a minute"
        task = progress.add_task(starting, total=total)

        def tell(failed: bool, fresh: bool) -> None:
            nonlocal flown, failures
            flown, failures = flown + fresh, failures + failed
            progress.advance(task)
            left = total - int(progress.tasks[0].completed)
            progress.update(task, description=describe_pace(flown, left, failures, time.monotonic() - start))

        yield tell


def describe_pace(flown: int, left: int, failures: int, seconds: float) -> str:
    """Rate, remaining time and failures in words: ", 12.0 a minute, 1:40 left, 2 failed"."""
    parts = []
    if flown and seconds > 0:
        parts.append(f"{60 * flown / seconds:.1f} a minute")
        if left:
            minutes, rest = divmod(round(left * seconds / flown), 60)
            hours, minutes = divmod(minutes, 60)
            parts.append(f"{hours}:{minutes:02}:{rest:02} left" if hours else f"{minutes}:{rest:02} left")
    if failures:
        parts.append(f"{failures} failed")
    return "".join(f", {part}" for part in parts)
