"""Exchange of tracks with the fleet: messages from tracks, and ids for trackers that have only beliefs."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tracking.association.jpda import log_odds
from tracking.fusion.message import IDS_PER_SCAN, LOG_ODDS, WEIGHT, EndedTrack, Message, Partition, new_id
from tracking.fusion.rule import LocalBeliefs, make_fusion_rule
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.compiled import compiled
from tracking.parameters import SEEN, TrackerParameters
from tracking.track import SIGHTED_AT, Beliefs, Track, TrackTable, beliefs_of, make_table, make_tracks

UNSEEN = 1e-9  # least weight of a belief in the fleet's average, which matters only if no UAV had the person in view
# Probability from which on a detection is a sighting. If two tracks share the measurements of one person, at most one
# has a sighting. The other is lost, and its person may turn up elsewhere.
SURE = 0.99
_FORGET_AFTER = 30.0  # s for which the fleet remembers that it deleted a track
_IN_TOUCH = 1.0  # s for which a UAV stays in a partition of the fleet without a message from its leader
_CERTAIN = 1.0 - 2e-9  # least existence probability that counts as 1, because messages keep log-odds finite
# Times and sighting of a track that is new or known at the start; it counts as sighted in its first scan.
_UNSIGHTED = np.full(7, -np.inf)


class ScanEvidence(NamedTuple):
    """What a scan that is not yet fused was compared with, as in `LocalBeliefs`."""

    prior: Beliefs
    measurements: Array
    gates: Indices


NO_EVIDENCE = ScanEvidence(beliefs_of(()), np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64))


class Messenger:
    """Maker of one UAV's messages; it counts scans, and remembers the UAV's partition and the tracks that ended."""

    def __init__(self, uav: int, parameters: TrackerParameters) -> None:
        self.uav = uav
        self.scans = 0
        self.time = -math.inf  # s, of the last scan
        self.rule = make_fusion_rule(parameters.fusion)
        self.partition = Partition(0, -math.inf)  # as last heard, or the UAV's own
        self._deleted: dict[int, float] = {}  # by id, the time [s] up to which sightings of the track are void

    def begin(self, time: float) -> None:
        """Begin the scan at `time` [s]; ValueError unless it is after the last one."""
        if not time > self.time:
            raise ValueError(f"scan at {time} s is not after the last one at {self.time} s")
        if self.scans == 0:
            self.partition = Partition(0, time)  # at the start the fleet is one, and knows where people are
        self.scans += 1
        self.time = time
        # A UAV leads if its number is the smallest, or if it has not heard of another leader lately.
        if self.partition.leader >= self.uav or time - self.partition.time > _IN_TOUCH:
            self.partition = Partition(self.uav, time)

    def delete(self, ids: Iterable[int]) -> None:
        """Record tracks that end in this scan."""
        self._deleted.update(dict.fromkeys(ids, self.time))

    def tell(self, table: TrackTable, evidence: ScanEvidence) -> tuple[Indices, Array, Array]:
        """Keys, shares and novel information about a table's tracks; `evidence` has the priors of the first of them."""
        detected = np.flatnonzero(table.weights[: len(evidence.prior.means)] >= SEEN)
        local = LocalBeliefs(self.uav, table.means, table.covariances, table.weights, *evidence, detected)
        averaged, novel, weights = self.rule.contribution(local)
        leaders = np.full(len(table.ids), self.partition.leader)
        return *weigh(leaders, table.ids, weights, averaged, table.existence), novel

    def message(self, degree: int, table: TrackTable, told: tuple[Indices, Array, Array]) -> Message:
        """Message for the first round about a table's tracks, with what `tell` returns."""
        keys, shares, novel = told
        deleted = tuple(EndedTrack(*ended) for ended in sorted(self._deleted.items()))
        rest = shares, table.times, table.views, table.misses, table.sightings, deleted, novel
        return Message(self.uav, degree, self.scans, self.time, self.partition, table.ids, keys, *rest)

    def accept(self, message: Message) -> None:
        """Take over the fleet's partition and deletions."""
        # Old deletions are dropped. A partition that was cut off for longer may bring such a track back for a while.
        self._deleted = {id: until for id, until in message.deleted if self.time - until <= _FORGET_AFTER}
        self.partition = message.partition


