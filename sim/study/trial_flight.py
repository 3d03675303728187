"""One trial of a study flown, from a `StudyTrial` to its row, both of which can be pickled."""

import math
import time
import zlib
from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from sim.facts.metrics.catalogue import evaluate
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import describe_machine
from sim.mission.archive import compute_digest, encode
from sim.mission.trial import Trial
from sim.mission.warmup import warm_up
from sim.running.fly import fly
from sim.scenario.loading import place_of
from sim.study.trials import StudyTrial, TrialRow, get_release
from tracking.plugins.plugin_error import PluginError, plugin_call


class TrialResult(Struct, frozen=True):
    """A trial that has ended: its row, and the content of its recording's file if that is to be kept."""

    row: TrialRow
    recording: bytes = b""


def fly_trial(trial: StudyTrial, *, keep: bool = False, timeout: float | None = None) -> TrialResult:
    """Fly a trial. Any exception becomes the error of a failed row, because not all exceptions can be pickled.

    keep: True to return the recording, too. timeout: wall time [s], without compilation, after which the trial fails.
    """
    try:
        if get_release() != trial.version:
            raise RuntimeError(f"understory is {get_release()} here, not {trial.version}")
        warm_up()  # so that the first trial takes as long as the others
        with plugin_call():
            return _fly(trial, keep, timeout)
    except PluginError as error:
        return make_failure(trial, error.with_place)
    except Exception as error:
        return make_failure(trial, f"{type(error).__name__}: {error}")


def make_failure(trial: StudyTrial, error: str) -> TrialResult:
    """A trial without a result, with the reason."""
    return TrialResult(TrialRow(**trial.place, status="failed", error=" ".join(error.split())))


def _fly(trial: StudyTrial, keep: bool, timeout: float | None) -> TrialResult:
    start = time.perf_counter()
    place = place_of(trial.scenario, trial.settings)
    flying = fly(Trial(trial.setting, trial.planner, trial.seed, trial.repeat, place))
    ospa = []
    for snapshot in flying:
        ospa.append(snapshot.error)
        if timeout is not None and time.perf_counter() - start > timeout:
            raise TimeoutError(f"took longer than the timeout of {timeout:g} s")
    outcome = flying.land()
    recording = outcome.recording
    row = TrialRow(
        **trial.place,
        status="done",
        metrics=_list_metrics(outcome, trial.metrics),
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
        "world": zlib.crc32(outcome.recording.trees.tobytes() + outcome.recording.people.tobytes()),
        **{f"seconds.{stage}": value for stage, value in outcome.seconds.items()},
    }
    return {name: math.nan if value is None else float(value) for name, value in values.items()}
