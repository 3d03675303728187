"""Progress of compilation, flights and drawings: a bar in a terminal, elsewhere a line now and then."""

import sys
import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from statistics import fmean
from typing import NamedTuple

from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from sim.mission.trial import Compilation, Moment
from sim.scenario.scenario import Scenario
from sim.terminal.console import console, say

_PAUSE = 10.0  # s, least time between two lines on progress
_FIRST = 8  # least number of steps by which the time of the rest is estimated
_LAST = 100  # number of trials, the latest, by which it is told how many fly at once
Show = Callable[[int, int, str], None]  # gets what is done, all there is to do, and both in words


@contextmanager
def show_mission_progress(scenario: Scenario) -> Iterator[Callable[[Moment], None]]:
    """Show how much is compiled, then the simulated time and the running mean of the OSPA distance."""
    times = scenario.scan_times
    scans, total, distances = 0, 0.0, 0  # sum and number of the distances so far
    with show_progress() as show:

        def tell(moment: Moment) -> None:
            nonlocal scans, total, distances
            if isinstance(moment, Compilation):
                show_compilation(show, moment)
                return
            scans += 1
            total, distances = total + sum(moment.distances), distances + len(moment.distances)
            error = f"{fmean(moment.distances):.2f} m" if moment.distances else "-"
            text = f"{moment.time:.1f} of {times[-1]:g} s, OSPA {error}, mean {total / distances:.2f} m"
            show(scans, len(times), text)

        yield tell


def show_compilation(show: Show, moment: Compilation) -> None:
    """Show how much is compiled by the function that `show_progress` yields."""
    show(*moment, f"compiling: {moment.done} of {moment.total} functions")


@contextmanager
def show_counted_progress(total: int, what: str) -> Iterator[Callable[[object], None]]:
    """Show the number of frames or scans done; each call of the function that is yielded counts one more."""
    numbers = count(1)
    with show_progress() as show:
        yield lambda _: show(done := next(numbers), total, f"{done} of {total} {what}")


@contextmanager
def show_study_progress(left: Counter[Hashable]) -> Iterator[Callable[[Hashable, float | None, bool], None]]:
    """Show how many trials of a study have ended, their pace, and the time that the rest takes once it can be told.

    left: number of trials of each cell. Yields a function of the cell of a trial that has ended, its wall time [s] or
    None if it failed, and whether it was flown now or before.
    """
    total, begun = left.total(), time.monotonic()
    flown: list[_Flown] = []
    done, failures = 0, 0
    with show_progress(time_left=False) as show:

        def tell(cell: Hashable, seconds: float | None, fresh: bool) -> None:
            nonlocal done, failures
            done += 1
            failures += seconds is None
            left[cell] -= 1
            now = time.monotonic()
            if fresh:
                flown.append(_Flown(cell, now, seconds))
            pace = describe_pace(len(flown), estimate_rest(flown, +left), failures, now - begun)
            show(done, total, f"{done} of {total} trials{pace}")

        yield tell


class _Flown(NamedTuple):
    """A trial that was flown."""

    cell: Hashable
    end: float  # s
    seconds: float | None  # wall time; None if it failed


def estimate_rest(flown: Sequence[_Flown], left: Mapping[Hashable, int]) -> float | None:
    """Time [s] until all trials left have ended, by the mean time of each cell and how many trials fly at once.

    None until every cell left has had a trial, and twice as many have ended as fly at once: an executor does not say
    how many these are, and planners differ by a factor of ten and more.
    """
    times: dict[Hashable, list[float]] = {trial.cell: [] for trial in flown}
    for trial in flown:
        times[trial.cell] += [] if trial.seconds is None else [trial.seconds]
    known = [seconds for own in times.values() for seconds in own]
    if not known or not left or not left.keys() <= times.keys():
        return None
    spans = [(trial.end - trial.seconds, trial.end) for trial in flown[-_LAST:] if trial.seconds is not None]
    middles = [(begin + end) / 2 for begin, end in spans]
    at_once = max((sum(begin <= middle <= end for begin, end in spans) for middle in middles), default=1)
    if len(known) < 2 * at_once:
        return None
    each = {cell: fmean(times[cell] or known) for cell in left}
    return max(*each.values(), sum(count * each[cell] for cell, count in left.items()) / at_once)


@contextmanager
def show_progress(*, time_left: bool = True) -> Iterator[Show]:
    """Yield a function that shows how much is done. If that is no more than before, another stage has begun.

    A terminal has a bar from the first call on, so that an error at the start is printed without one. Any other output
    gets a line now and then, for the log of a long run: each after another 10 s, or after a tenth of the time so far.
    time_left: False if the words say how long the rest will take.
    """
    bar = Progress(SpinnerColumn(), BarColumn(bar_width=16), TextColumn("{task.description}"), console=console)
    task = bar.add_task("")
    start = told = began = time.monotonic()
    last = before = 0  # what is done, and what was done when the present stage began
    with console.status("starting up") as status:  # disappears before the bar or an error message

        def show(done: int, total: int, text: str) -> None:
            nonlocal told, began, last, before
            now = time.monotonic()
            if done <= last or last == 0:
                began, before = now, done
            last = done
            # A decision takes as long as many scans, so that the first few steps tell little.
            if time_left and done < total and done - before >= min(max(_FIRST, total / 20), 2 * _FIRST):
                text += f", {format_clock((now - began) / (done - before) * (total - done))} left"
            if console.is_interactive:
                status.stop()
                bar.update(task, completed=done, total=total, description=escape(text))
                bar.start()
            elif now - told >= max(_PAUSE, 0.1 * (now - start)):
                told = now
                say(text)

        def debug(*_: object) -> None:
            """Stop the bar until the next call, because it would be drawn over the debugger's prompt."""
            import pdb  # here, since its import takes a tenth of a second

            status.stop()
            bar.stop()
            pdb.Pdb().set_trace(sys._getframe(1))

        hook, sys.breakpointhook = sys.breakpointhook, debug
        try:
            yield show
        finally:
            sys.breakpointhook = hook
            if bar.live.is_started:  # otherwise an empty line would precede an error message
                bar.stop()


def describe_pace(flown: int, rest: float | None, failures: int, seconds: float) -> str:
    """Rate, remaining time and failures in words: ", 12.0 a minute, 1:40 left, 2 failed"."""
    parts = [f"{60 * flown / seconds:.1f} a minute"] if flown and seconds > 0 else []
    if rest is not None:
        parts.append(f"{format_clock(rest)} left")
    if failures:
        parts.append(f"{failures} failed")
    return "".join(f", {part}" for part in parts)


def format_clock(seconds: float) -> str:
    """A time as minutes and seconds, or as hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
