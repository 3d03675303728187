"""One trial, from values that can be pickled to a row."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct

from sim.evaluation.machine import machine_line
from sim.evaluation.summary import summarise
from sim.mission.mission import Mission, Trial
from sim.mission.warmup import warm_up
from sim.recording.archive import save
from sim.recording.recording import Recorder, Recording
from sim.scenario.scenario import resolved
from sim.study.row import Row
from sim.study.tasks import Task, release
from tracking.plugins.containment import ForeignError, contained


class Flown(Struct, frozen=True):
    """A trial that has ended: its row, and its recording as a file's content if that is to be kept."""

    row: Row
    recording: bytes = b""


def fly(task: Task, *, keep: bool = False, timeout: float | None = None) -> Flown:
    """Fly a trial. Whatever it raises is the error of a failed row, since not every exception survives pickling.

    keep: whether the recording comes back too; timeout: wall time [s] beyond which the trial has failed.
    """
    try:
        if release() != task.version:
            raise RuntimeError(f"understory is {release()} here, not {task.version}")
        warm()
        with contained():
            return _flown(task, keep, timeout)
    except ForeignError as error:
        return failed(task, str(error))
    except Exception as error:
        return failed(task, f"{type(error).__name__}: {error}")


def failed(task: Task, error: str) -> Flown:
    """A trial without a result, and why."""
    nothing = np.zeros(0)
    return Flown(
        _row(task, status="failed", error=" ".join(error.split()), ospa=nothing.astype(np.float32), times=nothing)
    )


@cache
def warm() -> float:
    """Load compiled code once in each process, so that the first trial's times are those of the others."""
    return warm_up()


def _flown(task: Task, keep: bool, timeout: float | None) -> Flown:
    start = time.perf_counter()
    mission = Mission.of(Trial(task.setting, task.planner, task.seed, task.repeat))
    start_up = time.perf_counter() - start
    recorder, ospa = Recorder(task.repeat), []
    for snapshot in mission.fly():
        recorder.add(snapshot)
        ospa.append(snapshot.error)
        if timeout is not None and time.perf_counter() - start > timeout:
            raise TimeoutError(f"took longer than the timeout of {timeout:g} s")
    wall = time.perf_counter() - start
    recording = recorder.recording(
        scenario=resolved(task.setting),
        planner=task.planner,
        seed=task.seed,
        forest=mission.forest,
        sees_truth=mission.sees_truth,
    )
    seconds = {**mission.clock.seconds, "start_up": start_up}
    summary = summarise(recording, seconds=seconds, wall_s=wall, faults=mission.faults, versions={})
    row = _row(
        task,
        status="done",
        metrics=metrics(summary, decisions=len(recording.plan_times)),
        ospa=np.array(ospa, dtype=np.float32),
        times=recording.times,
        recording=summary["recording_sha256"],
        machine=machine_line(),
    )
    return Flown(row, _content(recording) if keep else b"")


def metrics(summary: Mapping[str, Any], *, decisions: int) -> dict[str, float]:
    """The numbers of a `summary.json` by flat names, NaN where it has null; docs/how-to/studies.md lists them."""
    spent, identity, network = summary["seconds"], summary["identity"], summary["network"]
    values = {
        **{f"ospa.{name}": value for name, value in summary["ospa"].items()},
        **{f"gospa.{name}": summary["gospa"][name] for name in ("mean_m", "localisation_m", "missed", "false")},
        "ospa2_m": summary["ospa2_m"],
        "identity_switches": identity["switches"],
        "fragmentations": identity["fragmentations"],
        "share_held": summary["share_held"],
        "nees.position": summary["nees"]["position"]["mean"],
        "nees.state": summary["nees"]["state"]["mean"],
        "recall": summary["detection"]["recall"],
        "precision": summary["detection"]["precision"],
        **{name: network[name] for name in ("bytes_total", "bytes_per_scan_mean", "bytes_per_scan_max")},
        "plan_bytes_total": network["plans"]["bytes_total"],
        "plan_rounds": network["plans"]["rounds"],
        "disagreement_m": network["disagreement_m"],
        "sees_truth": summary["sees_truth"],
        "faults": len(summary["faults"]),
        "contacts": len(summary["contacts"]),
        "planning_s_per_decision": spent["planning"] / decisions if decisions else None,
        "real_time_factor": summary["real_time_factor"],
        "wall_s": summary["wall_s"],
        **{f"seconds.{stage}": value for stage, value in spent.items()},
    }
    return {name: math.nan if value is None else float(value) for name, value in values.items()}


def _row(task: Task, **results: Any) -> Row:  # noqa: ANN401 - the row's fields say
    return Row(
        study=task.study,
        scenario=task.scenario,
        factors=task.factors,
        planner=task.planner,
        seed=task.seed,
        repeat=task.repeat,
        version=task.version,
        settings=task.settings,
        **{"metrics": {}, **results},
    )


def _content(recording: Recording) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mission.npz"
        save(recording, path)
        return path.read_bytes()
