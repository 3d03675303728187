"""Track-to-track association: tracks of different UAVs that are of one person, and their common id."""

import math
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from tracking.fusion.message import (
    IDS_PER_SCAN,
    EndedTrack,
    find_beliefs,
    find_latest_sightings,
    is_new_id,
    new_id,
)
from tracking.fusion.mixing import FleetColumns
from tracking.management.reacquisition import farthest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.compiled import compiled, merged
from tracking.numerics.distances import gaussian_costs, length
from tracking.numerics.exponential import log
from tracking.numerics.stacks import elementwise
from tracking.track import DETECTED_AT, SIGHTED_AT, SURE_AT

_SAME_ID = 1.5  # log-likelihood ratio of a common id, which partitions give more likely to one person than to two
_UNKNOWN = 1e-5  # 1/m², density of people for which only one of two UAVs has a track
_TURNED = 0.05  # probability that an unseen person is anywhere within reach, rather than where the belief is
_IDS = 1 << 52  # above all ids, so that one number stands for a leader and an id
_BITS = 62  # of a number that says which messages have a track


class JointTracks(NamedTuple):
    """The tracks of N messages after their association."""

    ids: Indices  # (T,), ascending
    keys: Indices  # (T, 2), as in messages
    rows: Indices  # (N, T) row of each track in each message; -1 in a message that has it not, or not its latest state
    deleted: tuple[EndedTrack, ...]  # in any of the messages


class _Table(NamedTuple):
    """The tracks of N messages before their association, G in all: one for each key, in the order of keys."""

    keys: Indices  # (G, 2)
    rows: Indices  # (N, G), as in `JointTracks`
    # (N, G) messages that have a track's latest sighting before this scan; if there are two, only the later one counts
    valid: Flags
    seen: Array  # (G,) s, last sure detection
    source: Indices  # (G,) first of the messages with that detection
    named: Indices  # (P,) tracks, ascending, again for each id that messages give it
    given: Indices  # (P,) these ids, ascending for each track


class _Ended(NamedTuple):
    """The tracks that N messages say to have ended."""

    ids: Indices  # (D,), ascending
    until: Array  # (D,) s
    known: Flags  # (N,) messages that contain all of them, and so have no track whose last detection they make void


class LatestTracks(NamedTuple):
    """Tracks of G people, each from the UAV with its last detection."""

    means: Array  # (G, 4)
    covariances: Array  # (G, 4, 4)
    sightings: Array  # (G, 3) position [m] and time [s] of the last sure detection


def associate_tracks(
    columns: FleetColumns,
    told: Sequence[int],
    deleted: Sequence[tuple[EndedTrack, ...]],
    scan: tuple[int, float],
    max_speed: float,
) -> JointTracks:
    """Associate the tracks of N messages.

    Within a partition of the fleet, tracks of one id are of one person. Other tracks are joined by the ratio of the
    likelihoods that both are of one person and that they are of two, but never if one UAV made the last detection of
    both.

    columns: of all messages; told: the N messages among them, ascending by UAV; deleted: of each of these N; scan:
    number and time [s]; max_speed: largest speed of people [m/s].
    """
    messages, (number, now) = np.array(told), scan
    # `dict` keeps the latest time of each id, because the last of equal keys counts.
    alike = deleted.count(deleted[0]) == len(deleted)
    ends = deleted[0] if alike else tuple(EndedTrack(*e) for e in dict(sorted({*chain(*deleted)})).items())
    ended = _Ended(
        np.array([id for id, _ in ends], dtype=np.int64),
        np.array([until for _, until in ends], dtype=float),
        np.array([d == ends for d in deleted]) if not alike else np.ones(len(told), dtype=np.bool_),
    )
    at_once, ids, keys, rows = _associate_at_once(columns, messages, ended, now)
    if not at_once:
        table = _tabulate(columns, messages, ended, now)
        group, over = _group(columns, messages, table, scan, max_speed)
        ids, keys, rows = _arrange(table, group, over, _choose_ids(table, group, over, number))
    return JointTracks(ids, keys, rows, ends)


