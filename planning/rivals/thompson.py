"""Search and tracking by Thompson sampling: each UAV flies to the best place in a world drawn from its beliefs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from planning.options import Range, check_options
from planning.planner import Exchange, Plan, Situation, limit_speed
from planning.prediction.field_of_view import IMAGE_POINTS, points_shown, view_quadrangle
from planning.prediction.propagation import draw_deviations
from planning.prediction.quadrangle import inside
from tracking.geometry.leaf_gaps import middle_detectability
from tracking.geometry.line_of_sight import Grid
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.poisson import draw_poisson
from tracking.track import beliefs_of


class DrawnWorld(NamedTuple):
    """People drawn from beliefs, as if they were the truth."""

    states: Array  # (M, 4): x, y [m] and velocity [m/s]
    errors: Array  # (M, 4): state less the track's mean, infinite for undetected people


class _Reach(NamedTuple):
    """How a UAV flies to places."""

    start: Array  # (3,) m
    reach: float  # m in a step
    step: float  # s


@dataclass(frozen=True)
class Thompson:
    """Flies to the place that shows the most error per step of flight in a drawn world, and draws again on arrival.

    A drawn person's error is the distance to the person's track, at most `cutoff` [m], or `cutoff` without a track, as
    in OSPA. From each place considered, the UAV would see a drawn person at one of nine points of its image. UAVs
    draw independently and send no plans, so chance alone separates them.
    Source: [Banerjee24], TS-PHD-II, with the tracker's Poisson intensity and Gaussian tracks in place of particles.

    Note: the paper moves a UAV to any place at once; here an action is a flight of at most `horizon` steps. Drawn
    people keep their velocities, whatever the motion model.
    """

    # steps after which a flight ends, whether or not it has arrived
    horizon: Annotated[int, Range(1, 100)] = 3
    # m: cost of a person without a track, and largest cost of a person with one
    cutoff: Annotated[float, Range(0, 1e6, above=True)] = 10.0
    exchange = Exchange(0)
    decentralised: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_options(self)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """The rest of each UAV's flight, or a flight to the best place in a new world."""
        return [self._choose_flight(s, stream) for s, stream in zip(team, rng.spawn(len(team)), strict=True)]

    def _choose_flight(self, situation: Situation, rng: np.random.Generator) -> Plan:
        last = situation.intents.get(situation.own.id)
        if last is not None and len(last.controls) > 1:
            return Plan(limit_speed(last.controls[1:], situation.own.max_speed))
        way = self.goal(situation, draw_world(situation, rng)) - situation.own.position[:2]
        steps = _count_steps(way[0], way[1], situation.own.max_speed * situation.step)
        controls = np.tile(way / (situation.step * steps), (int(min(steps, self.horizon)), 1))
        return Plan(limit_speed(controls, situation.own.max_speed))

    def goal(self, situation: Situation, world: DrawnWorld) -> Array:
        """The place (2,) m with the most error in view per step of flight. The UAV stays if no place shows any."""
        own, forest = situation.own, situation.forest
        spots = points_shown(own, IMAGE_POINTS)
        start, reach = own.position.astype(float), own.max_speed * situation.step
        places = np.concatenate(
            [own.position[None, :2], _list_places(start, reach, situation.step, world.states, spots)]
        )
        view = view_quadrangle(own)
        flight = _Reach(start, reach, situation.step)
        found = _find_errors_in_view(places, flight, view, world, self.cutoff, forest.blockers, forest.grid)
        # If no place shows an error, the first one is taken: the UAV's own position.
        return np.asarray(places[np.argmax(found.sum(axis=1) / _count_steps_to_each(places, start, reach))])


def draw_world(situation: Situation, rng: np.random.Generator) -> DrawnWorld:
    """People drawn from the intensity of undetected people, and from the tracks by their existence probabilities."""
    means, covariances = beliefs_of(situation.tracks)
    errors = draw_deviations(covariances, rng)
    exists = rng.random(len(means)) < np.array([track.existence for track in situation.tracks])
    people = np.zeros((0, 4))
    if situation.undetected is not None:
        sums = np.cumsum(situation.undetected.people)
        count = draw_poisson(rng, float(sums[-1]))
        cells = np.searchsorted(sums, rng.random(count) * sums[-1], side="right")
        centres = situation.undetected.centres().reshape(-1, 2)[np.minimum(cells, len(sums) - 1)]
        people = np.hstack([centres + situation.undetected.cell * (rng.random((count, 2)) - 0.5), np.zeros((count, 2))])
    states = np.concatenate([(means + errors)[exists], people])
    return DrawnWorld(states, np.concatenate([errors[exists], np.full(people.shape, math.inf)]))


@compiled
def _count_steps(x: float, y: float, reach: float) -> float:
    """Number of steps, at least one, in which a UAV flies (x, y) m at up to `reach` m a step."""
    return max(1.0, math.ceil(math.sqrt(x * x + y * y) / reach))


@compiled
def _count_steps_to_each(places: Array, start: Array, reach: float) -> Array:
    """Steps (N,) to places (N, 2) m."""
    steps = np.empty(len(places))
    for n in range(len(places)):
        steps[n] = _count_steps(places[n, 0] - start[0], places[n, 1] - start[1], reach)
    return steps


@compiled
def _list_places(start: Array, reach: float, step: float, states: Array, spots: Array) -> Array:
    """Places (M S, 2) m from which, on arrival, each person is nearly at each of the image's `spots` (S, 2) m."""
    places = np.empty((len(states) * len(spots), 2))
    for n in range(len(places)):
        state, spot = states[n // len(spots)], spots[n % len(spots)]
        for steps in range(1, 101):  # the fewest that suffice; 100 if none do
            x, y = state[0] + steps * step * state[2] - spot[0], state[1] + steps * step * state[3] - spot[1]
            if _count_steps(x - start[0], y - start[1], reach) <= steps:
                break
        places[n, 0], places[n, 1] = x, y
    return places


@compiled
def _find_errors_in_view(
    places: Array, flight: _Reach, view: Array, world: DrawnWorld, most: float, blockers: Array, grid: Grid
) -> Array:
    """Errors (N, M) up to `most` m of people that places (N, 2) m are expected to show on arrival; 0 out of view."""
    found = np.zeros((len(places), len(world.states)))
    steps = _count_steps_to_each(places, flight.start, flight.reach)
    for n in range(len(places)):
        time = flight.step * min(steps[n], 100.0)
        for m in range(len(world.states)):
            state, error = world.states[m], world.errors[m]
            x, y = state[0] + time * state[2], state[1] + time * state[3]
            if inside(view, x - places[n, 0], y - places[n, 1]):
                camera = places[n, 0], places[n, 1], flight.start[2]
                dx, dy = error[0] + time * error[2], error[1] + time * error[3]
                shows = middle_detectability(camera, (x, y, TARGET_HEIGHT), view[4, 2], blockers, grid)
                found[n, m] = shows * min(math.sqrt(dx * dx + dy * dy), most)
    return found
