"""Track-to-track association: tracks of different UAVs that are of one person, and their common id."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tracking.fusion.message import (
    IDS_PER_SCAN,
    EndedTrack,
    Message,
    are_alike,
    find_beliefs,
    find_latest_sightings,
    is_new_id,
    new_id,
)
from tracking.management.reacquisition import farthest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import gaussian_costs, length
from tracking.numerics.exponential import log
from tracking.numerics.stacks import elementwise
from tracking.track import DETECTED_AT, SIGHTED_AT, SURE_AT

_SAME_ID = 1.5  # log-likelihood ratio of a common id, which partitions give more likely to one person than to two
_UNKNOWN = 1e-5  # 1/m², density of people for which only one of two UAVs has a track
_TURNED = 0.05  # probability that an unseen person is anywhere within reach, rather than where the belief is
_IDS = 1 << 52  # above all ids, so that one number stands for a leader and an id


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
    given: Indices  # (P,) these ids


class LatestTracks(NamedTuple):
    """Tracks of G people, each from the UAV with its last detection."""

    means: Array  # (G, 4)
    covariances: Array  # (G, 4, 4)
    sightings: Array  # (G, 3) position [m] and time [s] of the last sure detection


def associate_tracks(messages: Sequence[Message], max_speed: float) -> JointTracks:
    """Associate the tracks of messages.

    Within a partition of the fleet, tracks of one id are of one person. Other tracks are joined by the ratio of the
    likelihoods that both are of one person and that they are of two, but never if one UAV made the last detection of
    both. The order of messages has no influence. max_speed: largest speed of people [m/s].
    """
    if are_alike(messages):
        own = messages[0]
        return JointTracks(own.ids, own.keys, np.tile(np.arange(len(own.ids)), (len(messages), 1)), own.deleted)
    order = sorted(range(len(messages)), key=lambda k: messages[k].uav)
    ordered = [messages[k] for k in order]
    # `dict` keeps the latest time of each id, because the last of equal keys counts.
    latest_ends = dict(sorted({ended for m in messages for ended in m.deleted}))
    deleted = tuple(EndedTrack(*ended) for ended in latest_ends.items())
    table = _tabulate(ordered, deleted)
    group, ends = _group(ordered, table, max_speed)
    ids = _choose_ids(table, group, ends, messages[0].scan)
    kept, first = np.unique(ids, return_index=True)
    kept, first = kept[kept >= 0], first[kept >= 0]
    latest = np.full(len(ids), -np.inf)  # of each group
    np.maximum.at(latest, group, table.seen)
    sender, track = np.nonzero(table.valid & (~ends & (table.seen >= latest[group])))
    rows = np.full((len(messages), len(kept)), -1)
    rows[np.array(order)[sender], np.searchsorted(kept, ids)[track]] = table.rows[sender, track]
    return JointTracks(kept, table.keys[first], rows, deleted)


def _tabulate(messages: Sequence[Message], deleted: tuple[EndedTrack, ...]) -> _Table:
    """Tabulate the tracks of messages, without tracks whose last detection a deletion has made void.

    A message that contains all deletions has no such tracks.
    """
    counts = [len(m.ids) for m in messages]
    sender, row = np.repeat(np.arange(len(counts)), counts), np.concatenate([np.arange(count) for count in counts])
    ids, keys, times, sightings = (
        np.concatenate([getattr(m, name) for m in messages]) for name in ("ids", "keys", "times", "sightings")
    )
    uninformed = np.array([m.deleted != deleted for m in messages])[sender]
    if uninformed.any():
        gone, until = np.array(deleted).T
        at = np.minimum(np.searchsorted(gone, ids), len(gone) - 1)
        stays = ~(uninformed & (gone[at] == ids) & (times[:, DETECTED_AT] < until[at]))
        sender, row, ids, keys, times, sightings = (x[stays] for x in (sender, row, ids, keys, times, sightings))
    codes, track = np.unique(keys[:, 0] * _IDS + keys[:, 1], return_inverse=True)
    shape = len(messages), len(codes)
    rows, before = np.full(shape, -1), np.full(shape, -np.inf)
    rows[sender, track], before[sender, track] = row, sightings[:, SIGHTED_AT]
    now, after = messages[0].time, before.copy()
    after[sender, track] = np.where(times[:, SURE_AT] >= now, now, sightings[:, SIGHTED_AT])
    held, seen = rows >= 0, after.max(axis=0, initial=-np.inf)
    named = np.full(shape, -1)
    named[sender, track] = ids
    named.sort(axis=0)
    new = named >= 0
    new[1:] &= named[1:] != named[:-1]
    return _Table(
        keys=np.column_stack(np.divmod(codes, _IDS)),
        rows=rows,
        valid=held & (before >= before.max(axis=0, initial=-np.inf)),
        seen=seen,
        source=(held & (after >= seen)).argmax(axis=0),
        named=np.nonzero(new.T)[0],
        given=named.T[new.T],
    )


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


def _find_last_seen(messages: Sequence[Message], table: _Table, tracks: Indices) -> LatestTracks:
    """States of `tracks`, each from the message with the latest detection. Of equals, the first message counts."""
    count, source = len(tracks), table.source[tracks]
    states = LatestTracks(np.empty((count, 4)), np.empty((count, 4, 4)), np.empty((count, 3)))
    for k in np.unique(source).tolist():
        m, of = messages[k], np.flatnonzero(source == k)
        rows = table.rows[k, tracks[of]]
        means, covariances = find_beliefs(m.shares[rows], m.novel[rows])
        states.means[of], states.covariances[of] = means, covariances
        states.sightings[of] = find_latest_sightings(m.sightings[rows], m.times[rows], means, m.time)
    return states


def _group(messages: Sequence[Message], table: _Table, max_speed: float) -> tuple[Indices, Flags]:
    """Group (G,) of each track, given by one of its tracks, and flags (G,) of tracks that end.

    A group out of sight ends if its only id has another track that was seen later, within reach.
    """
    group, ends = np.arange(len(table.seen)), np.zeros(len(table.seen), dtype=np.bool_)
    alike = _find_common_ids(table)
    # A track that all UAVs hold can be joined with none.
    alone = np.asarray(table.valid.all(axis=0))
    alone[alike.first] = False
    if alone.all():
        return group, ends
    some, place = np.flatnonzero(~alone), np.cumsum(~alone) - 1
    alike, holders = Pairs(place[alike.first], place[alike.second]), table.valid[:, some].T
    apart = _find_apart(holders)
    if len(apart.first) == len(alike.first) == 0:
        return group, ends
    states = _find_last_seen(messages, table, some)
    ratios = _rate_pairs(states, apart, alike, max_speed)
    joined = _join(states, ratios, holders, is_new_id(table.keys[some, 1], messages[0].scan))
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


def _find_common_ids(table: _Table) -> Pairs:
    """All pairs of different tracks, in either order, with a common id in the messages."""
    order = np.argsort(table.given, kind="stable")
    named, given = table.named[order], table.given[order]
    first, second = [named[:0]], [named[:0]]
    for k in range(1, len(given)):
        same = given[k:] == given[:-k]
        if not same.any():
            break
        ends = named[:-k][same], named[k:][same]
        first += ends
        second += ends[::-1]
    return Pairs(np.concatenate(first), np.concatenate(second))


def _find_apart(holders: Flags) -> Pairs:
    """All pairs of tracks that no UAV holds both of; holders (G, N): flags of the UAVs that hold each track."""
    apart = np.ones((len(holders),) * 2, dtype=np.bool_)
    for bits in np.packbits(holders, axis=1).T:
        apart &= bits[:, None] & bits == 0
    return Pairs(*np.nonzero(np.triu(apart, 1)))


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