@compiled
def _associate_at_once(
    columns: FleetColumns, messages: Indices, ended: _Ended, now: float
) -> tuple[bool, Indices, Indices, Indices]:
    """True and what `_arrange` returns; False if tracks have to be compared, because they may be of one person."""
    table = _tabulate(columns, messages, ended, now)
    alike = _find_common_ids(table.named, table.given)
    apart = _find_apart(table.valid, _find_comparable(table.valid, alike))
    if len(alike.first) + len(apart.first) > 0:
        return False, table.given, table.keys, table.rows
    group, over, ids = (
        np.arange(len(table.seen)),
        np.zeros(len(table.seen), np.bool_),
        np.empty(len(table.seen), np.int64),
    )
    for p in range(len(table.named) - 1, -1, -1):
        ids[table.named[p]] = table.given[p]  # the smallest one
    kept, keys, rows = _arrange(table, group, over, ids)
    return True, kept, keys, rows


@compiled
def _tabulate(columns: FleetColumns, messages: Indices, ended: _Ended, now: float) -> _Table:
    """Tabulate the tracks of messages, without tracks whose last detection a deletion has made void."""
    whole, rows = _list_tracks(columns, messages, ended)
    count, tracks = rows.shape
    keys = np.empty((tracks, 2), np.int64)
    valid, seen, source = np.zeros((count, tracks), np.bool_), np.full(tracks, -np.inf), np.zeros(tracks, np.int64)
    named, given = np.empty(rows.size, np.int64), np.empty(rows.size, np.int64)
    end = 0
    for g in range(tracks):
        keys[g, 0], keys[g, 1] = divmod(whole[g], _IDS)
        first, before = end, -np.inf
        for s in range(count):
            m, r = messages[s], rows[s, g]
            if r >= 0:
                sighted = columns.sightings[m, r, SIGHTED_AT]
                before = max(before, sighted)
                after = now if columns.times[m, r, SURE_AT] >= now else sighted
                if after > seen[g] or end == first:
                    seen[g], source[g] = after, s
                end = _insert(named, given, first, end, g, columns.ids[m, r])
        for s in range(count):
            valid[s, g] = rows[s, g] >= 0 and columns.sightings[messages[s], rows[s, g], SIGHTED_AT] >= before
    return _Table(keys, rows, valid, seen, source, named[:end].copy(), given[:end].copy())


@merged
def _list_tracks(columns: FleetColumns, messages: Indices, ended: _Ended) -> tuple[Indices, Indices]:
    """The keys (G,) of the tracks of N messages as one number each, ascending, and their rows (N, G); -1 for none."""
    count, most = len(messages), columns.ids.shape[1]
    codes, places, held = (
        np.empty((count, most), np.int64),
        np.empty((count, most), np.int64),
        np.zeros(count, np.int64),
    )
    for s in range(count):
        held[s] = _list_codes(columns, messages[s], ended, ended.known[s], codes[s], places[s])
    whole = codes[0, : held[0]].copy()
    for s in range(1, count):
        whole = _unite(whole, codes[s, : held[s]])
    rows = np.full((count, len(whole)), -1)
    for s in range(count):
        g = 0
        for k in range(held[s]):
            while whole[g] != codes[s, k]:
                g += 1
            rows[s, g] = places[s, k]
    return whole, rows


@compiled
def _list_codes(columns: FleetColumns, m: int, ended: _Ended, informed: bool, codes: Indices, rows: Indices) -> int:
    """List the keys of a message's tracks as one number each, ascending, and their rows; returns how many there are."""
    count = 0
    for r in range(columns.counts[m]):
        if not informed:
            at = np.searchsorted(ended.ids, columns.ids[m, r])
            gone = at < len(ended.ids) and ended.ids[at] == columns.ids[m, r]
            if gone and columns.times[m, r, DETECTED_AT] < ended.until[at]:
                continue
        code, place = columns.keys[m, r, 0] * _IDS + columns.keys[m, r, 1], count
        while place > 0 and codes[place - 1] > code:  # most are in order already
            codes[place], rows[place] = codes[place - 1], rows[place - 1]
            place -= 1
        codes[place], rows[place] = code, r
        count += 1
    return count


