"""Exchange of tracks with the fleet: the message of a scan, and ids for trackers that know beliefs and no messages."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tracking.association.jpda import log_odds
from tracking.fusion.labels import LABELS_PER_SCAN, new_label
from tracking.fusion.message import INFORMATION, Message
from tracking.fusion.rule import LocalBeliefs, fusion_rule
from tracking.numerics.arrays import Array
from tracking.parameters import TrackerParameters
from tracking.track import Track, beliefs_of, tracks_of

UNSEEN = 1e-9  # least weight of a belief in the fleet's average: it matters only if no UAV had the person in view
# Probability of a detection from which on it is a sighting. Of two tracks that share one person's measurements, one is
# lost: its person may turn up elsewhere.
SURE = 0.99
_IN_TOUCH = 1.0  # s for which a UAV stays in a partition of the fleet without a message from its leader
_CERTAIN = 1.0 - 2e-9  # existence from which on it is 1, as log-odds are kept finite
# Of a track that is new and of one known at the start, which count as sighted in their first scan.
_NEW, _UNKNOWN = np.full(6, -np.inf), np.full(6, -np.inf)


def shares_of(averaged: Array, weights: Array, existence: Array) -> Array:
    """Shares (T, 22) as in a message, of information (T, 20) to average, its weights (T,) and existence (T,)."""
    shares = np.empty((len(weights), 1 + INFORMATION + 1))
    shares[:, 0], shares[:, 1:-1], shares[:, -1] = 1.0, averaged, log_odds(existence)
    shares *= weights[:, None]
    return shares


def partition_of(uav: int, heard: tuple[int, float], time: float) -> tuple[int, float]:
    """Leader of the UAV's partition, and the time [s] of its last message; heard: those before the scan at `time` s.

    A UAV leads where its number is the smallest, or where it has not heard of another leader lately.
    """
    return (uav, time) if heard[0] >= uav or time - heard[1] > _IN_TOUCH else heard


class TrackExchange:
    """Tracks of one UAV in its fleet: their ids, which all UAVs share, and messages from and to tracks.

    The rest is the fleet's: association of tracks between UAVs, fusion, and ids that stay the same.
    Note: all information is averaged. Novel information, which `network.fusion` = "hcmci" adds up, needs the
    measurements behind it.
    """

    def __init__(self, uav: int, parameters: TrackerParameters, initial: Sequence[Track] = ()) -> None:
        """`initial` tracks are the same on all UAVs."""
        self._uav, self._parameters = uav, parameters
        self._rule = fusion_rule(parameters.fusion)
        self._scans, self._time, self._born = 0, -math.inf, 0
        self._partition = (0, -math.inf)  # leader, and the time [s] at which it was last heard
        self._deleted: tuple[tuple[int, float], ...] = ()
        # Of each track that the fleet knows or that is new: its times and its sighting, as in a message.
        self._known = {t.id: _UNKNOWN for t in initial}

    def new_id(self) -> int:
        """An id for a track that begins in this scan."""
        if self._born == LABELS_PER_SCAN // 2:
            raise ValueError(f"at most {self._born} tracks may begin in a scan")
        id = new_label(self._scans + 1, self._uav, self._born)
        self._born += 1
        self._known[id] = _NEW
        return id

    def message(self, degree: int, time: float, tracks: Sequence[Track], detected: Mapping[int, float]) -> Message:
        """Message about the tracks after the scan at `time` [s], to so many neighbours; call it once a scan.

        detected: by id, the probability that this UAV detected the person in this scan, which is the weight of its
        belief in the fleet's average; tracks that are not in it were not detected. A track that is left out ends, on
        all UAVs but for those that detect it in this scan.
        """
        held = sorted(tracks, key=lambda track: track.id)
        ids = [track.id for track in held]
        self._check(time, ids, detected)
        self._partition = (0, time) if self._scans == 0 else self._partition
        self._scans, self._time = self._scans + 1, time
        ended = {id: time for id, last in self._known.items() if id not in ids and last is not _NEW}
        self._deleted = tuple(sorted((dict(self._deleted) | ended).items()))
        means, covariances = beliefs_of(held)
        nothing = (means[:0], covariances[:0]), np.zeros((0, 2)), np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
        chances = np.array([detected.get(id, 0.0) for id in ids])
        weights = np.maximum(chances, UNSEEN)
        marks = np.column_stack([chances >= self._parameters.seen] * 2 + [chances >= SURE])
        history = np.array([self._known[id] for id in ids], dtype=float).reshape(-1, 6)
        history[:, 3:] = np.where(history[:, 5:] > -math.inf, history[:, 3:], self._here(means))
        averaged, novel, weights = self._rule.contribution(
            LocalBeliefs(self._uav, means, covariances, weights, *nothing)
        )
        existence = np.array([t.existence for t in held], dtype=float)
        partition, labels = partition_of(self._uav, self._partition, time), np.array(ids, dtype=np.int64)
        return Message(
            uav=self._uav,
            degree=degree,
            scan=self._scans,
            time=time,
            partition=partition,
            ids=labels,
            names=np.column_stack([np.full(len(ids), partition[0]), labels]),
            shares=shares_of(averaged, weights, existence),
            times=np.where(marks, time, history[:, :3]),
            misses=np.zeros(len(ids), dtype=np.int64),
            sightings=history[:, 3:],
            deleted=self._deleted,
            novel=novel,
        )

    def accept(self, message: Message) -> tuple[Track, ...]:
        """The fleet's tracks by ascending id, in place of the own: some have new ids, some are new, some have ended."""
        means, covariances = message.beliefs
        existence = message.existence()
        existence[existence >= _CERTAIN] = 1.0
        sightings = message.sighted()
        kept = self._time - self._parameters.forget_after
        self._deleted = tuple((id, until) for id, until in message.deleted if until >= kept)
        self._partition, self._born = message.partition, 0
        histories = np.concatenate([message.times, sightings], axis=1)
        self._known = dict(zip(message.ids.tolist(), histories, strict=True))
        return tracks_of(message.ids, means, covariances, existence, sightings)

    def _here(self, means: Array) -> Array:
        return np.column_stack([means[:, :2], np.full(len(means), self._time)])

    def _check(self, time: float, ids: Sequence[int], detected: Mapping[int, float]) -> None:
        """ValueError for a time not after the last one, ids that the fleet cannot know, or no probabilities."""
        if not time > self._time:
            raise ValueError(f"scan at {time} s is not after the last one at {self._time} s")
        if len(set(ids)) < len(ids):
            raise ValueError(f"ids of tracks are there twice: {ids}")
        foreign = [id for id in ids if id not in self._known]
        if foreign:
            raise ValueError(f"ids {foreign} are not of the fleet; take those of new tracks from new_id()")
        wrong = {id: chance for id, chance in detected.items() if id not in ids or not 0.0 <= chance <= 1.0}
        if wrong:
            raise ValueError(f"detected must have a probability for ids of tracks, has {wrong}")
