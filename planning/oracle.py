"""Oracles, planners that know true positions, as upper bounds: of everybody ever, or of the people found at present."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np

from planning.composed import Composed
from planning.planner import Exchange, Plan, Planner, Situation
from planning.planner_loading import TruePositions
from planning.prediction.predicted_belief import PredictedBelief, predict_belief
from planning.prediction.propagation import FIVE_POINTS
from tracking.filter.kalman import Gaussian
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import length
from tracking.track import Track, beliefs_of

# Covariance for a person without a track: the trace 400 m², at which the paper's tracks are deleted, and walking speed.
_UNKNOWN = np.diag([200.0, 200.0, 2.25, 2.25])
FOUND = 1.0  # m, distance of a track at which its person counts as found
_MOMENT = 0.1  # s
_REACH = 20.0  # m, root of the trace of `_UNKNOWN`: a track that is farther away is worse than no track
_ABOUT = 0.5  # m: standard deviation along each axis of the five places at which a person's visibility is judged


@dataclass(frozen=True)
class Oracle(Composed):
    """Planner as `Composed` on people's true positions, now and along their true paths: an upper bound.

    The mission hands over the truth by `knowing`; situations hold none. Without the truth the planner uses its beliefs.
    A person has the second moment P + e eᵀ of the assigned track, with the track's covariance P and the true error e of
    its position. Trees, fields of view, noise, dynamics and tracker are unchanged, so the oracle never misses a person
    for want of a position.

    UAVs are not exactly where they plan to be, so a plan that barely brings a person into view may miss the person.
    Therefore visibility is judged at five equally probable places about each true position.

    Note: the built-in `oracle` has no cost-to-go: people out of reach within its horizon do not attract it.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("propagation", "visibility", "search", "escape"):
            if (value := getattr(self, name)) != getattr(Composed, name):
                raise ValueError(f"{name}={value} is not for an oracle, which knows where people will be")

    def knowing(self, people: TruePositions) -> Planner:
        """The planner to fly, which knows these positions."""
        options = {field.name: getattr(self, field.name) for field in fields(self)}
        return _Knowing(Composed(**options | {"propagation": _TruePaths(people)}), people)


@dataclass
class _Knowing:
    planner: Composed
    people: TruePositions

    @property
    def exchange(self) -> Exchange:
        return self.planner.exchange

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        known = [replace(s, tracks=make_true_tracks(s, self.people, self.planner.horizon)) for s in team]
        return self.planner.plan(known, rng)


@dataclass(frozen=True)
class FoundOracle(Composed):
    """Planner as `Composed` that knows the present states of the people who have been found, and nobody else's.

    A person counts as found from the first decision at which a UAV has a track within `FOUND` m. So this bounds what
    planning can do about people whom the fleet has lost. It does not bound the search for people whom nobody has seen:
    `Composed` searches for them as usual. The tracker's motion model predicts where people go.
    """

    def knowing(self, people: TruePositions) -> Planner:
        """The planner to fly, which knows these positions."""
        return _KnowingFound(Composed(**{field.name: getattr(self, field.name) for field in fields(self)}), people)


@dataclass
class _KnowingFound(_Knowing):
    found: set[int] = field(default_factory=set)
    stateful: ClassVar[bool] = True  # who has been found

    def reset(self, seed: int) -> None:
        self.found = set()
        self.planner.reset(seed)

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        for situation in team:
            here = self.people(situation.time)
            gaps = length(here[:, None] - beliefs_of(situation.tracks).means[None, :, :2])
            self.found.update(person for person, _ in pairs_within(np.where(np.isnan(gaps), np.inf, gaps), FOUND))
        known = [replace(s, tracks=correct_tracks(s, self.people, self.found)) for s in team]
        return self.planner.plan(known, rng)