@compiled
def _unite(first: Indices, second: Indices) -> Indices:
    """All numbers, ascending, of two arrays that are ascending."""
    if len(first) == len(second) and np.all(first == second):
        return first
    out, a, b, count = np.empty(len(first) + len(second), np.int64), 0, 0, 0
    while a < len(first) or b < len(second):
        here = b == len(second) or (a < len(first) and first[a] <= second[b])
        there = a == len(first) or (b < len(second) and second[b] <= first[a])
        out[count] = first[a] if here else second[b]
        a, b, count = a + here, b + there, count + 1
    return out[:count].copy()


@compiled
def _insert(named: Indices, given: Indices, first: int, end: int, track: int, id: int) -> int:
    """Insert an id of a track into its ascending ones from `first` to `end`, unless it is there; returns the end."""
    at = first
    while at < end and given[at] < id:
        at += 1
    if at < end and given[at] == id:
        return end
    for k in range(end, at, -1):
        named[k], given[k] = named[k - 1], given[k - 1]
    named[at], given[at] = track, id
    return end + 1


@compiled
def _arrange(table: _Table, group: Indices, ends: Flags, ids: Indices) -> tuple[Indices, Indices, Indices]:
    """The `ids`, `keys` and `rows` of `JointTracks` from the group, the end and the id (G,) of each track."""
    order = np.argsort(ids, kind="mergesort")
    place, firsts, count = np.full(len(ids), -1), np.empty(len(ids), np.int64), 0
    for k in range(len(order)):
        g = order[k]
        if ids[g] >= 0:
            if count == 0 or ids[firsts[count - 1]] != ids[g]:
                firsts[count] = g
                count += 1
            place[g] = count - 1
    latest = np.full(len(ids), -np.inf)  # of each group
    for g in range(len(ids)):
        latest[group[g]] = max(latest[group[g]], table.seen[g])
    rows = np.full((len(table.rows), count), -1)
    for s in range(len(rows)):
        for g in range(len(ids)):
            if table.valid[s, g] and not ends[g] and table.seen[g] >= latest[group[g]]:
                rows[s, place[g]] = table.rows[s, g]
    kept, keys = np.empty(count, np.int64), np.empty((count, 2), np.int64)
    for k in range(count):
        kept[k], keys[k, 0], keys[k, 1] = ids[firsts[k]], table.keys[firsts[k], 0], table.keys[firsts[k], 1]
    return kept, keys, rows


class Pairs(NamedTuple):
    """Rows of the two tracks of each of P pairs."""

    first: Indices  # (P,)
    second: Indices  # (P,)


def likelihood_ratios(states: LatestTracks, pairs: Pairs, max_speed: float) -> Array:
    """Logarithms (P,) of the likelihood that two tracks are of one person, over that of two people.

    If both are of one person, the states are equal, or the person has turned while out of sight and is anywhere within
    reach of the last detection. If they are of two people, a UAV with one track does not know the other person, who may
    be at any place and have any velocity.
    Note: the larger of the two densities of one person counts, rather than their weighted sum. The errors of two tracks
    of one person are taken as independent, although both contain the person's process noise [BarShalom81].
    """
    first, second = pairs
    differences = states.means[first] - states.means[second]
    cost = gaussian_costs(differences, states.covariances[first] + states.covariances[second])
    elsewhere = log(_UNKNOWN / (math.pi * max_speed * max_speed))
    ratios = -0.5 * cost - 2.0 * log(2.0 * math.pi) - elsewhere
    for one_way in (pairs, Pairs(second, first)):
        reach, within = _compute_reach(states, one_way, max_speed)
        ratios = np.maximum(ratios, np.where(within, _rate_turned(reach), -np.inf))
    return ratios


