"""Work in a separate process and session, which can be killed if it hangs."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Any, NamedTuple

from sim.processes.signals import stop_signals
from tracking.errors import InputError
from tracking.plugins.plugin_error import PluginError, plugin_call


def lead_session() -> None:
    """Make this process the leader of a session, with its later children, that ends with the parent process.

    Otherwise the children of a killed parent would wait for it forever.
    """
    os.setsid()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def kill_session(process: BaseProcess) -> None:
    """Kill a process, if it was started, and its session; children in other sessions or groups survive."""
    if process.pid is None:
        return
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os.killpg(os.getpid(), signal.SIGKILL)


_GRACE = 5.0  # s until a second Ctrl-C ends the process
_TICK = 0.2  # s
_CONTEXT = multiprocessing.get_context("spawn")

Tell = Callable[[object], None]
Work = Callable[..., Any]


class IsolationError(RuntimeError):
    """The process ended without a result; the message is one line."""


class _End(NamedTuple):
    """The last message of a process: the result of its work, or an error."""

    result: Any = None
    error: BaseException | None = None


def run_isolated(work: Work, *arguments: object, hear: Tell, listening: type, timeout: float | None) -> Any:  # noqa: ANN401 - what `work` returns
    """Run `work(*arguments, tell)` in a new process, return its result, and kill the process with all its children.

    work: a function of a module; its arguments and its result must be picklable. Each message given to `tell` in the
    process is given to `hear` here. InputErrors and KeyboardInterrupt are raised here; any other exception, an early
    end of the process, or the `timeout` [s] raises IsolationError. Until the process has sent a message of the class
    `listening`, Ctrl-C and SIGTERM end it; later they are passed on to it, and the second one ends it after a while.
    """
    ours, theirs = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_begin, args=(theirs, work, arguments), daemon=True)
    interruption = _Interruption()
    with stop_signals(interruption.note):  # signals do not interrupt the block, so that the process is always ended
        try:
            with stop_signals(signal.SIG_IGN):  # inherited by the process until it installs a handler
                process.start()
            theirs.close()
            return _outcome(ours, process, hear, listening, interruption, timeout)
        finally:
            kill_session(process)
            if process.pid is not None:
                process.join()
            process.close()
            ours.close()


class _Interruption:
    """Times [s] of the user's requests to stop, and the number of requests passed on to the process."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.listens, self.passed = False, 0

    def note(self, number: int, frame: FrameType | None) -> None:
        self.asked.append(time.monotonic())

    def heed(self, process: SpawnProcess) -> None:
        """Pass each request on to the process once; KeyboardInterrupt if the process must be ended."""
        if self.asked and not self.listens:
            raise KeyboardInterrupt
        if len(self.asked) > 1 and time.monotonic() - self.asked[1] > _GRACE:
            raise KeyboardInterrupt
        if self.passed < len(self.asked) and process.pid is not None:
            self.passed += 1
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGINT)


def _outcome(
    ours: Connection,
    process: SpawnProcess,
    hear: Tell,
    listening: type,
    interruption: _Interruption,
    timeout: float | None,
) -> Any:  # noqa: ANN401 - what the work returns
    """Receive messages until the result arrives, and return it."""
    until = None if timeout is None else time.monotonic() + timeout
    while until is None or time.monotonic() < until:
        interruption.heed(process)
        wait([ours, process.sentinel], _TICK)
        if not ours.poll():
            if process.exitcode is not None and not ours.poll():
                raise IsolationError(_ended(process.exitcode))
            continue
        try:
            received = ours.recv()
        except (EOFError, OSError):
            process.join(_TICK)
            raise IsolationError(_ended(process.exitcode)) from None
        if isinstance(received, _End):
            if received.error is not None:
                raise received.error
            return received.result
        interruption.listens = interruption.listens or isinstance(received, listening)
        hear(received)
    raise IsolationError(f"took longer than the timeout of {timeout:g} s")


def _ended(code: int | None) -> str:
    if code is None:
        return "the process it ran in closed its connection"
    if code < 0:
        with suppress(ValueError):
            return f"the process it ran in was killed by {signal.Signals(-code).name}"
    return f"the process it ran in ended by itself, with exit code {code}"


def _begin(theirs: Connection, work: Work, arguments: tuple[object, ...]) -> None:
    """Main function of the process, whose end does not wait for threads."""
    lead_session()
    multiprocessing.current_process().daemon = False  # daemons may not start processes
    own = os.getpid()

    def tell(message: object) -> None:
        if os.getpid() != own:  # a forked child of the work that also returned here
            os._exit(1)
        theirs.send(message)

    tell(_outcome_of(lambda: work(*arguments, tell)))
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    os._exit(0)


def _outcome_of(work: Callable[[], Any]) -> _End:
    """Result or failure of the work, as a message."""
    try:
        with plugin_call(passing=(MemoryError, OSError, InputError)):
            return _End(work())
    except MemoryError:
        return _End(error=IsolationError("there is not enough memory"))
    except OSError as error:
        return _End(error=IsolationError(f"{error.filename or 'a file'}: {error.strerror or error}"))
    except PluginError as error:
        return _End(error=IsolationError(error.with_place))
    except BaseException as error:  # includes KeyboardInterrupt and InputError
        return _End(error=error)
