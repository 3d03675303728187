"""Track-to-track association: tracks of different UAVs that are of one person, and the id that each keeps."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tracking.fusion.labels import LABELS_PER_SCAN, is_new_label, new_label
from tracking.fusion.message import Message, alike
from tracking.management.reacquisition import farthest
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.compiled import elementwise
from tracking.numerics.distances import length, pair_costs
from tracking.numerics.exponential import log

_LABELLED = 1.5  # log-likelihood ratio of a common id: partitions give it to one person rather than to two
_UNKNOWN = 1e-5  # 1/m², density of people that only one of two UAVs has a track of
_TURNED = 0.05  # probability that an unseen person is anywhere within reach, rather than where the belief is


class LatestTracks(NamedTuple):
    """Tracks of G people, each as the UAV with its last detection has it."""

    means: Array  # (G, 4)
    covariances: Array  # (G, 4, 4)
    sightings: Array  # (G, 3) position [m] and time [s] of the last sure detection


def associate_tracks(own: Message, received: Sequence[Message], max_speed: float) -> list[Message]:
    """Associate the tracks of messages: the messages, own first, with the same tracks in the same rows.

    Tracks of one id are of one person within a partition of the fleet. All others are joined by the ratio of two
    likelihoods, that both are of one person and that they are of two, and never two tracks of which one UAV made the
    last detection. The order of messages has no influence. `max_speed` [m/s] is that of people.
    """
    messages = [own, *received]
    if alike(messages):
        return messages
    # Of each id the latest time, as the last of equal keys counts.
    deleted = tuple(dict(sorted(deletion for m in messages for deletion in m.deleted)).items())
    messages = [_surviving(m, deleted) for m in messages]
    names, rows = np.unique(np.concatenate([m.names for m in messages]), axis=0, return_inverse=True)
    tracks = np.split(rows.reshape(-1), np.cumsum([len(m.names) for m in messages])[:-1])
    order = sorted(range(len(messages)), key=lambda k: messages[k].uav)
    states = _last_seen([messages[k] for k in order], [tracks[k] for k in order], len(names))
    times = _latest(tracks, [m.sightings[:, 2] for m in messages], len(names))
    # Where UAVs differ in when a person was last seen, the last one counts.
    valid = [m.sightings[:, 2] >= times[of] for m, of in zip(messages, tracks, strict=True)]
    holders = np.array([np.isin(np.arange(len(names)), tracks[k][valid[k]]) for k in order]).T
    labels = _labels(messages, tracks, len(names))
    group, ends = _joined(states, labels, holders, is_new_label(names[:, 1], own.scan), max_speed)
    ids = _ids(names, labels, group, ends, own.scan)
    kept, first = np.unique(ids, return_index=True)
    kept, first = kept[kept >= 0], first[kept >= 0]
    seen = states.sightings[:, 2]
    current = seen >= _latest([group], [seen], len(names))[group]
    out = []
    for m, of, last in zip(messages, tracks, valid, strict=True):
        left = np.flatnonzero((ids[of] >= 0) & current[of] & last)
        out.append(m.only(left).at(np.searchsorted(kept, ids[of[left]]), kept, names[first]))
    return out


def _latest(rows: Sequence[Indices], times: Sequence[Array], count: int) -> Array:
    """Latest of the times given for each row of a table (count,)."""
    latest = np.full(count, -np.inf)
    np.maximum.at(latest, np.concatenate(rows), np.concatenate(times))
    return latest


def likelihood_ratios(states: LatestTracks, max_speed: float) -> Array:
    """Logarithms (G, G) of the likelihood that two tracks are of one person, over that of two people.

    Of one person the states are equal, or a person out of sight has turned and is anywhere within reach of the last
    detection. Of two people, one is unknown to a UAV that has the other track, at any place and of any velocity.
    Note: of the two densities of one person the larger counts, rather than their weighted sum.
    """
    cost = pair_costs(states[:2], states[:2])
    elsewhere = log(_UNKNOWN / (math.pi * max_speed * max_speed))
    ratios = -0.5 * cost - 2.0 * log(2.0 * math.pi) - elsewhere
    reach, within = _reach(states, max_speed)
    turned = np.where(within, _turned(reach), -np.inf)
    return np.maximum(ratios, np.maximum(turned, turned.T))


@elementwise
def _turned(reach: float) -> float:
    """Logarithm of the likelihood ratio of a person who turned, and is anywhere within reach [m]."""
    return log(_TURNED / (math.pi * reach * reach * _UNKNOWN))


def _reach(states: LatestTracks, max_speed: float) -> tuple[Array, Flags]:
    """Distances (G, G) [m] that each can have moved from its last detection to that of another, flags if it can have.

    Flags are set only where the other was seen later.
    """
    places, seen = states.sightings[:, :2], states.sightings[:, 2]
    unseen = seen - seen[:, None]
    reach = farthest(np.maximum(unseen, 0.0), max_speed)
    gap = length(places[:, None] - places)
    return reach, (unseen > 0.0) & (gap <= reach)


def _last_seen(messages: Sequence[Message], tracks: Sequence[Indices], count: int) -> LatestTracks:
    """Each track as the first of the messages with its last detection has it."""
    states = LatestTracks(np.zeros((count, 4)), np.zeros((count, 4, 4)), np.full((count, 3), -np.inf))
    known = np.zeros(count, dtype=np.bool_)
    for message, rows in zip(messages, tracks, strict=True):
        columns = *message.beliefs, message.sighted()
        later = ~known[rows] | (columns[2][:, 2] > states.sightings[rows, 2])
        for state, column in zip(states, columns, strict=True):
            state[rows[later]] = column[later]
        known[rows] = True
    return states


def _labels(messages: Sequence[Message], tracks: Sequence[Indices], count: int) -> list[set[int]]:
    """Labels of each track in messages."""
    labels: list[set[int]] = [set() for _ in range(count)]
    every = zip(np.concatenate(tracks).tolist(), np.concatenate([m.ids for m in messages]).tolist(), strict=True)
    for row, id in every:
        labels[row].add(id)
    return labels


def _joined(
    states: LatestTracks, labels: Sequence[set[int]], holders: Flags, begun: Flags, max_speed: float
) -> tuple[Indices, Flags]:
    """Group (G,) of each track, named by its first one, and flags (G,) of tracks that end.

    labels: those of each track; holders (G, N): flags of the UAVs that hold each; begun (G,): flags of tracks begun in
    this scan. UAV by UAV one assignment joins the tracks that the UAVs before do not hold to groups of others; new
    tracks after all others, as one and a lost one of a UAV may both be of the person that another UAV has. A group out
    of sight ends if its person was seen later, within reach, as another track of its only id.
    """
    common = np.array([[not one.isdisjoint(other) for other in labels] for one in labels], dtype=np.bool_)
    common = common.reshape(len(labels), len(labels))
    seen = states.sightings[:, 2]
    together = seen[:, None] == seen
    ratios = likelihood_ratios(states, max_speed) + _LABELLED * (common & together)
    every = np.arange(len(labels))
    group, known = every.copy(), np.zeros(len(labels), dtype=np.bool_)
    for held in (*(holders & ~begun[:, None]).T, *(holders & begun[:, None]).T):
        new = np.flatnonzero(held & ~known)
        old = np.flatnonzero(known & (group == every)) if len(new) else new
        cost = np.full((len(new), len(old)), np.inf)
        for b, members in enumerate([np.flatnonzero(group == g) for g in old]):
            last = members[seen[members] == seen[members].max()]
            free = ~np.any(holders[new] & holders[last].any(axis=0), axis=1)
            cost[free, b] = -ratios[np.ix_(new[free], last)].max(axis=1, initial=-np.inf)
        for a, b in pairs_within(cost, 0.0):
            group[new[a]] = old[b]
        known[new] = True
    later = np.any(common & _reach(states, max_speed)[1] & (group[:, None] != group), axis=1)
    ends = np.zeros(len(labels), dtype=np.bool_)
    for rows in [np.flatnonzero(group == g).tolist() for g in np.unique(group[later])]:
        ends[rows] = later[rows].all() and len({id for k in rows for id in labels[k]}) == 1
    return group, ends


def _ids(names: Indices, labels: Sequence[set[int]], group: Indices, ends: Flags, scan: int) -> Indices:
    """Id of each track, the same within a group; -1 for tracks that end.

    The smallest id stays. Where two people would have it, the partition of the smaller UAV keeps it; the other track
    takes another id that it has, or gets a new one, the same for all UAVs of its partition.
    """
    owners: dict[int, int] = {}  # the group of each id
    for k in np.flatnonzero(~ends).tolist():
        for id in sorted(labels[k]):
            owners.setdefault(id, int(group[k]))
    least: dict[int, int] = {}  # the smallest id of each group
    for id, owner in owners.items():
        least[owner] = min(id, least.get(owner, id))
    ids = np.full(len(names), -1)
    for g in np.unique(group[~ends]).tolist():
        if g not in least:
            partition, id = names[np.flatnonzero(group == g)[0]].tolist()
            rank = int(np.sum((names[:, 0] == partition) & (names[:, 1] < id)))
            fresh = new_label(scan, partition, LABELS_PER_SCAN - 1 - rank % (LABELS_PER_SCAN // 2))
            while fresh in owners:
                fresh -= 1
            least[g], owners[fresh] = fresh, g
        ids[group == g] = least[g]
    return ids


def _surviving(message: Message, deleted: tuple[tuple[int, float], ...]) -> Message:
    """The message without tracks last detected before the time up to which a deletion makes sightings void."""
    if message.deleted == deleted:
        return message
    deletions = dict(deleted)
    until = np.array([deletions.get(id, -np.inf) for id in message.ids.tolist()])
    return replace(message.only(np.flatnonzero(message.times[:, 0] >= until)), deleted=deleted)
