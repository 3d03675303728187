"""A process beside this one, to which values are sent while this one works on."""

import gc
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from importlib import import_module
from typing import Any, BinaryIO

from sim.installation import ROOT
from sim.processes.exits import describe_exit
from sim.processes.garbage import no_collection

_MOST = 32_000_000  # bytes on their way; then `send` waits
_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from sim.processes.companion import serve; serve(sys.argv[2])"
)


class CompanionLost(Exception):
    """The companion died; the text says how: "was killed by SIGKILL"."""


class Companion(AbstractContextManager["Companion"]):
    """A process that calls a function of ours with an iterator of the values that it is sent.

    It imports the function's module at once, while this process does something else. It leaves Ctrl-C to this process,
    and ends with it. It runs no user's script again, so a script needs no `if __name__ == "__main__":`.
    """

    def __init__(self, function: str) -> None:
        """Start the process; function: "module:name"."""
        command = [sys.executable, "-c", _START, json.dumps([str(ROOT), *sys.path]), function]
        # The process inherits the blocked signal, so Ctrl-C does no harm until it is ignored.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self.pid = self._process.pid
        self._changed = threading.Condition()
        self._messages: deque[bytes] = deque()
        self._size = 0  # bytes of the messages, with the one that is being written
        self._closed = False  # the process reads no more
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()

    def send(self, value: object) -> None:
        """Send a value as it is now; the exception that ended the function, or CompanionLost, if it has ended."""
        message = pickle.dumps(value, protocol=5)
        with self._changed:
            self._changed.wait_for(lambda: self._size < _MOST or self._closed)
            self._messages.append(message)
            self._size += len(message)
            self._changed.notify_all()
        if self._closed:
            self._read_answer()

    def end(self) -> None:
        """Say that there are no more values; exceptions as those of `send`."""
        self.send(_END)

    def result(self) -> Any:  # noqa: ANN401 - whatever the function returns
        """What the function returns after the end of the values; exceptions as those of `send`."""
        return self._read_answer()

    def __exit__(self, *error: object) -> None:
        self._process.kill()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._process.wait()
        self._writer.join()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                _close(pipe)

    def _write(self) -> None:
        """Write messages to the process, until it reads no more."""
        assert self._process.stdin is not None
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._messages or self._closed)
                if self._closed:
                    return
                message = self._messages.popleft()
            try:
                self._process.stdin.write(message)
                self._process.stdin.flush()
            except OSError:
                self._closed = True
            with self._changed:
                self._size -= len(message)
                self._changed.notify_all()

    def _read_answer(self) -> Any:  # noqa: ANN401 - as `result`
        assert self._process.stdout is not None
        try:
            result, error = pickle.load(self._process.stdout)
        except (EOFError, pickle.UnpicklingError):
            raise CompanionLost(describe_exit(self._process.wait())) from None
        if error is not None:
            raise error
        return result


class _End:
    """Follows the last value."""


_END = _End()


def _close(pipe: Any) -> None:  # noqa: ANN401
    try:
        pipe.close()
    except OSError:  # what it could not write is lost, as is its reader
        pass


def serve(function: str) -> None:
    """Call a function "module:name" with the values that are sent, and send back what it returns or raises."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what libraries print is no answer
    module, _, name = function.partition(":")
    answer: tuple[Any, Exception | None]
    try:
        with no_collection():
            call: Callable[[Iterator[Any]], Any] = getattr(import_module(module), name)
            gc.freeze()
        answer = call(_receive(sys.stdin.buffer)), None
    except Exception as error:
        answer = None, _make_portable(error)
    pickle.dump(answer, answers)
    answers.close()
    os._exit(0)  # nothing is left to do


def _receive(source: BinaryIO) -> Iterator[Any]:
    """The values that are sent, without the end; the process ends if the other one has."""
    while True:
        try:
            value = pickle.load(source)
        except EOFError:
            os._exit(1)
        if isinstance(value, _End):
            return
        yield value


def _make_portable(error: Exception) -> Exception:
    """The exception, or one with its text that can be pickled."""
    if isinstance(error, OSError):
        return OSError(error.errno, error.strerror, error.filename)
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
