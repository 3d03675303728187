"""The interface of planners: situation in, plan out."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from tracking.detection.noise import NoiseModel
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.geometry.camera import Camera, Look
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.plugins.plugin_error import Unusable
from tracking.plugins.result_check import read_numbers
from tracking.track import Track
from tracking.undetected import Intensity

LONGEST_PLAN = 1000  # steps, all of which recordings hold
_MOST_ROUNDS = 1000


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A UAV as its team knows it.

    Attributes:
        id: number of the UAV, from 0.
        position: (3,) m: east, north and up.
        camera: its camera.
        noise: covariance of its measurements by distance.
        max_speed: limit of commanded speeds [m/s].
        attitude: (4,) quaternion xyzw of the camera in level flight; by default it looks down, with north at the
            image's top.
        velocity: (2,) m/s: east and north, as measured.
        lag: time constant [s] with which the velocity follows a command; 0: at once, [Li22] eq. (5).
    """

    id: int
    position: Array
    camera: Camera
    noise: NoiseModel
    max_speed: float
    attitude: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    velocity: Array = field(default_factory=lambda: np.zeros(2))
    lag: float = 0.0


@dataclass(frozen=True, eq=False)
class Plan:
    """Velocity commands of one UAV; the first is flown, the rest is its intent.

    Attributes:
        controls: (H, 2) m/s: east and north, one row for each step of `Situation.step` seconds.
        others: plans (H, 2) m/s, by id, that this UAV expects other UAVs to fly if their own plans do not reach it.
    """

    controls: Array
    others: Mapping[int, Array] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Bytes of the message: sender, time, position, velocity and controls, eight for each number."""
        return 8 * (7 + np.size(self.controls))

    def after(self, steps: int) -> "Plan":
        """The rest of the plan after so many steps, maybe without controls, and without plans of others."""
        return Plan(self.controls[steps:])


@dataclass(frozen=True)
class Exchange:
    """Exchange of plans at each decision: each UAV sends its plan to its neighbours, `rounds` times.

    With a `centre`, the first UAV plans for all UAVs and sends each its plan, over a network without losses.

    Attributes:
        rounds: number of rounds.
        centre: True if the first UAV plans for all.
    """

    rounds: int = 1
    centre: bool = False

    def __post_init__(self) -> None:
        if type(self.rounds) is not int or not 0 <= self.rounds <= _MOST_ROUNDS:
            raise ValueError(f"rounds must be a whole number from 0 to {_MOST_ROUNDS}, is {self.rounds!r}")


@dataclass(frozen=True, eq=False)
class Situation:
    """Knowledge of one UAV when it plans; it holds no ground truth.

    Attributes:
        time: time of the decision [s] since the start.
        own: this UAV.
        neighbours: the UAVs that it hears, by ascending id.
        tracks: tracks of its own tracker.
        forest: known map of trees.
        area: width (east) and height (north) [m] of the area, which is centred on the origin.
        motion: model of the targets over one planning step, with its number of the trackers' scans.
        intents: last known plan of each UAV by id, its own included; it begins one step ago, and older ones are shifted
            to that time.
        reception: for each round of `Exchange`, ids of the UAVs from which a plan of this instant is received; None:
            all neighbours.
        undetected: expected number of undetected people in each cell of the area; None: not estimated.
        looks: cameras and poses of the frames at this decision, its own and those of UAVs that it hears.
        radio_range: distance [m] beyond which UAVs do not hear each other.
    """

    time: float
    own: Vehicle
    neighbours: tuple[Vehicle, ...]
    tracks: tuple[Track, ...]
    forest: Forest
    area: tuple[float, float]
    motion: NearlyConstantVelocity
    intents: Mapping[int, Plan] = field(default_factory=dict)
    reception: tuple[tuple[int, ...], ...] | None = None
    undetected: Intensity | None = None
    looks: tuple[Look, ...] = ()
    radio_range: float = math.inf

    @property
    def step(self) -> float:
        """Time between two controls of a plan [s]."""
        return self.motion.dt

    @cached_property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The whole team as this UAV knows it, by ascending id."""
        return tuple(sorted((self.own, *self.neighbours), key=lambda v: v.id))

    def receives(self, uav: int, sent: int = 0) -> bool:
        """True if this UAV receives the plan that `uav` sends in round `sent`; False after the last round."""
        if self.reception is None:
            return uav in [v.id for v in self.neighbours]
        return sent < len(self.reception) and uav in self.reception[sent]


