"""Check of a planner by the rules of `planning.planner.Planner`, in made-up situations, without a mission."""

import math
import pickle
import random
import timeit
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial

import numpy as np

from planning.planner import Plan, Planner, Situation, check_count, copy_plan
from planning.planner_loading import load_planner, make_planner, read_exchange, reset_planner
from planning.testing.made_up_teams import break_contact, keep_contact, lose_plans, make_flying_team, slow_down
from tracking.errors import InputError, spell
from tracking.geometry.visibility import Forest
from tracking.plugins.findings import Finding, Untried, describe_time, require, require_untouched, try_checks
from tracking.plugins.plugin_error import PluginError, plugin_call

Maker = Callable[[], Planner]
TEAM, OTHER = make_flying_team(), make_flying_team(1)
_SEED = 5  # with which stateful planners are reset
_ROUNDING = 1e-9  # m/s; smaller differences of plans count as rounding


def check_planner(planner: str | Maker) -> list[Finding]:
    """Findings of all checks of a planner, which conforms if no finding has `passed` False.

    planner: text for `planning.planner_loading.load_planner`, or a class or function that makes planners. A planner
    object does not do, because the checks need several. InputError if there is no such planner.
    """
    if not isinstance(planner, str) and not callable(planner):
        raise InputError(f"planner: {planner!r} is an object; expected text, or a class or function that makes one")

    def make() -> Planner:
        """A new planner, reset with a seed if it is stateful."""
        name = getattr(planner, "__qualname__", type(planner).__qualname__)
        made = load_planner(planner) if isinstance(planner, str) else make_planner(planner, name, {})
        reset_planner(made, _SEED)
        return made

    make()
    return try_checks(make, CHECKS, dict.fromkeys(("memory", "pickling", "decentralised"), "same seed, same plan"))


def _call(planner: Planner, team: list[Situation]) -> list[Plan]:
    """A planner's plans for a team, always with the same random numbers; PluginError if they cannot be used."""
    with plugin_call(planner, "plan"):
        plans = check_count(planner.plan(team, np.random.default_rng(0)), len(team))
        return [copy_plan(plan) for plan in plans]


def _plan(planner: Planner, team: Sequence[Situation]) -> list[Plan]:
    return _call(planner, deepcopy(list(team)))


def _measure_difference(one: Plan, other: Plan) -> float:
    """Largest difference [m/s] of two plans and of what they expect of other UAVs; infinite if shapes differ."""
    if one.others.keys() != other.others.keys():
        return math.inf
    pairs = [(one.controls, other.controls), *((one.others[j], other.others[j]) for j in one.others)]
    return max(float(np.abs(a - b).max()) if a.shape == b.shape else math.inf for a, b in pairs)


def _compare(before: Sequence[Plan], after: Sequence[Plan], when: str) -> None:
    """Raise ValueError if plans differ."""
    gap = max(map(_measure_difference, before, after))
    require(gap == 0.0, f"{when}, plans differ by {spell(gap, 3)} m/s")


def _check_plans(make: Maker) -> str:
    steps = {len(plan.controls) for plan in _plan(make(), TEAM)}
    return f"one (H, 2) of finite numbers for each UAV, H = {' or '.join(map(str, sorted(steps)))}"


def _check_speed(make: Maker) -> str:
    for s, plan in zip(TEAM, _plan(make(), TEAM), strict=True):
        fastest = float(np.linalg.norm(plan.controls, axis=1).max())
        told = f"the plan of UAV {s.own.id} reaches {spell(fastest, 3)} m/s; {s.own.max_speed:g} m/s is what it can"
        require(fastest <= s.own.max_speed * (1 + 1e-6), told)
    return f"top speeds of {', '.join(f'{s.own.max_speed:g}' for s in TEAM)} m/s are kept"


def _check_inputs(make: Maker) -> str:
    team = deepcopy(TEAM)
    _call(make(), team)
    require_untouched(TEAM, team, "team")
    return "the situations are as they were"


def _check_repetition(make: Maker) -> str:
    before = pickle.dumps((random.getstate(), np.random.get_state()))  # noqa: NPY002 - planners must not use these
    plans = _plan(make(), TEAM)
    after = pickle.dumps((random.getstate(), np.random.get_state()))  # noqa: NPY002
    require(after == before, "it uses global random numbers; only those of `rng` repeat")
    _compare(plans, _plan(make(), TEAM), "of another instance")
    return "equal bit for bit, on another instance"


