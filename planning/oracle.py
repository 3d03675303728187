"""The oracle: a planner on true positions, present and future, as an upper bound."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planning.composition import Composition
from planning.contract import TruePositions
from planning.pieces import Composed
from planning.planner import Exchange, Plan, Planner, Situation
from planning.prediction.predicted_belief import PredictedBelief, predicted_belief
from planning.prediction.propagation import FIVE_POINTS
from tracking.filter.kalman import Gaussian
from tracking.geometry.visibility import TARGET_HEIGHT
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import length
from tracking.track import Track, beliefs_of

# Of a person without a track: the trace at which the paper's tracks end, 400 m², and walking speed.
_UNKNOWN = np.diag([200.0, 200.0, 2.25, 2.25])
_ABOUT = 0.5  # m: deviation along each axis of the places at which a person is judged to be in view or not


@dataclass(frozen=True)
class Oracle(Composed):
    """`Composed` on people's true positions, now and along their true paths: an upper bound.

    The mission hands it the truth by `knowing`; situations hold none. Without the truth it plans on its beliefs. Each
    person has the second moment P + e eᵀ of the track assigned to them: its covariance P, and the true error e of its
    position. Trees, fields of view, noise, dynamics and tracker stay as they are, so its misses are not for want of
    knowing positions.

    UAVs are not exactly where they plan to be. So each person is judged at five equally probable places about the true
    one: a plan that brings a person barely into view may miss them, however well the person's path is known.

    Note: the built-in `oracle` has no cost-to-go: people out of reach within its horizon do not attract it. Nor do those
    who appear later: people count from the decision at which they are there, and who leaves is taken to stay.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("propagation", "visibility", "search"):
            if (value := getattr(self, name)) != getattr(Composed, name):
                raise ValueError(f"{name}={value} is not for an oracle, which knows where people will be")

    def knowing(self, people: TruePositions) -> Planner:
        """The planner that knows these positions."""
        return _Knowing(replace(self.composition, propagation=_TruePaths(people)), people)


@dataclass(frozen=True)
class _Knowing:
    composition: Composition
    people: TruePositions

    @property
    def exchange(self) -> Exchange:
        return self.composition.exchange

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        return self.composition.plan([replace(s, tracks=true_tracks(s, self.people)) for s in team], rng)


@dataclass(frozen=True)
class _TruePaths:
    """Belief propagation for tracks of `true_tracks`: along the paths that these people take."""

    people: TruePositions

    def predict(self, situation: Situation, horizon: int, rng: np.random.Generator) -> PredictedBelief:
        """As `planning.prediction.propagation.Propagation.predict`; a person that leaves stays at the last position."""
        means, covariances = beliefs_of(situation.tracks)
        persons = [track.id for track in situation.tracks]
        points = np.full((horizon, len(persons), len(FIVE_POINTS), 3), TARGET_HEIGHT)
        last = means[:, :2]
        for step in range(horizon):
            ahead = self.people(situation.time + (step + 1) * situation.step)[persons]
            last = np.where(np.isnan(ahead), last, ahead)
            points[step, :, :, :2] = last[:, None] + _ABOUT * FIVE_POINTS
        return predicted_belief(situation, points, covariances)


def true_tracks(situation: Situation, people: TruePositions) -> tuple[Track, ...]:
    """Tracks of the people present, by index: true states, with the second moments of the tracks assigned to them.

    The assignment has the least total distance; the velocity is the mean over the next step. A track's velocity counts
    as right, so that the error of its position alone adds to its covariance.
    """
    here, there = people(situation.time), people(situation.time + situation.step)
    present = np.flatnonzero(~np.isnan(here[:, 0]))
    velocities = np.nan_to_num((there - here) / situation.step)
    states = np.hstack([here, velocities])[present]
    means, covariances = beliefs_of(situation.tracks)
    spread = np.tile(_UNKNOWN, (len(present), 1, 1))
    gaps = length(states[:, None, :2] - means[None, :, :2])
    for row, track in pairs_within(gaps, np.inf):
        error = states[row, :2] - means[track, :2]
        spread[row] = covariances[track]
        spread[row, :2, :2] += error[:, None] * error
    rows = zip(present.tolist(), states, spread, strict=True)
    return tuple(Track(person, Gaussian(state, P)) for person, state, P in rows)