@compiled
def weigh(leaders: Indices, ids: Indices, weights: Array, averaged: Array, existence: Array) -> tuple[Indices, Array]:
    """Keys (T, 2) and shares (T, 22) of a message from leaders and weights (T,), information (T, 20) and existence."""
    keys, shares = np.empty((len(ids), 2), np.int64), np.empty((len(ids), LOG_ODDS + 1))
    for t in range(len(ids)):
        keys[t, 0], keys[t, 1] = leaders[t], ids[t]
        shares[t, WEIGHT] = weights[t]
        for k in range(averaged.shape[1]):
            shares[t, 1 + k] = weights[t] * averaged[t, k]
        shares[t, LOG_ODDS] = weights[t] * log_odds(existence[t])
    return keys, shares


class TrackExchange:
    """Exchange of one UAV's tracks with its fleet: messages from tracks, tracks from messages, and common ids.

    Note: all information is averaged, even with `network.fusion` = "hcmci", because adding up novel information needs
    the measurements that it comes from.
    """

    def __init__(self, uav: int, parameters: TrackerParameters, initial: Sequence[Track] = ()) -> None:
        """`initial` tracks are the same on all UAVs."""
        self._messenger = Messenger(uav, parameters)
        # Times and sighting, as in a message, of each track that the fleet knows or that is new.
        self._known = {t.id: _UNSIGHTED for t in initial}
        self._new: set[int] = set()  # ids of tracks that begin in this scan, which the fleet does not know yet

    def new_id(self) -> int:
        """An id for a track that begins in this scan."""
        if len(self._new) == IDS_PER_SCAN // 2:
            raise ValueError(f"at most {len(self._new)} tracks may begin in a scan")
        id = new_id(self._messenger.scans + 1, self._messenger.uav, len(self._new))
        self._new.add(id)
        self._known[id] = _UNSIGHTED
        return id

    def message(self, degree: int, time: float, tracks: Sequence[Track], detected: Mapping[int, float]) -> Message:
        """Message about the tracks after the scan at `time` [s], to `degree` neighbours; call it once per scan.

        detected: by id, the probability that this UAV detected the person in this scan, which is the weight of its
        belief in the fleet's average; 0 for tracks without an entry. A known track that is missing in `tracks` ends on
        all UAVs except those that detect it in this scan.
        """
        held = sorted(tracks, key=lambda track: track.id)
        ids = [track.id for track in held]
        self._check(ids, detected)
        self._messenger.begin(time)
        self._messenger.delete(id for id in self._known if id not in ids and id not in self._new)
        chances = np.array([detected.get(id, 0.0) for id in ids])
        marks = np.column_stack([chances >= SEEN] * 2 + [chances >= SURE])
        history = np.array([self._known[id] for id in ids], dtype=float).reshape(-1, 7)
        history[:, :3][marks] = time
        table = make_table(held, np.maximum(chances, UNSEEN), history[:, :4])
        sighted = history[:, 6] > -math.inf
        table.sightings[sighted], table.sightings[~sighted, SIGHTED_AT] = history[sighted, 4:], time
        return self._messenger.message(degree, table, self._messenger.tell(table, NO_EVIDENCE))

    def accept(self, message: Message) -> tuple[Track, ...]:
        """The fleet's tracks by ascending id, which replace this UAV's; ids may change, and tracks may begin or end."""
        means, covariances = message.beliefs
        existence = message.existence()
        existence[existence >= _CERTAIN] = 1.0
        sightings = message.latest_sightings()
        self._messenger.accept(message)
        self._new = set()
        histories = np.concatenate([message.times, sightings], axis=1)
        self._known = dict(zip(message.ids.tolist(), histories, strict=True))
        return make_tracks(message.ids, means, covariances, existence, sightings)

    def _check(self, ids: Sequence[int], detected: Mapping[int, float]) -> None:
        """Raise ValueError for ids that the fleet cannot know, and for `detected` without probabilities."""
        if len(set(ids)) < len(ids):
            raise ValueError(f"ids of tracks are there twice: {ids}")
        foreign = [id for id in ids if id not in self._known]
        if foreign:
            raise ValueError(f"ids {foreign} are not of the fleet; take those of new tracks from new_id()")
        wrong = {id: chance for id, chance in detected.items() if id not in ids or not 0.0 <= chance <= 1.0}
        if wrong:
            raise ValueError(f"detected must have a probability for ids of tracks, has {wrong}")