@elementwise
@compiled
def _rate_turned(reach: Array) -> Array:
    """Logarithm of the likelihood ratio of a person that has turned and is anywhere within reach [m]."""
    out = np.empty(len(reach))
    for k in range(len(reach)):
        out[k] = log(_TURNED / (math.pi * reach[k] * reach[k] * _UNKNOWN))
    return out


def _compute_reach(states: LatestTracks, pairs: Pairs, max_speed: float) -> tuple[Array, Flags]:
    """Distances (P,) [m] that a person can move from the first track's last detection to the second's, and flags (P,).

    A flag is set if the second track was seen later, and within this distance.
    """
    places, seen = states.sightings[:, :2], states.sightings[:, SIGHTED_AT]
    unseen = seen[pairs.second] - seen[pairs.first]
    reach = farthest(np.maximum(unseen, 0.0), max_speed)
    gap = length(places[pairs.second] - places[pairs.first])
    return reach, (unseen > 0.0) & (gap <= reach)


def _find_last_seen(
    columns: FleetColumns, messages: Indices, table: _Table, tracks: Indices, now: float
) -> LatestTracks:
    """States of `tracks`, each from the message with the latest detection. Of equals, the first message counts."""
    source = table.source[tracks]
    at = messages[source], table.rows[source, tracks]
    means, covariances = find_beliefs(columns.shares[at], columns.novel[at])
    sightings = find_latest_sightings(columns.sightings[at], columns.times[at], means, now)
    return LatestTracks(means, covariances, sightings)


def _group(
    columns: FleetColumns, messages: Indices, table: _Table, scan: tuple[int, float], max_speed: float
) -> tuple[Indices, Flags]:
    """Group (G,) of each track, given by one of its tracks, and flags (G,) of tracks that end.

    A group out of sight ends if its only id has another track that was seen later, within reach.
    """
    group, ends = np.arange(len(table.seen)), np.zeros(len(table.seen), dtype=np.bool_)
    alike = _find_common_ids(table.named, table.given)
    some = _find_comparable(table.valid, alike)
    place = np.zeros(len(group), dtype=np.int64)
    place[some] = np.arange(len(some))
    alike, apart = Pairs(place[alike.first], place[alike.second]), _find_apart(table.valid, some)
    holders = table.valid[:, some].T
    states = _find_last_seen(columns, messages, table, some, scan[1])
    ratios = _rate_pairs(states, apart, alike, max_speed)
    joined = _join(states, ratios, holders, is_new_id(table.keys[some, 1], scan[0]))
    group[some] = some[joined]
    others = joined[alike.first] != joined[alike.second]
    later = np.zeros(len(some), dtype=np.bool_)
    later[alike.first[others & _compute_reach(states, alike, max_speed)[1]]] = True
    for rows in [joined == g for g in np.unique(joined[later])]:
        if later[rows].all() and len(np.unique(table.given[np.isin(table.named, some[rows])])) == 1:
            ends[some[rows]] = True
    return group, ends


def _join(states: LatestTracks, ratios: Array, holders: Flags, begun: Flags) -> Indices:
    """Group (G,) of each track, given by one of its tracks.

    ratios (G, G) as from `_rate_pairs`; holders (G, N): flags of the UAVs that hold each track; begun (G,): flags of
    tracks that began in this scan. UAV by UAV, one assignment joins the tracks that no earlier UAV holds to existing
    groups. New tracks come last, because a UAV's new track and its lost one may both be of a person that another UAV
    tracks.
    """
    seen = states.sightings[:, SIGHTED_AT]
    group, known = np.arange(len(seen)), np.zeros(len(seen), dtype=np.bool_)
    for held in (*(holders & ~begun[:, None]).T, *(holders & begun[:, None]).T):
        new = np.flatnonzero(held & ~known)
        old = np.unique(group[known & np.any(ratios[new] >= 0.0, axis=0)])  # groups that a new track may join
        known[new] = True
        if len(old) == 0:
            continue
        cost = np.full((len(new), len(old)), np.inf)
        for b, members in enumerate([np.flatnonzero(group == g) for g in old]):
            last = members[seen[members] == seen[members].max()]
            free = ~np.any(holders[new] & holders[last].any(axis=0), axis=1)
            cost[free, b] = -ratios[np.ix_(new[free], last)].max(axis=1, initial=-np.inf)
        for a, b in pairs_within(cost, 0.0):
            group[new[a]] = old[b]
    return group