def _check_memory(make: Maker) -> str:
    """Check that a planner has no memory or, if it is stateful, that `reset` clears its memory."""
    planner, calls = make(), (TEAM, OTHER, TEAM)
    before = [_plan(planner, team) for team in calls]
    if not getattr(planner, "stateful", False):
        _compare(before[0], before[-1], "without stateful = True, but after another situation")
        return "a situation, another one, the first again: equal"
    reset_planner(planner, _SEED)
    for k, team in enumerate(calls):
        _compare(before[k], _plan(planner, team), f"in call {k + 1} after reset(seed) with the same seed and calls")
    return "stateful: after reset(seed) the same calls give the same plans"


def _check_pickling(make: Maker) -> str:
    planner = make()
    kind = type(planner)
    try:
        pickle.dumps(kind)
    except (pickle.PicklingError, AttributeError) as error:
        where = "a function" if "<locals>" in kind.__qualname__ else kind.__module__
        raise Untried(f"its class is defined in {where}, where pickle does not find it") from error
    _plan(planner, TEAM)
    copied = pickle.loads(pickle.dumps(planner))
    _compare(_plan(planner, TEAM), _plan(copied, TEAM), "of a pickled copy")
    return "a copy plans the same"


def _check_claim(make: Maker) -> str:
    """Check that knowledge of a UAV reaches the others only through its plan, if the planner claims this."""
    if not getattr(make(), "decentralised", False):
        raise Untried("it does not claim to be decentralised")
    rounds = max(read_exchange(make()).rounds, 1)
    for s in TEAM:
        uav, others = s.own.id, {v.id for v in s.neighbours}
        for vary, changed, when in (
            (partial(break_contact, uav=uav), others, f"UAV {uav} is out of contact, but what others know"),
            (partial(slow_down, uav=uav), {uav}, f"UAV {uav} cannot move, but what it knows"),
            (partial(lose_plans, uav=uav, rounds=rounds), {uav}, f"UAV {uav}'s plan is lost, but what it knows"),
        ):
            team, other = vary(TEAM), vary([replace(o, forest=s.forest) for o in OTHER])
            mixed = [two if one.own.id in changed else one for one, two in zip(team, other, strict=True)]
            try:
                plans = zip(team, _plan_late(make(), team), _plan_late(make(), mixed), strict=True)
            except PluginError as error:
                raise Untried(f"without contact it does not plan: {error.with_place}") from error
            for o, before, after in plans:
                gap = _measure_difference(before, after)
                told = f"{when} changes the plan of UAV {o.own.id} by {spell(gap, 3)} m/s"
                require(o.own.id in changed or gap <= _ROUNDING, told)
    return "what a UAV knows reaches others through its plan alone"


def _plan_late(planner: Planner, team: Sequence[Situation]) -> list[Plan]:
    """Plans for a team, in the second decision if the planner is stateful."""
    if getattr(planner, "stateful", False):
        _plan(planner, team)
    return _plan(planner, team)


def _check_situation(team: Sequence[Situation], make: Maker) -> str:
    _plan(make(), team)
    return "it plans"


def _check_time(make: Maker) -> str:
    seconds = timeit.repeat(partial(_call, make(), deepcopy(TEAM)), repeat=6, number=1)[1:]
    scene = f"{len(TEAM)} UAVs, {len(TEAM[0].tracks)} tracks, {len(TEAM[0].forest.trees)} trees"
    return describe_time(seconds, f"a decision of {scene}", TEAM[0].step, "a step of its plan")


CHECKS: dict[str, Callable[[Maker], str]] = {
    "plans": _check_plans,
    "speed limit": _check_speed,
    "inputs untouched": _check_inputs,
    "same seed, same plan": _check_repetition,
    "memory": _check_memory,
    "pickling": _check_pickling,
    "decentralised": _check_claim,
    "one UAV": partial(_check_situation, [keep_contact(TEAM[0], {0})]),
    "no tracks": partial(_check_situation, [replace(s, tracks=()) for s in TEAM]),
    "no trees": partial(_check_situation, [replace(s, forest=Forest(())) for s in TEAM]),
    "a UAV broken down": partial(_check_situation, [keep_contact(s, {0, 2}) for s in TEAM[::2]]),
    "out of contact": partial(_check_situation, [keep_contact(s, {s.own.id}) for s in TEAM]),
    "first decision": partial(_check_situation, [replace(s, time=0.0, intents={}) for s in TEAM]),
    "fifty tracks": partial(_check_situation, make_flying_team(targets=50)),
    "time": _check_time,
}
