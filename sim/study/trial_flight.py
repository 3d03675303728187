"""One trial of a study: the function that flies it, from a task to a row, both of which can be pickled."""

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from msgspec import Struct

from sim.facts.metrics.catalogue import evaluate
from sim.facts.metrics.machine import describe_machine
from sim.facts.metrics.metric import Outcome
from sim.mission.archive import compute_digest, encode
from sim.mission.trial import Trial
from sim.mission.warmup import warm_up
from sim.running.fly import fly
from sim.scenario.loading import place_of
from sim.study.tasks import Row, Task, get_release
from tracking.plugins.plugin_error import PluginError, plugin_call


class TrialResult(Struct, frozen=True):
    """A trial that has ended: its row, and the content of its recording's file if that is to be kept."""

    row: Row
    recording: bytes = b""


def fly_trial(
    task: Task, *, keep: bool = False, timeout: float | None = None, begun: Callable[[], object] = lambda: None
) -> TrialResult:
    """Fly a trial. Any exception becomes the error of a failed row, because not all exceptions can be pickled.

    keep: True to return the recording, too. timeout: wall time [s], without compilation, after which the trial fails.
    begun: called when this time starts.
    """
    try:
        if get_release() != task.version:
            raise RuntimeError(f"understory is {get_release()} here, not {task.version}")
        warm_up()  # so that the first trial takes as long as the others
        begun()
        with plugin_call():
            return _fly(task, keep, timeout)
    except PluginError as error:
        return make_failure(task, error.with_place)
    except Exception as error:
        return make_failure(task, f"{type(error).__name__}: {error}")


def make_failure(task: Task, error: str) -> TrialResult:
    """A trial without a result, with the reason."""
    return TrialResult(Row(**task.shared, status="failed", error=" ".join(error.split())))


def _fly(task: Task, keep: bool, timeout: float | None) -> TrialResult:
    start = time.perf_counter()
    trial = Trial(task.setting, task.planner, task.seed, task.repeat, place_of(task.scenario, task.settings))
    flying = fly(trial)
    ospa = []
    for snapshot in flying:
        ospa.append(snapshot.error)
        if timeout is not None and time.perf_counter() - start > timeout:
            raise TimeoutError(f"took longer than the timeout of {timeout:g} s")
    outcome = flying.land()
    recording = outcome.recording
    row = Row(
        **task.shared,
        status="done",
        metrics=_list_metrics(outcome, task.metrics),
        ospa=np.array(ospa, dtype=np.float32),
        times=recording.times,
        recording=compute_digest(recording),
        machine=", ".join(describe_machine().values()),
    )
    return TrialResult(row, encode(recording) if keep else b"")


def _list_metrics(outcome: Outcome, asked: Sequence[str]) -> dict[str, float]:
    """The metrics of a row and the time of every stage; NaN if there was nothing to count."""
    values = {
        **evaluate(outcome, asked),
        "sees_truth": outcome.recording.sees_truth,
        **{f"seconds.{stage}": value for stage, value in outcome.seconds.items()},
    }
    return {name: math.nan if value is None else float(value) for name, value in values.items()}
