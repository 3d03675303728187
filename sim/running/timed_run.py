"""A mission with a limit of wall time: it flies in a process of its own, which can be ended if its planner hangs."""

import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, NamedTuple

from sim.mission.atomic_files import make_new_folder
from sim.mission.trial import Progress, Say, ScanProgress, Trial
from sim.mission.warmup import announce_compilation, warm_up
from sim.processes.workers import CONTEXT, LOST, start_workers
from sim.running.beside import start_painter
from sim.running.folder import Results
from sim.running.results import fly_into, stop_request, take_off
from tracking.errors import InputError
from tracking.plugins.plugin_error import PluginError, plugin_call

_TICK = 0.1  # s


def run_with_timeout(
    trial: Trial,
    out: Path,
    timeout: float,
    *,
    video: bool = True,
    metrics: Sequence[str] = (),
    progress: Progress = lambda moment: None,
    say: Say = lambda text: None,
) -> dict[str, Any]:
    """Fly a mission like `run_mission`, but in another process, for at most `timeout` s without compilation.

    PluginError if it takes longer, raises another exception or ends its process.
    """
    ours, theirs = CONTEXT.Pipe(duplex=False)
    stop, asked = CONTEXT.Event(), threading.Event()
    last: ScanProgress | None = None
    with (
        make_new_folder(out) as folder,
        start_workers(1, _prepare, theirs, stop) as workers,
        ExitStack() as in_flight,
    ):
        results = Results(folder.absolute(), out, video, tuple(metrics))
        future = workers.submit(partial(_fly, trial, results), timeout)
        while not future.done() or ours.poll():
            if asked.is_set():
                stop.set()
            if not ours.poll(_TICK):
                continue
            message = ours.recv()
            if isinstance(message, str):
                say(message)
                continue
            if isinstance(message, ScanProgress):
                if last is None:
                    asked = in_flight.enter_context(stop_request())
                last = message
            progress(message)
        error = future.exception()
        if error is None:
            return future.result()
        if isinstance(error, LOST):
            when = f"at {last.time:.1f} s" if last else "before its first scan was complete"
            raise PluginError(f"the mission ended {when}: {error}")
        raise error


class _Parent(NamedTuple):
    """What connects the flying process with the one that shows its progress."""

    messages: Connection
    stop: Event  # set there when the user asks to stop


_parent: _Parent


def _prepare(messages: Connection, stop: Event) -> None:
    """Prepare the process that flies."""
    global _parent
    _parent = _Parent(messages, stop)
    announce_compilation(messages.send, messages.send)(warm_up)()


def _fly(trial: Trial, results: Results) -> dict[str, Any]:
    """Fly in the process; exceptions of plug-ins become PluginErrors, because not all exceptions can be pickled."""
    begun, tell = time.perf_counter(), _parent.messages.send
    with (
        start_painter() as painter,
        plugin_call(passing=(InputError,)),
        take_off(results, trial, begun, tell, tell) as flying,
    ):
        return fly_into(results, flying, painter, _parent.stop.is_set, tell, tell)
