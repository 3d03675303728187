"""One call of a planner, with its defects and side effects."""

import copy
import os
import pickle
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from planning.contract import reset
from planning.loading import load_planner
from planning.planner import Plan, Planner, Situation
from planning.returned_plans import proposed_plans, usable_plan
from tracking.numerics.arrays import Array
from tracking.plugins.findings import find_change
from tracking.plugins.plugin_error import PluginError, plugin_call

SEED = 5  # with which stateful planners are reset
_CHILD = """
import pickle, sys
sys.path[:] = pickle.loads(sys.stdin.buffer.read(int(sys.stdin.buffer.readline())))
from planning.conformance.calls import answer
answer(sys.argv[1])
"""


@dataclass(frozen=True, eq=False)
class Attempt:
    """Plans for a team, with their defects."""

    plans: Sequence[Plan]  # as returned
    copies: tuple[Plan, ...]  # of all plans; with the defect "plans", of those before the first that is no plan
    defects: Mapping[str, str]  # by kind: "plans", "finite", "speed"
    touched: str = ""  # change that the planner made to the situations, in words; empty: none
    drew: str = ""  # modules whose global random numbers the planner used
    seconds: float = 0.0

    @property
    def altered(self) -> bool:
        """True if plans changed after they were returned."""
        if "plans" in self.defects:
            return False
        try:
            with plugin_call():
                after = [usable_plan(plan, finite=False) for plan in self.plans]
        except PluginError:
            return True
        return any(any(differences(now, before)) for now, before in zip(after, self.copies, strict=True))


def attempt(planner: Planner, team: Sequence[Situation], *, world: int = 0, watched: bool = False) -> Attempt:
    """Let a planner plan for a copy of the team, with the same random numbers each time.

    `world` seeds the global random numbers. Changes of the situations are only found if `watched`.
    """
    situations = copy.deepcopy(list(team))
    before = copy.deepcopy(situations) if watched else []
    rng, reason = np.random.default_rng(0), ""
    plans: list[Any] = []
    with _global_chance(world) as drew:
        start = perf_counter()
        try:
            with plugin_call(planner, "plan"):
                plans = proposed_plans(planner.plan(situations, rng), len(team))
        except PluginError as error:
            reason = error.with_place
        seconds = perf_counter() - start
    copies, problems = _copies(planner, plans)
    defects = {"plans": reason or problems} if reason or problems else _defects(copies, team)
    touched = find_change(before, situations, "team") if watched else ""
    return Attempt(plans, copies, defects, touched, " and ".join(drew), seconds)


def attempt_in_other_process(planner: str | bytes, team: Sequence[Situation]) -> Attempt:
    """`attempt` in a new process with another hash seed; the planner is given as text or pickled."""
    path, request = pickle.dumps(sys.path), pickle.dumps((planner, list(team)))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "attempt"
        environment = {**os.environ, "PYTHONHASHSEED": "4711"}
        done = subprocess.run(
            [sys.executable, "-c", _CHILD, str(file)],
            input=b"%d\n" % len(path) + path + request,
            env=environment,
            capture_output=True,
        )
        if done.returncode != 0 or not file.exists():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            return Attempt((), (), {"plans": " ".join(last) or f"the process ends with {done.returncode}"})
        copies, defects = pickle.loads(file.read_bytes())
    return Attempt((), copies, defects)


def answer(path: str) -> None:
    """Write, in the new process, the result of `attempt_in_other_process`."""
    planner, team = pickle.load(sys.stdin.buffer)
    made = load_planner(planner) if isinstance(planner, str) else pickle.loads(planner)
    reset(made, SEED)
    found = attempt(made, team)
    Path(path).write_bytes(pickle.dumps((found.copies, dict(found.defects))))


def differences(a: Plan, b: Plan) -> tuple[float, float]:
    """Largest differences [m/s] of two plans: in the UAV's own controls, and in those expected of other UAVs.

    A difference is infinite if UAVs, shapes or positions of NaN differ.
    """
    same = a.others.keys() == b.others.keys()
    others = max((_difference(a.others[j], b.others[j]) for j in a.others), default=0.0) if same else float("inf")
    return _difference(a.controls, b.controls), others


def _difference(a: Array, b: Array) -> float:
    if a.shape != b.shape or not np.array_equal(np.isnan(a), np.isnan(b)):
        return float("inf")
    return float(np.max(np.abs(np.nan_to_num(a) - np.nan_to_num(b)), initial=0.0))


def _copies(planner: Planner, plans: Sequence[Any]) -> tuple[tuple[Plan, ...], str]:
    """Copies of the plans before the first of a wrong type or shape, and the error of that plan; empty: none."""
    copies: list[Plan] = []
    for k, plan in enumerate(plans):
        try:
            with plugin_call(planner, "plan"):
                copies.append(usable_plan(plan, finite=False))
        except PluginError as error:
            return tuple(copies), f"plan {k}: {error.with_place}"
    return tuple(copies), ""


def _defects(plans: Sequence[Plan], team: Sequence[Situation]) -> dict[str, str]:
    defects: dict[str, str] = {}
    for s, plan in zip(team, plans, strict=True):
        fastest = float(np.max(np.nan_to_num(np.linalg.norm(plan.controls, axis=1), posinf=0.0)))
        if not np.all(np.isfinite(plan.controls)):
            defects.setdefault("finite", f"the plan of UAV {s.own.id} is not finite")
        if fastest > s.own.max_speed * (1 + 1e-6):
            limit = f"{s.own.max_speed:g} m/s is what it can"
            defects.setdefault("speed", f"the plan of UAV {s.own.id} reaches {fastest:.3g} m/s; {limit}")
    return defects


@contextmanager
def _global_chance(seed: int) -> Iterator[list[str]]:
    """Seed the global random numbers, and restore them at the end; yields a list that then names the modules used."""
    before = _global_states()
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - planners must not use these numbers
    start = _global_states()
    drew: list[str] = []
    try:
        yield drew
    finally:
        end = _global_states()
        drew += [name for name in start if start[name] != end[name]]
        random.setstate(before["random"])
        np.random.set_state(before["numpy.random"])  # noqa: NPY002


def _global_states() -> dict[str, Any]:
    numpy: Any = np.random.get_state(legacy=True)  # noqa: NPY002
    return {"random": random.getstate(), "numpy.random": (numpy[0], numpy[1].tolist(), *numpy[2:])}