def limit_speed(controls: Array, max_speeds: Array | float) -> Array:
    """Controls (..., k, H, 2) m/s, each shortened to the speed limit of its UAV (k,) [m/s].

    With one limit for all, controls may have any leading axes.
    """
    speed = length(controls)[..., None]
    most = np.asarray(max_speeds)[..., None, None]
    return np.asarray(controls * np.minimum(1.0, most / np.maximum(speed, 1e-12)))


def check_count(plans: Iterable[object] | None, uavs: int) -> list[object]:
    """List of the plans that a planner returned; `Unusable` if their number is not that of the UAVs."""
    if plans is None:
        raise Unusable(f"None in place of plans for {uavs} UAVs")
    found = list(plans)
    if found and not uavs:
        raise Unusable("none are due between decisions")
    if len(found) != uavs:
        raise Unusable(f"{len(found)} plans for {uavs} UAVs")
    return found


def copy_plan(plan: object) -> Plan:
    """A copy of a plan that a planner returned; `Unusable` if it is no plan of finite numbers."""
    if not hasattr(plan, "controls"):
        raise Unusable(f"it is no Plan but of type {type(plan).__name__}")
    others = getattr(plan, "others", {})
    if not isinstance(others, Mapping):
        raise Unusable("others is no mapping")
    expected = {j: _copy_controls(f"others[{j!r}]", controls) for j, controls in others.items()}
    return Plan(_copy_controls("controls", plan.controls), expected)


def _copy_controls(name: str, given: object) -> Array:
    """A copy of controls (H, 2) m/s; `Unusable` if they have another shape or are not finite."""
    controls = read_numbers(name, given)
    if controls.ndim != 2 or controls.shape[1] != 2 or not 1 <= len(controls) <= LONGEST_PLAN:
        raise Unusable(f"{name} of shape {controls.shape}, not (H, 2) with H from 1 to {LONGEST_PLAN}")
    if not np.all(np.isfinite(controls)):
        raise Unusable(f"{name} are not finite")
    return controls


class Planner(Protocol):
    """Interface of planners: any object with this method is a planner.

    `plan` returns one plan per situation, in the same order. `rng` is its only source of random numbers. A planner
    keeps no state between calls, unless it declares `stateful = True` and has a method `reset(seed)` that clears its
    memory. A mission calls `reset` once, before the first decision; after a reset the same calls give the same plans.
    A UAV that broke down has no situation and is not a neighbour, so ids may differ from indices in `team`.
    The position and velocity of a neighbour out of contact are predicted from its last known plan, until the plan ends.

    Optional attributes: `exchange` is the exchange of plans at a decision, by default `Exchange()`.
    `decentralised = True` claims that the plan of UAV i depends only on `team[i]` and on plans of UAVs j with
    `team[i].receives(j)`; `planning.planner_check` tests this claim and the other rules. A method `knowing` makes the
    planner an oracle: it takes the truth and returns the planner to fly. Results mark oracles (`planning.oracle`).

    Example:
        ```python
        import numpy as np
        from understory import Plan, run

        class East:
            def plan(self, team, rng):
                return [Plan(np.array([[situation.own.max_speed, 0.0]])) for situation in team]

        print(run("forest", East(), settings={"duration": 1, "sensing.mode": "ideal"}))
        ```
    """

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans for all UAVs at this instant."""
