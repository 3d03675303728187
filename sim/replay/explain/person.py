"""Facts of one person at one scan of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.evaluation.score import velocities
from sim.recording.recording import Recording
from sim.replay.explain.observation import Observation, Observer
from sim.replay.explain.planned_visibility import PlannedVisibility, planned_visibility
from sim.replay.history import History
from tracking.filter.kalman import Gaussian
from tracking.metrics.nees import nees
from tracking.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class HoldingTrack:
    """The track that stands for a person, or that did last, as one UAV has it after a scan."""

    number: int  # by first appearance
    holds: tuple[int, ...]  # UAVs for which it stands for the person now
    others: tuple[tuple[int, tuple[int, ...]], ...]  # other tracks that do now, and for which UAVs
    since: float  # s, of its first scan
    belief: Gaussian | None  # None where it has ended
    existence: float  # existence probability; NaN where it is not estimated
    until: float  # s, of the last scan at which it stood for the person

    @property
    def axes(self) -> Array:
        """Standard deviations (2,) m of the position along its principal axes, the larger first."""
        assert self.belief is not None
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.belief.covariance[:2, :2])[::-1]))

    def error(self, place: Array) -> tuple[float, float]:
        """Distance [m] of its position from a place (2,) m, and its square in its own standard deviations (NEES)."""
        assert self.belief is not None
        off = self.belief.mean[:2] - place
        return float(np.hypot(*off)), float(nees(off[None], self.belief.covariance[None, :2, :2])[0])


@dataclass(frozen=True, eq=False)
class PersonFacts:
    """One person at one scan, and n UAVs."""

    k: int
    person: int
    place: Array  # (2,) m, NaN where absent
    velocity: Array  # (2,) m/s, NaN where unknown
    holder: HoldingTrack | None  # None for a person that no track has stood for yet
    observations: tuple[Observation, ...]
    planned: tuple[PlannedVisibility | None, ...]
    history: History

    @staticmethod
    def of(observer: Observer, history: History, k: int, person: int) -> PersonFacts:
        """The facts of a person at scan k."""
        recording, scenario = observer.recording, observer.scenario
        uavs = range(recording.poses.shape[1])
        holder = _holder(recording, history, k, person)
        belief = holder.belief if holder else None
        return PersonFacts(
            k=k,
            person=person,
            place=recording.people[k, person],
            velocity=velocities(recording)[k, person],
            holder=holder,
            observations=tuple(observer.observe(k, i, person) for i in uavs),
            planned=tuple(planned_visibility(recording, scenario, k, i, person, belief) for i in uavs),
            history=history,
        )


def _holder(recording: Recording, history: History, k: int, person: int) -> HoldingTrack | None:
    """The track by which most UAVs hold the person; where none does, the last that did."""
    held = history.tracks[: k + 1, :, person]
    scans = np.flatnonzero((held >= 0).any(axis=1))
    if len(scans) == 0:
        return None
    ids, counts = np.unique(held[scans[-1]][held[scans[-1]] >= 0], return_counts=True)
    id_ = int(ids[np.argmax(counts)])
    holds = np.flatnonzero(held[k] == id_).tolist()
    rest = sorted({t for t in held[k].tolist() if t >= 0} - {id_})
    numbers = recording.track_numbers
    first = int(np.searchsorted(recording.track_offsets, np.argmax(recording.track_ids == id_), side="right")) - 1
    belief, existence = _belief(recording, k, [*holds, *np.flatnonzero(history.working[k]).tolist()], id_)
    return HoldingTrack(
        number=numbers[id_],
        holds=tuple(holds),
        others=tuple((numbers[t], tuple(np.flatnonzero(held[k] == t).tolist())) for t in rest),
        since=float(recording.times[first // recording.poses.shape[1]]),
        belief=belief,
        existence=existence,
        until=float(recording.times[scans[-1]]),
    )


def _belief(recording: Recording, k: int, uavs: list[int], id_: int) -> tuple[Gaussian | None, float]:
    """A track and its existence after scan k, of the first of the UAVs that has it; None and NaN if none has."""
    for i in uavs:
        rows = np.flatnonzero(recording.track_ids_at(k, i) == id_)
        if len(rows):
            return recording.tracks_at(k, i)[rows[0]].belief, float(recording.existence_at(k, i)[rows[0]])
    return None, float("nan")
