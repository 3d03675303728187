"""Work in a process of its own: what hangs in it can be ended, and what ends it ends nothing else."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import FrameType
from typing import Any, NamedTuple

from sim.processes.session import end, lead
from tracking.plugins.containment import ForeignError, contained

_GRACE = 5.0  # s that it has after a second Ctrl-C
_TICK = 0.2  # s
_CONTEXT = multiprocessing.get_context("spawn")

Tell = Callable[[object], None]
Work = Callable[..., Any]


class ApartError(RuntimeError):
    """The process ended without a result; the message is one line."""


class _Result(NamedTuple):
    value: Any


class _Failure(NamedTuple):
    error: BaseException


def apart(
    work: Work,
    *arguments: object,
    hear: Tell,
    listening: type,
    timeout: float | None,
    passing: tuple[type[BaseException], ...] = (),
) -> Any:  # noqa: ANN401 - what `work` returns
    """`work(*arguments, tell)` in a new process, which is gone afterwards, and with it what `session.end` ends.

    work: a module's function; with its arguments and its result it can be pickled. `hear` is called here with whatever
    is told there. What is raised there is raised here if it is of the classes `passing` or KeyboardInterrupt, else it
    is an ApartError, as it is where the process ends by itself or `timeout` [s] is over. Ctrl-C and SIGTERM are passed
    on once something of the class `listening` has been told, and end the process before that, or a while after the
    second.
    """
    ours, theirs = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_begin, args=(theirs, work, arguments, passing), daemon=True)
    with _noted() as interruption:  # nothing is interrupted in the block, so the process is always ended
        try:
            with _ignored():  # inherited: the process hears of Ctrl-C when it asks to
                process.start()
            theirs.close()
            return _outcome(_Talk(ours, process, hear, listening), interruption, timeout)
        finally:
            end(process)
            if process.pid is not None:
                process.join()
            process.close()
            ours.close()


class _Interruption:
    """When the user has asked to stop [s], whether the process can be asked, and how often it was."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.listens, self.passed = False, 0

    def heed(self, process: SpawnProcess) -> None:
        """Ask the process once for each time; KeyboardInterrupt if there is nothing to wait for."""
        if self.asked and not self.listens:
            raise KeyboardInterrupt
        if len(self.asked) > 1 and time.monotonic() - self.asked[1] > _GRACE:
            raise KeyboardInterrupt
        if self.passed < len(self.asked) and process.pid is not None:
            self.passed += 1
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGINT)


class _Talk(NamedTuple):
    ours: Connection
    process: SpawnProcess
    hear: Tell
    listening: type


def _outcome(talk: _Talk, interruption: _Interruption, timeout: float | None) -> Any:  # noqa: ANN401 - what the work returns
    """Hear the process out."""
    until = None if timeout is None else time.monotonic() + timeout
    while until is None or time.monotonic() < until:
        interruption.heed(talk.process)
        wait([talk.ours, talk.process.sentinel], _TICK)
        if not talk.ours.poll():
            if talk.process.exitcode is not None and not talk.ours.poll():
                raise ApartError(_ended(talk.process.exitcode))
            continue
        try:
            told = talk.ours.recv()
        except (EOFError, OSError):
            talk.process.join(_TICK)
            raise ApartError(_ended(talk.process.exitcode)) from None
        if isinstance(told, _Result):
            return told.value
        if isinstance(told, _Failure):
            raise told.error
        interruption.listens = interruption.listens or isinstance(told, talk.listening)
        talk.hear(told)
    raise ApartError(f"took longer than the timeout of {timeout:g} s")


def _ended(code: int | None) -> str:
    if code is None:
        return "the process it ran in closed its connection"
    if code < 0:
        with suppress(ValueError):
            return f"the process it ran in was killed by {signal.Signals(-code).name}"
    return f"the process it ran in ended by itself, with exit code {code}"


@contextmanager
def _ignored() -> Iterator[None]:
    """Signals that ask to stop do nothing in the block, nor in a process that it starts."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _noted() -> Iterator[_Interruption]:
    """Ctrl-C and SIGTERM raise nothing in the block; they are noted, for a process that would not hear of them."""
    found = _Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield found
        return

    def handle(number: int, frame: FrameType | None) -> None:
        found.asked.append(time.monotonic())

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield found
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _begin(
    theirs: Connection, work: Work, arguments: tuple[object, ...], passing: tuple[type[BaseException], ...]
) -> None:
    """What the process does; its end waits for no thread that was started in it."""
    lead()
    multiprocessing.current_process().daemon = False  # whose processes may have none of their own
    own = os.getpid()

    def tell(message: object) -> None:
        if os.getpid() != own:  # somebody has forked, and goes on as if it were us
            os._exit(1)
        theirs.send(message)

    tell(_outcome_of(lambda: work(*arguments, tell), passing))
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    os._exit(0)


def _outcome_of(work: Callable[[], Any], passing: tuple[type[BaseException], ...]) -> _Result | _Failure:
    """What comes of it, as it can be told."""
    try:
        with contained(MemoryError, OSError, *passing):
            return _Result(work())
    except MemoryError:
        return _Failure(ApartError("there is not enough memory"))
    except OSError as error:
        return _Failure(ApartError(f"{error.filename or 'a file'}: {error.strerror or error}"))
    except ForeignError as error:
        return _Failure(ApartError(error.explained))
    except BaseException as error:  # KeyboardInterrupt, or what may pass
        return _Failure(error)