def correct_tracks(situation: Situation, people: TruePositions, found: Collection[int]) -> tuple[Track, ...]:
    """Tracks of the people `found` who are present, as in `make_true_tracks`, then tracks that are assigned to nobody.

    A track is assigned to a person within `_REACH` m at most; tracks farther away may be of people not found yet.
    A velocity is the mean over `_MOMENT` s, so that it does not give away later turns.
    """
    here = people(situation.time)
    persons = np.array(sorted(person for person in found if not np.isnan(here[person, 0])), dtype=int)
    states = np.hstack([here, np.nan_to_num((people(situation.time + _MOMENT) - here) / _MOMENT)])[persons]
    spread, taken = _compute_second_moments(states, np.arange(len(persons)), situation.tracks, _REACH)
    known = [Track(n, Gaussian(state, P)) for n, (state, P) in enumerate(zip(states, spread, strict=True))]
    others = [track for k, track in enumerate(situation.tracks) if k not in taken]
    return (*known, *(replace(track, id=len(known) + k) for k, track in enumerate(others)))


@dataclass(frozen=True)
class _TruePaths:
    """Belief propagation along the true paths of people, for the tracks of `make_true_tracks`."""

    people: TruePositions

    def predict(self, situation: Situation, horizon: int, rng: np.random.Generator) -> PredictedBelief:
        """As `planning.prediction.propagation.Propagation.predict`; absent people are hidden."""
        means, covariances = beliefs_of(situation.tracks)
        persons = [track.id for track in situation.tracks]
        points = np.full((horizon, len(persons), len(FIVE_POINTS), 3), TARGET_HEIGHT)
        last, absent = means[:, :2], np.empty(points.shape[:3], dtype=np.bool_)
        for step in range(horizon):
            ahead = self.people(situation.time + (step + 1) * situation.step)[persons]
            absent[step] = np.isnan(ahead[:, :1])
            last = np.where(np.isnan(ahead), last, ahead)
            points[step, :, :, :2] = last[:, None] + _ABOUT * FIVE_POINTS
        return _hide(predict_belief(situation, points, covariances), absent.ravel())


def _hide(belief: PredictedBelief, rows: Flags) -> PredictedBelief:
    """The belief with a cylinder about each point marked in `rows` (H T K,), so that no camera sees the point."""
    places = belief.points.reshape(-1, 3)[rows]
    cylinders = np.zeros((len(places), belief.blockers.shape[1]))  # a seventh column has deviations of places
    cylinders[:, :2], cylinders[:, 2:6] = places[:, :2], (1.0, 0.0, TARGET_HEIGHT + 1.0, np.inf)
    blockers = np.insert(belief.blockers, belief.offsets[1:][rows], cylinders, axis=0)
    return belief._replace(blockers=blockers, offsets=belief.offsets + np.concatenate([[0], np.cumsum(rows)]))


def make_true_tracks(situation: Situation, people: TruePositions, horizon: int) -> tuple[Track, ...]:
    """Tracks of the people present, by index: true states, with the second moments of the tracks assigned to them.

    The assignment has the least total distance. A true velocity is the mean over the next step. The error of a
    track's position adds to its covariance; the error of its velocity does not. People that appear within `horizon`
    steps have tracks, too, at rest where they will appear.
    """
    here, there = people(situation.time), people(situation.time + situation.step)
    first = here
    for step in range(1, horizon + 1):
        first = np.where(np.isnan(first), people(situation.time + step * situation.step), first)
    persons = np.flatnonzero(~np.isnan(first[:, 0]))
    states = np.hstack([first, np.nan_to_num((there - here) / situation.step)])[persons]
    spread, _ = _compute_second_moments(states, np.flatnonzero(~np.isnan(here[persons, 0])), situation.tracks)
    rows = zip(persons.tolist(), states, spread, strict=True)
    return tuple(Track(person, Gaussian(state, P)) for person, state, P in rows)


def _compute_second_moments(
    states: Array, present: Indices, tracks: Sequence[Track], reach: float = np.inf
) -> tuple[Array, set[int]]:
    """Second moments (N, 4, 4) about true states (N, 4), and the indices of the tracks that are assigned to them.

    present (M,): rows of `states` to which tracks within `reach` m are assigned, by the least total distance.
    """
    means, covariances = beliefs_of(tracks)
    spread, taken = np.tile(_UNKNOWN, (len(states), 1, 1)), set()
    gaps = length(states[present, None, :2] - means[None, :, :2])
    for row, track in pairs_within(gaps, reach):
        error = states[present[row], :2] - means[track, :2]
        spread[present[row]] = covariances[track]
        spread[present[row], :2, :2] += error[:, None] * error
        taken.add(track)
    return spread, taken
