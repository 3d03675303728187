"""Track-to-track association: tracks of different UAVs that are of one person, and their common id."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from tracking.fusion.message import Message, are_alike
from tracking.fusion.track_ids import IDS_PER_SCAN, is_new_id, new_id
from tracking.management.reacquisition import farthest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.compiled import compiled, elementwise
from tracking.numerics.distances import gaussian_costs, length
from tracking.numerics.exponential import log
from tracking.track import DETECTED_AT, SIGHTED_AT

_SAME_ID = 1.5  # log-likelihood ratio of a common id, which partitions give more likely to one person than to two
_UNKNOWN = 1e-5  # 1/m², density of people for which only one of two UAVs has a track
_TURNED = 0.05  # probability that an unseen person is anywhere within reach, rather than where the belief is


class LatestTracks(NamedTuple):
    """Tracks of G people, each from the UAV with its last detection."""

    means: Array  # (G, 4)
    covariances: Array  # (G, 4, 4)
    sightings: Array  # (G, 3) position [m] and time [s] of the last sure detection


def associate_tracks(own: Message, received: Sequence[Message], max_speed: float) -> list[Message]:
    """Associate the tracks of messages; returns the messages, own first, with the same tracks in the same rows.

    Within a partition of the fleet, tracks of one id are of one person. Other tracks are joined by the ratio of the
    likelihoods that both are of one person and that they are of two, but never if one UAV made the last detection of
    both. The order of messages has no influence. max_speed: largest speed of people [m/s].
    """
    messages = [own, *received]
    if are_alike(messages):
        return messages
    # `dict` keeps the latest time of each id, because the last of equal keys counts.
    deleted = tuple(dict(sorted(deletion for m in messages for deletion in m.deleted)).items())
    messages = [_drop_deleted(m, deleted) for m in messages]
    keys, rows = np.unique(np.concatenate([m.keys for m in messages]), axis=0, return_inverse=True)
    tracks = np.split(rows.reshape(-1), np.cumsum([len(m.keys) for m in messages])[:-1])
    order = sorted(range(len(messages)), key=lambda k: messages[k].uav)
    states = _last_seen([messages[k] for k in order], [tracks[k] for k in order], len(keys))
    times = _latest_times(tracks, [m.sightings[:, SIGHTED_AT] for m in messages], len(keys))
    # If UAVs have different times of a person's last sighting, only tracks with the latest time count.
    valid = [m.sightings[:, SIGHTED_AT] >= times[of] for m, of in zip(messages, tracks, strict=True)]
    holders = np.array([np.isin(np.arange(len(keys)), tracks[k][valid[k]]) for k in order]).T
    given = _given_ids(messages, tracks, len(keys))
    group, ends = _join(states, given, holders, is_new_id(keys[:, 1], own.scan), max_speed)
    ids = _choose_ids(keys, given, group, ends, own.scan)
    kept, first = np.unique(ids, return_index=True)
    kept, first = kept[kept >= 0], first[kept >= 0]
    seen = states.sightings[:, SIGHTED_AT]
    current = seen >= _latest_times([group], [seen], len(keys))[group]
    out = []
    for m, of, last in zip(messages, tracks, valid, strict=True):
        left = np.flatnonzero((ids[of] >= 0) & current[of] & last)
        out.append(m.select(left).spread(np.searchsorted(kept, ids[of[left]]), kept, keys[first]))
    return out


def _latest_times(rows: Sequence[Indices], times: Sequence[Array], count: int) -> Array:
    """Latest (count,) of the times that are given for each row of a table."""
    latest = np.full(count, -np.inf)
    np.maximum.at(latest, np.concatenate(rows), np.concatenate(times))
    return latest


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
        reach, within = _reach(states, one_way, max_speed)
        ratios = np.maximum(ratios, np.where(within, _turned(reach), -np.inf))
    return ratios


@elementwise
@compiled
def _turned(reach: Array, out: Array) -> None:
    """Logarithm of the likelihood ratio of a person that has turned and is anywhere within reach [m]."""
    for k in range(len(reach)):
        out[k] = log(_TURNED / (math.pi * reach[k] * reach[k] * _UNKNOWN))


def _reach(states: LatestTracks, pairs: Pairs, max_speed: float) -> tuple[Array, Flags]:
    """Distances (P,) [m] that a person can move from the first track's last detection to the second's, and flags (P,).

    A flag is set if the second track was seen later, and within this distance.
    """
    places, seen = states.sightings[:, :2], states.sightings[:, SIGHTED_AT]
    unseen = seen[pairs.second] - seen[pairs.first]
    reach = farthest(np.maximum(unseen, 0.0), max_speed)
    gap = length(places[pairs.second] - places[pairs.first])
    return reach, (unseen > 0.0) & (gap <= reach)


def _last_seen(messages: Sequence[Message], tracks: Sequence[Indices], count: int) -> LatestTracks:
    """Tracks, each from the first of the messages with its last detection."""
    states = LatestTracks(np.zeros((count, 4)), np.zeros((count, 4, 4)), np.full((count, 3), -np.inf))
    known = np.zeros(count, dtype=np.bool_)
    for message, rows in zip(messages, tracks, strict=True):
        columns = *message.beliefs, message.latest_sightings()
        later = ~known[rows] | (columns[2][:, SIGHTED_AT] > states.sightings[rows, SIGHTED_AT])
        for state, column in zip(states, columns, strict=True):
            state[rows[later]] = column[later]
        known[rows] = True
    return states


def _given_ids(messages: Sequence[Message], tracks: Sequence[Indices], count: int) -> list[set[int]]:
    """Ids that messages give to each track."""
    given: list[set[int]] = [set() for _ in range(count)]
    every = zip(np.concatenate(tracks).tolist(), np.concatenate([m.ids for m in messages]).tolist(), strict=True)
    for row, id in every:
        given[row].add(id)
    return given


def _join(
    states: LatestTracks, given: Sequence[set[int]], holders: Flags, begun: Flags, max_speed: float
) -> tuple[Indices, Flags]:
    """Group (G,) of each track, given by its first track, and flags (G,) of tracks that end.

    given: ids that messages give to each track; holders (G, N): flags of the UAVs that hold each track; begun (G,):
    flags of tracks that began in this scan. UAV by UAV, one assignment joins the tracks that no earlier UAV holds to
    existing groups. New tracks come last, because a UAV's new track and its lost one may both be of a person that
    another UAV tracks. A group out of sight ends if its only id has another track that was seen later, within reach.
    """
    seen = states.sightings[:, SIGHTED_AT]
    alike = _find_common_ids(given)
    ratios = _rate_pairs(states, alike, holders, max_speed)
    group, known = np.arange(len(given)), np.zeros(len(given), dtype=np.bool_)
    for held in (*(holders & ~begun[:, None]).T, *(holders & begun[:, None]).T):
        new = np.flatnonzero(held & ~known)
        old = np.unique(group[known & np.any(ratios[new] >= 0.0, axis=0)])  # groups that a new track may join
        cost = np.full((len(new), len(old)), np.inf)
        for b, members in enumerate([np.flatnonzero(group == g) for g in old]):
            last = members[seen[members] == seen[members].max()]
            free = ~np.any(holders[new] & holders[last].any(axis=0), axis=1)
            cost[free, b] = -ratios[np.ix_(new[free], last)].max(axis=1, initial=-np.inf)
        for a, b in pairs_within(cost, 0.0):
            group[new[a]] = old[b]
        known[new] = True
    others = group[alike.first] != group[alike.second]
    later = np.zeros(len(given), dtype=np.bool_)
    later[alike.first[others & _reach(states, alike, max_speed)[1]]] = True
    ends = np.zeros(len(given), dtype=np.bool_)
    for rows in [np.flatnonzero(group == g).tolist() for g in np.unique(group[later])]:
        ends[rows] = later[rows].all() and len({id for k in rows for id in given[k]}) == 1
    return group, ends


def _find_common_ids(given: Sequence[set[int]]) -> Pairs:
    """All pairs of different tracks, in either order, to which messages give a common id."""
    tracks = defaultdict[int, list[int]](list)
    for row, ids in enumerate(given):
        for id in ids:
            tracks[id].append(row)
    pairs = sorted({pair for rows in tracks.values() for pair in permutations(rows, 2)})
    return Pairs(*np.array(pairs, dtype=np.int64).reshape(-1, 2).T)


def _rate_pairs(states: LatestTracks, alike: Pairs, holders: Flags, max_speed: float) -> Array:
    """Log-likelihood ratios (G, G) of one person, with that of a common id; -inf for two tracks that one UAV holds.

    alike: the pairs of tracks with a common id; holders (G, N): flags of the UAVs that hold each track.
    """
    apart = np.ones((len(holders),) * 2, dtype=np.bool_)
    for bits in np.packbits(holders, axis=1).T:
        apart &= bits[:, None] & bits == 0
    pairs = Pairs(*np.nonzero(np.triu(apart, 1)))
    ratios = np.full(apart.shape, -np.inf)
    ratios[pairs] = ratios.T[pairs] = likelihood_ratios(states, pairs, max_speed)
    seen = states.sightings[:, SIGHTED_AT]
    ratios[alike] += _SAME_ID * (seen[alike.first] == seen[alike.second])
    return ratios


def _choose_ids(keys: Indices, given: Sequence[set[int]], group: Indices, ends: Flags, scan: int) -> Indices:
    """Id of each track, the same within a group; -1 for tracks that end.

    A group keeps its smallest id. If two people would have the same id, the partition of the smaller UAV keeps it. The
    other track takes another of its ids or a new one, which is the same for all UAVs of its partition.
    """
    owners: dict[int, int] = {}  # the group of each id
    for k in np.flatnonzero(~ends).tolist():
        for id in sorted(given[k]):
            owners.setdefault(id, int(group[k]))
    # The smallest id of each group, because the last of equal keys counts.
    least = {owner: id for id, owner in sorted(owners.items(), reverse=True)}
    ids = np.full(len(keys), -1)
    for g in np.unique(group[~ends]).tolist():
        if g not in least:
            partition, id = keys[np.flatnonzero(group == g)[0]].tolist()
            rank = int(np.sum((keys[:, 0] == partition) & (keys[:, 1] < id)))
            fresh = new_id(scan, partition, IDS_PER_SCAN - 1 - rank % (IDS_PER_SCAN // 2))
            while fresh in owners:
                fresh -= 1
            least[g], owners[fresh] = fresh, g
        ids[group == g] = least[g]
    return ids


def _drop_deleted(message: Message, deleted: tuple[tuple[int, float], ...]) -> Message:
    """The message without tracks with a last detection before the time up to which a deletion voids sightings."""
    if message.deleted == deleted:
        return message
    deletions = dict(deleted)
    until = np.array([deletions.get(id, -np.inf) for id in message.ids.tolist()])
    return replace(message.select(np.flatnonzero(message.times[:, DETECTED_AT] >= until)), deleted=deleted)
