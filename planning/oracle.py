"""The oracle: a planner that knows true positions, present and future, as an upper bound."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from planning.composed import Composed
from planning.planner import Exchange, Plan, Planner, Situation
from planning.planner_loading import TruePositions
from planning.prediction.predicted_belief import PredictedBelief, predict_belief
from planning.prediction.propagation import FIVE_POINTS
from tracking.filter.kalman import Gaussian
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.arrays import Flags
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import length
from tracking.track import Track, beliefs_of

# Covariance for a person without a track: the trace 400 m², at which the paper's tracks are deleted, and walking speed.
_UNKNOWN = np.diag([200.0, 200.0, 2.25, 2.25])
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
        for name in ("propagation", "visibility", "search"):
            if (value := getattr(self, name)) != getattr(Composed, name):
                raise ValueError(f"{name}={value} is not for an oracle, which knows where people will be")

    def knowing(self, people: TruePositions) -> Planner:
        """The planner to fly, which knows these positions."""
        options = {field.name: getattr(self, field.name) for field in fields(self)}
        return _Knowing(Composed(**options | {"propagation": _TruePaths(people)}), people)


@dataclass(frozen=True)
class _Knowing:
    planner: Composed
    people: TruePositions

    @property
    def exchange(self) -> Exchange:
        return self.planner.exchange

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        known = [replace(s, tracks=true_tracks(s, self.people, self.planner.horizon)) for s in team]
        return self.planner.plan(known, rng)


@dataclass(frozen=True)
class _TruePaths:
    """Belief propagation along the true paths of people, for the tracks of `true_tracks`."""

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
    cylinders = np.column_stack([places[:, :2], np.tile([1.0, 0.0, TARGET_HEIGHT + 1.0], (len(places), 1))])
    blockers = np.insert(belief.blockers, belief.offsets[1:][rows], cylinders, axis=0)
    return belief._replace(blockers=blockers, offsets=belief.offsets + np.concatenate([[0], np.cumsum(rows)]))


def true_tracks(situation: Situation, people: TruePositions, horizon: int) -> tuple[Track, ...]:
    """Tracks of the people present, by index: true states, with the second moments of the tracks assigned to them.

    The assignment has the least total distance. A true velocity is the mean over the next step. Only the error of a
    track's position adds to its covariance, not that of its velocity. People that appear within `horizon` steps have
    tracks, too, at rest where they will appear.
    """
    here, there = people(situation.time), people(situation.time + situation.step)
    first = here
    for step in range(1, horizon + 1):
        first = np.where(np.isnan(first), people(situation.time + step * situation.step), first)
    persons = np.flatnonzero(~np.isnan(first[:, 0]))
    states = np.hstack([first, np.nan_to_num((there - here) / situation.step)])[persons]
    means, covariances = beliefs_of(situation.tracks)
    spread = np.tile(_UNKNOWN, (len(persons), 1, 1))
    present = np.flatnonzero(~np.isnan(here[persons, 0]))
    gaps = length(states[present, None, :2] - means[None, :, :2])
    for row, track in pairs_within(gaps, np.inf):
        error = states[present[row], :2] - means[track, :2]
        spread[present[row]] = covariances[track]
        spread[present[row], :2, :2] += error[:, None] * error
    rows = zip(persons.tolist(), states, spread, strict=True)
    return tuple(Track(person, Gaussian(state, P)) for person, state, P in rows)
