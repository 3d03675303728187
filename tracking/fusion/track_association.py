"""Track-to-track association: tracks of different UAVs matched, and their labels agreed without a server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracking.fusion.message import Message, alike, partitions_meet
from tracking.fusion.track_matching import crossed_labels, match_beliefs
from tracking.management.reacquisition import reacquisitions
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import most_pairs
from tracking.numerics.distances import pair_distances

_NONE = -1  # row of a track that is left out
_LABELLED = 3.0  # weight of a common label, in twice a log-likelihood: it is right about four times as often as not


def associate_tracks(own: Message, received: Sequence[Message], gate: float, max_speed: float) -> list[Message]:
    """Associate the tracks of messages: the messages, own first, with the same tracks in the same rows.

    Tracks of one label, an id and an alias, are the same. Where partitions of the fleet meet, this holds only for
    tracks that were last seen at the same time. All others are matched by their beliefs, one assignment per neighbour,
    in squared distance up to `gate`; a common id or alias adds to the likelihood of a pair.
    A track that has a common id or alias with another and agrees with it, but was seen earlier than the match of that
    other, is deleted: it has strayed. A lost track matches one seen lately if its person can have moved there at
    `max_speed` m/s. Lost tracks with a common label elsewhere match others last, as each partition may have taken one
    person for another. Among lost tracks of one person, the one last seen gives the position.
    A track without a match is taken over without any share of the own beliefs, so that nothing counts twice.
    The smallest id stays. Where two people would have it, as when a split network heals, the track of the smaller alias
    keeps it. The other track takes its alias as id; if it is lost, it is deleted. All this depends on the labels, not
    on the UAV, so that all UAVs decide alike.
    """
    if alike([own, *received]):
        return [own, *received]
    deleted = _deletions([own, *received])
    messages = [_surviving(m, deleted) for m in (own, *received)]
    # UAVs that hear the same messages match them in the same order.
    first, *others = sorted(range(len(messages)), key=lambda k: messages[k].uav)
    met = partitions_meet(messages)
    table = _AssociationTable(messages[first], gate, max_speed, met)
    slots = {first: np.arange(len(messages[first].ids)), **{k: table.add(messages[k]) for k in others}}
    ids, aliases = table.labels()
    order = np.argsort(ids, kind="stable")
    order = order[np.searchsorted(ids[order], 0) :]
    row = np.full(len(ids) + 1, _NONE)  # the last for tracks left out before
    row[order] = np.arange(len(order))
    out, last = [], np.full(len(ids) + 1, -np.inf)  # s, the latest sighting of each row
    for k, message in enumerate(messages):
        np.maximum.at(last, slots[k], message.sightings[:, 2])
    for k, message in enumerate(messages):
        slot = slots[k]
        older = met & (message.sightings[:, 2] < last[slot])
        outdated = (message.aliases == 0) & (older | np.isin(slot, table.reacquired))
        rows = np.where(outdated, _NONE, row[slot])
        kept = np.flatnonzero(rows != _NONE)
        left = message if len(kept) == len(rows) else message.only(kept)
        out.append(left.at(rows[kept], ids[order], aliases[order]))
    return out


def _deletions(messages: Sequence[Message]) -> tuple[tuple[int, float], ...]:
    """Deleted ids of all messages, ascending, with the latest time of each."""
    latest: dict[int, float] = {}
    for m in messages:
        for id, time in m.deleted:
            latest[id] = max(time, latest.get(id, time))
    return tuple(sorted(latest.items()))


def _surviving(message: Message, deleted: tuple[tuple[int, float], ...]) -> Message:
    """The message without tracks that a UAV deleted after they were last seen."""
    if message.deleted == deleted:
        return message
    deletions = dict(deleted)
    last_seen = message.history.times[:, 0].tolist()
    pairs = zip(message.ids.tolist(), last_seen, strict=True)
    keep = np.array([seen >= deletions.get(id, -np.inf) for id, seen in pairs], dtype=np.bool_)
    return replace(message.only(np.flatnonzero(keep)), deleted=deleted)


class _AssociationTable:
    """Table of tracks, one per row, to which the tracks of each neighbour are added."""

    def __init__(self, own: Message, gate: float, max_speed: float, met: bool) -> None:
        self.met = met  # if UAVs of different partitions hear one another
        self.gate, self.max_speed = gate, max_speed
        self.reacquired: list[int] = []  # rows of tracks that are lost for some UAVs; those that see the person decide
        self.mislabelled: list[int] = []  # rows of lost tracks with labels that may be those of other people
        self.deleted: list[int] = []  # rows of tracks with their person in another row
        every = np.arange(len(own.ids))
        self.means, self.covariances = (a[every] for a in own.beliefs())
        self.seen, self.sightings, self.lost = own.history.times[every, 0], own.sightings[every], own.aliases == 0
        # The row of each label, and the rows of each id and of each alias.
        self.slot: dict[tuple[int, int], int] = {}
        self.by_id: dict[int, dict[int, tuple[bool, int]]] = {}  # for each row the alias, 0 last
        self.by_alias: dict[int, dict[int, tuple[bool, int]]] = {}
        for k, label in enumerate(_labels(own)):
            self._enter(label, k)

    def add(self, message: Message) -> Indices:
        """Add a neighbour's tracks and return their rows (T,)."""
        labels = _labels(message)
        means, covariances = message.beliefs()
        slots = np.array([self.slot.get(pair, _NONE) for pair in labels], dtype=np.int64)
        # A lost track does not match a row that was seen lately: another track of the neighbour may be that person.
        slots[(message.aliases == 0) & ~np.append(self.lost, True)[slots]] = _NONE
        labelled = slots.copy()
        if self.met:
            # Tracks last seen at different times may be of two people by now, as a partition may have reused the label
            # on less information. So may tracks without alias, which does not tell the UAV that began the track.
            elsewhen = message.history.times[:, 0] != np.append(self.seen, np.nan)[slots]
            slots[elsewhen | (message.aliases == 0)] = _NONE
        unknown = slots == _NONE
        stale = self._match_labelled(message, slots)
        free = np.setdiff1d(np.arange(len(self.means)), [*slots.tolist(), *self.deleted])
        new = np.array(
            [k for k in np.flatnonzero(slots == _NONE) if k not in stale and not self._outdated(labels[k])],
            dtype=np.int64,
        )
        pairs = match_beliefs((self.means[free], self.covariances[free]), (means[new], covariances[new]), self.gate)
        for a, b in pairs:
            slots[new[b]] = free[a]
        new = np.setdiff1d(new, self._match_by_label(message, slots, labelled, stale))
        self._update(message, np.flatnonzero(unknown & (slots != _NONE)), slots)
        self._reacquire(message, slots, np.setdiff1d(free, slots), new[slots[new] == _NONE])
        new = np.array([*new[slots[new] == _NONE], *stale], dtype=np.int64)
        slots[new] = len(self.means) + np.arange(len(new))
        self.deleted += slots[stale].tolist()  # with rows, so that other messages of their partition find them
        self.means = np.concatenate([self.means, means[new]])
        self.covariances = np.concatenate([self.covariances, covariances[new]])
        self.seen = np.concatenate([self.seen, message.history.times[new, 0]])
        self.sightings = np.concatenate([self.sightings, message.sightings[new]])
        self.lost = np.concatenate([self.lost, message.aliases[new] == 0])
        for pair, slot in zip(labels, slots.tolist(), strict=True):
            if slot != _NONE:
                self._enter(pair, slot)
        return slots

    def _match_by_label(self, message: Message, slots: Indices, labelled: Indices, stale: list[int]) -> list[int]:
        """Fill in the rows `labelled` of tracks without a match; return those with a row that matches a later one."""
        outdated, seen = [], message.history.times[:, 0]
        for k in np.flatnonzero((slots == _NONE) & (labelled != _NONE)).tolist():
            taker = np.flatnonzero(slots == labelled[k])
            if len(taker) == 0 and k not in stale:
                slots[k] = labelled[k]
            elif len(taker) and seen[k] < seen[taker[0]]:
                outdated.append(k)
        return outdated

    def _update(self, message: Message, tracks: Indices, slots: Indices) -> None:
        """Replace the belief of rows that these tracks continue, where the person was seen later."""
        for k in tracks[message.history.times[tracks, 0] > self.seen[slots[tracks]]].tolist():
            self._replace(int(slots[k]), message, k)

    def _replace(self, row: int, message: Message, track: int) -> None:
        """Replace the belief of a row by that of a neighbour's track."""
        means, covariances = message.beliefs()
        self.means[row], self.covariances[row] = means[track], covariances[track]
        self.seen[row], self.sightings[row] = message.history.times[track, 0], message.sightings[track]
        self.lost[row] = message.aliases[track] == 0

    def _reacquire(self, message: Message, slots: Indices, free: Indices, new: Indices) -> None:
        """Match lost tracks of one side with those seen lately of the other: own rows `free`, received tracks `new`."""
        means, covariances = message.beliefs()
        lost = message.aliases[new] == 0
        ours, theirs = free[self.lost[free]], new[~lost]
        found = means[theirs], covariances[theirs], message.sightings[theirs]
        for b, k in self._reacquisitions(found, (self.means[ours], self.covariances[ours], self.sightings[ours])):
            row, track = int(ours[k]), int(theirs[b])
            slots[track] = row
            self.reacquired.append(row)
            self._replace(row, message, track)
        ours, theirs = np.setdiff1d(free[~self.lost[free]], slots), new[lost]
        found = self.means[ours], self.covariances[ours], self.sightings[ours]
        for b, k in self._reacquisitions(found, (means[theirs], covariances[theirs], message.sightings[theirs])):
            slots[theirs[k]] = ours[b]
            self.reacquired.append(int(ours[b]))

    def _reacquisitions(
        self, seen: tuple[Array, Array, Array], lost: tuple[Array, Array, Array]
    ) -> list[tuple[int, int]]:
        """Pairs of a track seen lately and a lost one that it may continue, from beliefs and sightings."""
        if len(seen[0]) == 0 or len(lost[0]) == 0:
            return []
        now = float(seen[2][:, 2].max())
        return reacquisitions(seen[:2], lost[:2], lost[2], now=now, max_speed=self.max_speed)

    def labels(self) -> tuple[Indices, Indices]:
        """Id and alias of each row (T,); both -1 for rows that are left out.

        Each id, the smallest first, goes to one row without an id: to that with the smallest alias, and to one of
        alias 0 only without others. Lost tracks with different ids in two partitions take one that is left.
        """
        ids, aliases = np.full((2, len(self.means)), _NONE)
        for id, claims in sorted(self.by_id.items()):
            free = [(alias, row) for row, (_, alias) in claims.items() if row not in self.deleted]
            late = [(alias, row) for alias, row in free if alias] or free
            unlabelled = [(alias, row) for alias, row in late if ids[row] == _NONE]
            if unlabelled:
                alias, row = min(unlabelled)
                ids[row], aliases[row] = id, alias or self._alias(row)
        taken = set(ids.tolist())
        for alias, claims in sorted(self.by_alias.items()):
            for row in claims:
                if alias not in {0, *taken} and ids[row] == _NONE and row not in self.deleted:
                    ids[row] = aliases[row] = alias
                    taken.add(alias)
        for row in self.mislabelled:
            unused = [id for id, claims in sorted(self.by_id.items()) if row in claims and id not in taken]
            if unused and ids[row] == _NONE and row not in self.deleted:
                ids[row], aliases[row] = unused[0], 0
                taken.add(unused[0])
        return ids, aliases

    def _alias(self, row: int) -> int:
        """Smallest alias of a row, 0 if it has none."""
        return min((alias for alias, claims in self.by_alias.items() if alias and row in claims), default=0)

    def _enter(self, label: tuple[int, int], slot: int) -> None:
        id, alias = label
        self.slot[label] = slot
        for claims in (self.by_id.setdefault(id, {}), self.by_alias.setdefault(alias, {})):
            claims[slot] = min(claims.get(slot, (True, 0)), (alias == 0, alias))

    def _match_labelled(self, message: Message, slots: Indices) -> list[int]:
        """Match tracks by beliefs and by common ids or aliases, in one assignment; return those that have strayed.

        Tracks of one label in two partitions of a fleet need not be one person: in one partition the track may have
        strayed and the person may have got a new track. So a label adds to the likelihood of the beliefs.
        """
        new = np.flatnonzero(slots == _NONE)
        free = np.setdiff1d(np.arange(len(self.means)), [*slots.tolist(), *self.deleted])
        labels = _labels(message)
        common = np.array([np.isin(free, self._known(*labels[k])) for k in new], dtype=np.bool_)
        if not common.any():
            return []
        means, covariances = message.beliefs()
        ours, theirs = (self.means[free], self.covariances[free]), (means[new], covariances[new])
        distance, cost = pair_distances(theirs, ours)
        near = distance <= self.gate
        # Labels exclude a pair if one of the two is lost and the other side sees the person of its label, or if both
        # are lost and have their label in common with others.
        lost = message.aliases[new] == 0
        both = lost[:, None] & self.lost[free]
        outdated = np.array([self._outdated(labels[k]) for k in new])[:, None] | self._overtaken(free, labels)
        shared = np.any(common, axis=1)[:, None] | np.any(common, axis=0)
        excluded = ~common & (outdated | both & shared)
        # Where one side has lost a person that the other sees, the label is no better than a new track there.
        likelier = common & (lost[:, None] == self.lost[free]) | crossed_labels(common, near)
        cost -= _LABELLED * likelier
        for a, b in most_pairs(near & ~excluded, cost):
            slots[new[a]] = free[b]
        # Each side may have taken one person for another and then lost both: only beliefs can match these.
        rest = excluded & both & (slots[new] == _NONE)[:, None] & ~np.isin(free, slots)
        for a, b in most_pairs(near & rest, cost):
            slots[new[a]] = free[b]
            self.mislabelled.append(int(free[b]))
        return self._strayed(message, slots, new, free, common & near)

    def _strayed(self, message: Message, slots: Indices, new: Indices, free: Indices, same: Flags) -> list[int]:
        """Tracks of the neighbour, and own rows (added to `deleted`), with a match that has a later sighting.

        same (new, free): flags of pairs with a common id or alias and beliefs that agree.
        """
        stale, taker = [], {int(slot): k for k, slot in enumerate(slots.tolist()) if slot != _NONE}
        theirs = message.history.times[:, 0]
        for a, b in np.argwhere(same).tolist():
            track, row = int(new[a]), int(free[b])
            other = taker.get(row)
            if slots[track] == _NONE and other is not None and theirs[track] < theirs[other]:
                stale.append(track)
            elif other is None and slots[track] != _NONE and self.seen[row] < self.seen[slots[track]]:
                self.deleted.append(row)
        return stale

    def _known(self, id: int, alias: int) -> list[int]:
        """Rows with an id or alias."""
        return [*self.by_id.get(id, ()), *(self.by_alias.get(alias, ()) if alias else ())]

    def _outdated(self, label: tuple[int, int]) -> bool:
        """Test if a track is lost, but a row of its id is not."""
        id, alias = label
        return alias == 0 and not all(self.lost[row] for row in self.by_id.get(id, ()))

    def _overtaken(self, rows: Indices, labels: list[tuple[int, int]]) -> Flags:
        """Flags of lost rows (R,) with the id of a label that has an alias, so is not lost."""
        known = [row for id, alias in labels if alias for row in self.by_id.get(id, ())]
        return np.asarray(self.lost[rows] & np.isin(rows, known))


def _labels(message: Message) -> list[tuple[int, int]]:
    """Ids and aliases of a message's tracks."""
    return list(zip(message.ids.tolist(), message.aliases.tolist(), strict=True))
