"""Which tracks of different UAVs are the same person: ids agreed without a server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.fusion.message import Message, alike, companies_meet
from tracking.fusion.track_matching import crosswise, likeliest, matches
from tracking.management.deletion import Indices
from tracking.management.reacquisition import recoveries
from tracking.numerics.compiled import Array
from tracking.numerics.matrices import log_determinant, squared_distance

_NOBODY = -1  # row of a track that is left out
_NAMED = 3.0  # what a common name is worth, in twice a log-likelihood: it is right some four times as often as not


def aligned(own: Message, received: Sequence[Message], gate: float, max_speed: float) -> list[Message]:
    """The messages, own first, with the same tracks in the same rows.

    Tracks of one id and alias are the same, unless companies meet and the tracks were not seen last at one time: then
    beliefs that agree better come first. The others are matched, one assignment per neighbour, by their beliefs,
    which must agree in squared distance up to `gate`; if any have one id or alias, by what that says besides. What then
    agrees with a track of its name, but was seen earlier than the one which that is matched to, ends: it strayed.
    If one of two was not seen of late, they match if somebody lost there can have got here at `max_speed` m/s.
    Lost tracks whose namesakes are known match others last: each side may have taken one person for another. Of those
    who have lost a person, only who saw them last tells where they may be.
    What finds no match is taken over without any share of ours, so that nothing counts twice.
    The smallest id stays. Where it would name two people, as when a network that was split heals, the track of
    the smaller alias keeps it and the other one goes by its alias, unless it was not seen of late: then it ends. All
    this depends on what the tracks are called, not on who decides, so all UAVs decide alike.
    """
    if alike([own, *received]):
        return [own, *received]
    deleted = _latest([own, *received])
    messages = [_surviving(m, deleted) for m in (own, *received)]
    # Whoever hears the same matches the same, in the same order.
    first, *others = sorted(range(len(messages)), key=lambda k: messages[k].uav)
    met = companies_meet(messages)
    roster = _Roster(messages[first], gate, max_speed, met)
    slots = {first: np.arange(len(messages[first].ids)), **{k: roster.admit(messages[k]) for k in others}}
    ids, aliases = roster.names()
    order = np.argsort(ids, kind="stable")
    order = order[np.searchsorted(ids[order], 0) :]
    row = np.full(len(ids) + 1, _NOBODY)  # the last for those left out before
    row[order] = np.arange(len(order))
    out, last = [], np.full(len(ids) + 1, -np.inf)  # s, the latest sighting of each row
    for k, message in enumerate(messages):
        np.maximum.at(last, slots[k], message.sightings[:, 2])
    for k, message in enumerate(messages):
        slot = slots[k]
        older = met & (message.sightings[:, 2] < last[slot])
        outdated = (message.aliases == 0) & (older | np.isin(slot, roster.renewed))
        rows = np.where(outdated, _NOBODY, row[slot])
        kept = np.flatnonzero(rows != _NOBODY)
        left = message if len(kept) == len(rows) else message.only(kept)
        out.append(left.at(rows[kept], ids[order], aliases[order]))
    return out


def _latest(messages: Sequence[Message]) -> tuple[tuple[int, float], ...]:
    latest: dict[int, float] = {}
    for m in messages:
        for id, time in m.deleted:
            latest[id] = max(time, latest.get(id, time))
    return tuple(sorted(latest.items()))


def _surviving(message: Message, deleted: tuple[tuple[int, float], ...]) -> Message:
    """Without tracks that somebody gave up after they were last seen."""
    if message.deleted == deleted:
        return message
    given_up = dict(deleted)
    last_seen = message.evidence.times[:, 0].tolist()
    pairs = zip(message.ids.tolist(), last_seen, strict=True)
    keep = np.array([seen >= given_up.get(id, -np.inf) for id, seen in pairs], dtype=np.bool_)
    return replace(message.only(np.flatnonzero(keep)), deleted=deleted)


class _Roster:
    """Rows of a table of tracks that fills up as neighbours are admitted."""

    def __init__(self, own: Message, gate: float, max_speed: float, met: bool) -> None:
        self.met = met  # whether UAVs of different companies hear one another
        self.gate, self.max_speed = gate, max_speed
        self.renewed: list[int] = []  # rows of which only those tell that saw the person of late
        self.swapped: list[int] = []  # rows of lost people whom each side called by a name that may be another's
        self.left: list[int] = []  # rows of tracks whose person another row has
        every = np.arange(len(own.ids))
        self.means, self.covariances = (a[every] for a in own.beliefs())
        self.seen, self.sightings, self.lost = own.evidence.times[every, 0], own.sightings[every], own.aliases == 0
        # Every id and alias heard this round, with the rows it was heard for, and both together with the only row.
        self.slot: dict[tuple[int, int], int] = {}
        self.by_id: dict[int, dict[int, tuple[bool, int]]] = {}  # for each row the alias, those of 0 come last
        self.by_alias: dict[int, dict[int, tuple[bool, int]]] = {}
        for k, called in enumerate(_called(own)):
            self._enter(called, k)

    def admit(self, message: Message) -> Indices:
        """Rows of a neighbour's tracks (T,)."""
        called = _called(message)
        means, covariances = message.beliefs()
        slots = np.array([self.slot.get(pair, _NOBODY) for pair in called], dtype=np.int64)
        # A lost track is no news of a row that somebody saw of late: another of theirs may be that person.
        slots[(message.aliases == 0) & ~np.append(self.lost, True)[slots]] = _NOBODY
        named = slots.copy()
        if self.met:
            # Seen at other times it may be somebody else by now: others may have given the name on less than is known.
            # So may those of no alias, which says nothing of who made the track.
            elsewhen = message.evidence.times[:, 0] != np.append(self.seen, np.nan)[slots]
            slots[elsewhen | (message.aliases == 0)] = _NOBODY
        unknown = slots == _NOBODY
        stale = self._recognise(message, slots)
        free = np.setdiff1d(np.arange(len(self.means)), [*slots.tolist(), *self.left])
        new = np.array(
            [k for k in np.flatnonzero(slots == _NOBODY) if k not in stale and not self._outdated(called[k])],
            dtype=np.int64,
        )
        pairs = matches((self.means[free], self.covariances[free]), (means[new], covariances[new]), self.gate)
        for a, b in pairs:
            slots[new[b]] = free[a]
        new = np.setdiff1d(new, self._by_name(message, slots, named, stale))
        self._update(message, np.flatnonzero(unknown & (slots != _NOBODY)), slots)
        self._renew(message, slots, np.setdiff1d(free, slots), new[slots[new] == _NOBODY])
        new = np.array([*new[slots[new] == _NOBODY], *stale], dtype=np.int64)
        slots[new] = len(self.means) + np.arange(len(new))
        self.left += slots[stale].tolist()  # with rows, so that they are known when others of their company name them
        self.means = np.concatenate([self.means, means[new]])
        self.covariances = np.concatenate([self.covariances, covariances[new]])
        self.seen = np.concatenate([self.seen, message.evidence.times[new, 0]])
        self.sightings = np.concatenate([self.sightings, message.sightings[new]])
        self.lost = np.concatenate([self.lost, message.aliases[new] == 0])
        for pair, slot in zip(called, slots.tolist(), strict=True):
            if slot != _NOBODY:
                self._enter(pair, slot)
        return slots

    def _by_name(self, message: Message, slots: Indices, named: Indices, stale: list[int]) -> list[int]:
        """Fill in the rows `named` of tracks that agree with none; those whose row a track seen later agrees with."""
        outdated, seen = [], message.evidence.times[:, 0]
        for k in np.flatnonzero((slots == _NOBODY) & (named != _NOBODY)).tolist():
            taker = np.flatnonzero(slots == named[k])
            if len(taker) == 0 and k not in stale:
                slots[k] = named[k]
            elif len(taker) and seen[k] < seen[taker[0]]:
                outdated.append(k)
        return outdated

    def _update(self, message: Message, tracks: Indices, slots: Indices) -> None:
        """Let rows that these tracks were found to continue be compared by whichever saw the person last."""
        for k in tracks[message.evidence.times[tracks, 0] > self.seen[slots[tracks]]].tolist():
            self._compare_by(int(slots[k]), message, k)

    def _compare_by(self, row: int, message: Message, track: int) -> None:
        """Let a row be compared by one of their tracks."""
        means, covariances = message.beliefs()
        self.means[row], self.covariances[row] = means[track], covariances[track]
        self.seen[row], self.sightings[row] = message.evidence.times[track, 0], message.sightings[track]
        self.lost[row] = message.aliases[track] == 0

    def _renew(self, message: Message, slots: Indices, free: Indices, new: Indices) -> None:
        """Fill in rows of whom one side knows of late and the other does not: our rows `free`, their tracks `new`."""
        means, covariances = message.beliefs()
        lost = message.aliases[new] == 0
        ours, theirs = free[self.lost[free]], new[~lost]
        found = means[theirs], covariances[theirs], message.sightings[theirs]
        for b, k in self._found(found, (self.means[ours], self.covariances[ours], self.sightings[ours])):
            row, track = int(ours[k]), int(theirs[b])
            slots[track] = row
            self.renewed.append(row)
            self._compare_by(row, message, track)
        ours, theirs = np.setdiff1d(free[~self.lost[free]], slots), new[lost]
        found = self.means[ours], self.covariances[ours], self.sightings[ours]
        for b, k in self._found(found, (means[theirs], covariances[theirs], message.sightings[theirs])):
            slots[theirs[k]] = ours[b]
            self.renewed.append(int(ours[b]))

    def _found(self, seen: tuple[Array, Array, Array], lost: tuple[Array, Array, Array]) -> list[tuple[int, int]]:
        """Pairs of tracks seen of late and lost ones that may be the same person, of beliefs and sightings."""
        if len(seen[0]) == 0 or len(lost[0]) == 0:
            return []
        now = float(seen[2][:, 2].max())
        return recoveries(seen[:2], lost[:2], lost[2], now=now, max_speed=self.max_speed)

    def names(self) -> tuple[Indices, Indices]:
        """Id and alias of each row (T,); both -1 for rows that are left out.

        Each id, the smallest first, goes to one row without a name: to that with the smallest alias. One of alias 0
        gets it where there is no other. Lost people whom two sides call otherwise take a name of theirs that is left.
        """
        ids, aliases = np.full((2, len(self.means)), _NOBODY)
        for id, claims in sorted(self.by_id.items()):
            free = [(alias, row) for row, (_, alias) in claims.items() if row not in self.left]
            late = [(alias, row) for alias, row in free if alias] or free
            unnamed = [(alias, row) for alias, row in late if ids[row] == _NOBODY]
            if unnamed:
                alias, row = min(unnamed)
                ids[row], aliases[row] = id, alias or self._alias(row)
        taken = set(ids.tolist())
        for alias, claims in sorted(self.by_alias.items()):
            for row in claims:
                if alias not in {0, *taken} and ids[row] == _NOBODY and row not in self.left:
                    ids[row] = aliases[row] = alias
                    taken.add(alias)
        for row in self.swapped:
            unused = [id for id, claims in sorted(self.by_id.items()) if row in claims and id not in taken]
            if unused and ids[row] == _NOBODY and row not in self.left:
                ids[row], aliases[row] = unused[0], 0
                taken.add(unused[0])
        return ids, aliases

    def _alias(self, row: int) -> int:
        """The smallest alias of a row, 0 if it has none."""
        return min((alias for alias, claims in self.by_alias.items() if alias and row in claims), default=0)

    def _enter(self, called: tuple[int, int], slot: int) -> None:
        id, alias = called
        self.slot[called] = slot
        for claims in (self.by_id.setdefault(id, {}), self.by_alias.setdefault(alias, {})):
            claims[slot] = min(claims.get(slot, (True, 0)), (alias == 0, alias))

    def _recognise(self, message: Message, slots: Indices) -> list[int]:
        """Fill in the rows of tracks of which some are known by id or alias; those that are somebody else's leftovers.

        What two parts of a fleet call alike need not be one person: one of them may have kept the name for a track that
        strayed and have made a new one of the person. So a name is evidence beside the beliefs, and one assignment
        weighs both.
        """
        new = np.flatnonzero(slots == _NOBODY)
        free = np.setdiff1d(np.arange(len(self.means)), [*slots.tolist(), *self.left])
        called = _called(message)
        named = np.array([np.isin(free, self._known(*called[k])) for k in new], dtype=np.bool_)
        if not named.any():
            return []
        means, covariances = message.beliefs()
        ours, theirs = (self.means[free], self.covariances[free]), (means[new], covariances[new])
        spreads = theirs[1][:, None] + ours[1][None]
        distance = squared_distance(theirs[0][:, None] - ours[0][None], spreads)
        near = distance <= self.gate
        # Names speak against a pair if one of the two is lost and the other side sees whom it is named after, or both
        # are lost and have namesakes.
        lost = message.aliases[new] == 0
        both = lost[:, None] & self.lost[free]
        outdated = np.array([self._outdated(called[k]) for k in new])[:, None] | self._overtaken(free, called)
        namesakes = np.any(named, axis=1)[:, None] | np.any(named, axis=0)
        against = ~named & (outdated | both & namesakes)
        # Where one side has lost the person whom the other sees, its name is no better than a newcomer it met there.
        told = named & (lost[:, None] == self.lost[free]) | crosswise(named, near)
        cost = distance + log_determinant(spreads) - _NAMED * told
        for a, b in likeliest(near & ~against, cost):
            slots[new[a]] = free[b]
        # But each side may have taken one person for another. Of whom it then lost, only beliefs tell.
        rest = against & both & (slots[new] == _NOBODY)[:, None] & ~np.isin(free, slots)
        for a, b in likeliest(near & rest, cost):
            slots[new[a]] = free[b]
            self.swapped.append(int(free[b]))
        return self._leave(message, slots, new, free, named & near)

    def _leave(
        self, message: Message, slots: Indices, new: Indices, free: Indices, same: NDArray[np.bool_]
    ) -> list[int]:
        """Their tracks without a row, and ours (into `left`) whose person was seen later by what took their place.

        same (new, free): which tracks have a common name and beliefs that agree.
        """
        stale, taker = [], {int(slot): k for k, slot in enumerate(slots.tolist()) if slot != _NOBODY}
        theirs = message.evidence.times[:, 0]
        for a, b in np.argwhere(same).tolist():
            track, row = int(new[a]), int(free[b])
            other = taker.get(row)
            if slots[track] == _NOBODY and other is not None and theirs[track] < theirs[other]:
                stale.append(track)
            elif other is None and slots[track] != _NOBODY and self.seen[row] < self.seen[slots[track]]:
                self.left.append(row)
        return stale

    def _known(self, id: int, alias: int) -> list[int]:
        """Rows that were called by an id or alias."""
        return [*self.by_id.get(id, ()), *(self.by_alias.get(alias, ()) if alias else ())]

    def _outdated(self, called: tuple[int, int]) -> bool:
        """Whether a track is a person of whom others have later news."""
        id, alias = called
        return alias == 0 and not all(self.lost[row] for row in self.by_id.get(id, ()))

    def _overtaken(self, rows: Indices, called: list[tuple[int, int]]) -> NDArray[np.bool_]:
        """Which rows (R,) are of lost people of whom these tracks are later news."""
        known = [row for id, alias in called if alias for row in self.by_id.get(id, ())]
        return np.asarray(self.lost[rows] & np.isin(rows, known))


def _called(message: Message) -> list[tuple[int, int]]:
    return list(zip(message.ids.tolist(), message.aliases.tolist(), strict=True))
