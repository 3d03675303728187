"""Plan check: turns whatever a planner returns into valid plans, with earlier intents in place of faulty plans."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from planning.planner import Plan, Planner, Situation, Vehicle, check_count, copy_plan, limit_speed
from sim.mission.fault import Fault
from tracking.errors import InputError, spell
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Look, Pose
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.plugins.plugin_error import PluginError, plugin_call
from tracking.plugins.result_check import Form
from tracking.track import Track

_VELOCITY = Form((2,))  # what a caller may give in place of a plan


def ask_planner(
    planner: Planner, team: Sequence[Situation], last: Mapping[int, Plan], rng: np.random.Generator
) -> tuple[list[Plan], list[Fault]]:
    """Call the planner with copies of the situations; return one valid plan per situation and the planner's faults.

    A UAV without a valid plan flies the rest of its `last` plan and then hovers. Commands above the speed limit are
    shortened to the limit, which also counts as a fault.
    """
    time = team[0].time
    try:
        with plugin_call(planner, "plan"):
            proposed = check_count(planner.plan([copy_situation(situation) for situation in team], rng), len(team))
    except PluginError as error:
        fault = Fault(time, None, str(error), error.trace, fails_decision=True)
        return [_shift(last.get(s.own.id)) for s in team], [fault]
    plans, faults = [], []
    for situation, given in zip(team, proposed, strict=True):
        try:
            with plugin_call(planner, "plan"):
                plan = copy_plan(given)
        except PluginError as error:
            plans.append(_shift(last.get(situation.own.id)))
            faults.append(Fault(time, situation.own.id, str(error), error.trace, fails_decision=True))
            continue
        plans.append(_limit(plan, situation, faults))
    return plans, faults


def check_plans(given: Iterable[Plan | Array], team: Sequence[Situation]) -> tuple[list[Plan], list[Fault]]:
    """One valid plan per situation from a caller's plans or velocities (2,) m/s, and a fault for each excess speed.

    InputError names what cannot be used.
    """
    plans: list[Plan] = []
    faults: list[Fault] = []
    try:
        with plugin_call():
            proposed = check_count(given, len(team))
    except PluginError as error:
        expected = f"; expected a plan or a velocity (2,) for each of {len(team)} UAVs" if team else ""
        raise InputError(f"plans: {error}{expected}") from error
    for situation, each in zip(team, proposed, strict=True):
        try:
            with plugin_call():
                plan = copy_plan(each) if hasattr(each, "controls") else _read_velocity(each)
        except PluginError as error:
            raise InputError(f"plans: of UAV {situation.own.id}: {error}") from error
        plans.append(_limit(plan, situation, faults))
    return plans, faults


def _read_velocity(given: object) -> Plan:
    """A plan of one step with a velocity (2,) m/s."""
    return Plan(_VELOCITY.check("velocity components", given)[None])


def _limit(plan: Plan, situation: Situation, faults: list[Fault]) -> Plan:
    """The plan, shortened to the UAV's speed limit; a speed above the limit adds a fault."""
    own, controls = situation.own, plan.controls
    with np.errstate(over="ignore"):  # squares of huge, though finite, speeds overflow
        fastest = length(controls).max()
        limited = plan if fastest <= own.max_speed else Plan(limit_speed(controls, own.max_speed), plan.others)
    if fastest > own.max_speed * (1 + 1e-6):
        text = f"speed {spell(fastest, 3)} m/s exceeds {own.max_speed:g} m/s; clipped"
        faults.append(Fault(situation.time, own.id, text))
    return limited


def copy_situation(situation: Situation) -> Situation:
    """A copy that a planner may change. Map, cameras and motion model are not copied: only planners use them."""
    undetected = situation.undetected
    return replace(
        situation,
        own=_copy_vehicle(situation.own),
        neighbours=tuple(map(_copy_vehicle, situation.neighbours)),
        tracks=tuple(map(_copy_track, situation.tracks)),
        intents={i: _copy_intent(plan) for i, plan in situation.intents.items()},
        undetected=None if undetected is None else replace(undetected, people=undetected.people.copy()),
        looks=tuple(
            Look(camera, Pose(pose.position.copy(), pose.quaternion.copy())) for camera, pose in situation.looks
        ),
    )


def _copy_vehicle(vehicle: Vehicle) -> Vehicle:
    position, attitude, velocity = map(np.copy, (vehicle.position, vehicle.attitude, vehicle.velocity))
    return replace(vehicle, position=position, attitude=attitude, velocity=velocity)


def _copy_track(track: Track) -> Track:
    belief = Gaussian(track.belief.mean.copy(), track.belief.covariance.copy())
    return Track(track.id, belief, track.existence, track.sighting.copy())


def _copy_intent(plan: Plan) -> Plan:
    return Plan(plan.controls.copy(), {j: controls.copy() for j, controls in plan.others.items()})


def _shift(plan: Plan | None) -> Plan:
    """The rest of a plan after its first control; a hovering step if nothing is left."""
    rest = None if plan is None else plan.after(1)
    return rest if rest and len(rest.controls) else Plan(np.zeros((1, 2)))