@compiled
def _find_common_ids(named: Indices, given: Indices) -> Pairs:
    """All pairs of different tracks, in either order, with a common id; `named` and `given` as in a `_Table`."""
    order = np.argsort(given, kind="mergesort")
    first = [0 for _ in range(0)]
    second = [0 for _ in range(0)]
    for k in range(1, len(order)):
        for other in range(k - 1, -1, -1):
            if given[order[other]] != given[order[k]]:
                break
            a, b = named[order[other]], named[order[k]]
            first += [a, b]
            second += [b, a]
    return Pairs(np.array(first, np.int64), np.array(second, np.int64))


@compiled
def _find_comparable(valid: Flags, alike: Pairs) -> Indices:
    """Tracks, ascending, that others may be of the same person as: not all messages have them, or their id is shared.

    valid (N, G) as in a `_Table`; alike: as from `_find_common_ids`.
    """
    some = np.zeros(valid.shape[1], np.bool_)
    for s in range(len(valid)):
        for g in range(len(some)):
            some[g] |= not valid[s, g]
    for g in alike.first:
        some[g] = True
    return np.nonzero(some)[0]


@compiled
def _find_apart(valid: Flags, some: Indices) -> Pairs:
    """All pairs among some of the tracks that no message has both of, by their places among them; valid (N, G)."""
    words = (len(valid) + _BITS - 1) // _BITS
    holders = np.zeros((len(some), words), np.int64)
    for s in range(len(valid)):
        for k in range(len(some)):
            holders[k, s // _BITS] |= np.int64(valid[s, some[k]]) << s % _BITS
    first = [0 for _ in range(0)]
    second = [0 for _ in range(0)]
    for a in range(len(some)):
        for b in range(a + 1, len(some)):
            shared = False
            for w in range(words):
                shared |= holders[a, w] & holders[b, w] != 0
            if not shared:
                first.append(a)
                second.append(b)
    return Pairs(np.array(first, np.int64), np.array(second, np.int64))


def _rate_pairs(states: LatestTracks, apart: Pairs, alike: Pairs, max_speed: float) -> Array:
    """Log-likelihood ratios (G, G) of one person, common ids included; -inf for two tracks of one UAV.

    apart: the other pairs of tracks; alike: those with a common id, in either order.
    """
    ratios = np.full((len(states.means),) * 2, -np.inf)
    ratios[apart] = ratios.T[apart] = likelihood_ratios(states, apart, max_speed)
    seen = states.sightings[:, SIGHTED_AT]
    ratios[alike] += _SAME_ID * (seen[alike.first] == seen[alike.second])
    return ratios


def _choose_ids(table: _Table, group: Indices, ends: Flags, scan: int) -> Indices:
    """Id of each track, the same within a group; -1 for tracks that end.

    A group keeps its smallest id. If two people would have the same id, the partition of the smaller UAV keeps it. The
    other track takes another of its ids or a new one, which is the same for all UAVs of its partition.
    """
    keys, stays = table.keys, ~ends[table.named]
    given, first = np.unique(table.given[stays], return_index=True)
    least = np.full(len(keys), -1)  # id of each group: the smallest that it owns, because the last assignment counts
    least[group[table.named[stays][first]][::-1]] = given[::-1]
    for g in np.unique(group[~ends & (least[group] < 0)]).tolist():
        partition, id = keys[np.flatnonzero(group == g)[0]].tolist()
        rank = int(np.sum((keys[:, 0] == partition) & (keys[:, 1] < id)))
        fresh = new_id(scan, partition, IDS_PER_SCAN - 1 - rank % (IDS_PER_SCAN // 2))
        while fresh in given or fresh in least:
            fresh -= 1
        least[g] = fresh
    return np.where(ends, -1, least[group])
