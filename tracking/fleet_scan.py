"""A scan of all UAVs of a fleet in two compiled calls, one before and one after fusion.

Columns have the rows of N trackers, one tracker after the other: those of tracker n are from `starts[n]` up to
`starts[n + 1]`, and its measurements from `found.starts[n]` up to `found.starts[n + 1]`.
"""

from typing import NamedTuple

import numpy as np

from tracking.filter.negative_information import miss_likelihood, negative_information_update, temper
from tracking.fusion.exchange import SURE, UNSEEN, weigh
from tracking.fusion.hcmci import contribute
from tracking.fusion.message import find_beliefs, find_latest_sightings, read_existence
from tracking.fusion.rule import LocalBeliefs
from tracking.geometry.leaf_gaps import detectability
from tracking.geometry.lens import Lens, lens_of, pixel_size
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import SAMPLES, Occluders, see_samples
from tracking.management.deletion import count_misses, find_outcompeted, find_rivals
from tracking.management.reacquisition import turned_density
from tracking.measurement_update import (
    Measured,
    ScanPrediction,
    ScanUpdate,
    predict_scan,
    select_tracks,
    update_scan,
)
from tracking.numerics.arrays import Array, Flags, Indices
from tracking.numerics.compiled import compiled, merged
from tracking.parameters import EXPECTED, SEEN, AssociationSettings, LossRule, ScanSettings
from tracking.track import (
    DETECTED_AT,
    EXPECTED_AT,
    FRAME_AT,
    FRAME_BEFORE,
    SIGHTED_AT,
    SURE_AT,
    THIS_FRAME,
    Beliefs,
)

SHARED_WITHIN = 1.0  # s since the last detection of each of two tracks that share one person
NO_FRAME: tuple[float, ...] = (-np.inf,) * 8  # in `Views.frames`
_VIEWED = 1e-4  # weight of a belief in view without a detection, which matters only if no UAV detected the person


class Views(NamedTuple):
    """Cameras of N UAVs, and what hides people."""

    optics: Array  # (N, 16), `Optics.numbers`
    frames: Array  # (N, 2, 8) time [s], position and quaternion at `THIS_FRAME` and `FRAME_BEFORE`, or `NO_FRAME`
    solids: Occluders
    leaves: Occluders  # those of the solids that are porous


class Found(NamedTuple):
    """Measurements of N scans."""

    starts: Indices  # (N + 1,)
    places: Array  # (M, 2) m
    covariances: Array  # (M, 2, 2) m²
    since: Array  # (N,) s, time of the scan before


class Columns(NamedTuple):
    """Some columns of a `TrackTable`, which a scan changes in place, but for means, covariances and existence."""

    ids: Indices
    means: Array
    covariances: Array
    existence: Array
    weights: Array
    times: Array
    views: Indices
    sightings: Array


class Told(NamedTuple):
    """Columns of messages, as in `Message`."""

    keys: Indices
    shares: Array
    novel: Array


@compiled
def take_scans(
    starts: Indices,
    table: Columns,
    views: Views,
    found: Found,
    partitions: Indices,
    levels: tuple[float, float],
    settings: tuple[ScanSettings, AssociationSettings, LossRule],
) -> tuple[ScanPrediction, ScanUpdate, Indices, Told]:
    """Associate the scans of N UAVs with their tracks, predicted to their time, and update the tracks.

    partitions (N, 2): number of each UAV and of its leader; levels: time of the scans [s], and probability from which
    on a person counts as detected. Returns where the pairs of each UAV start (N + 1,) in `gates` and `weights` of the
    update, whose numbers are those of all rows and measurements, and what UAVs tell with the rule `HybridConsensus`.
    """
    beliefs = Beliefs(table.means, table.covariances)
    before, measured = _predict_views(starts, table, beliefs, views, found, levels[0], settings)
    after, pairs = _update(starts, before, measured, views, found, settings[1])
    _note_detections(starts, table, before.visible, after, pairs, found.starts, levels, settings[0].by_existence)
    owners = np.empty((2, len(table.ids)), np.int64)
    for n in range(len(partitions)):
        for t in range(starts[n], starts[n + 1]):
            owners[0, t], owners[1, t] = partitions[n, 0], partitions[n, 1]
    last, detected = partitions[:, 0].max(), np.nonzero(1.0 - after.missed >= SEEN)[0]
    spread = after.means, after.covariances, table.weights
    local = LocalBeliefs(last, spread[0], spread[1], spread[2], beliefs, found.places, after.gates, detected)
    averaged, novel, weights = contribute(local, owners[0])
    keys, shares = weigh(owners[1], table.ids, weights, averaged, after.existence)
    return before, after, pairs, Told(keys, shares, novel)


@compiled
def _update(
    starts: Indices,
    before: ScanPrediction,
    measured: Measured,
    views: Views,
    found: Found,
    settings: AssociationSettings,
) -> tuple[ScanUpdate, Indices]:
    """Update tracks by the scans of the UAVs that took a frame; returns also where the pairs of each UAV start."""
    means, covariances, existence = before.means.copy(), before.covariances.copy(), before.existence.copy()
    missed, explained = np.ones(len(means)), np.ones(len(found.places), np.bool_)
    most, pairs = 0, np.zeros(len(starts), np.int64)
    for n in range(len(starts) - 1):
        most += (starts[n + 1] - starts[n]) * (found.starts[n + 1] - found.starts[n])
    gates, weights = np.empty((most, 2), np.int64), np.empty(most)
    for n in range(len(starts) - 1):
        first, low = starts[n], found.starts[n]
        pairs[n + 1] = pairs[n]
        if views.frames[n, THIS_FRAME, 0] == -np.inf:
            continue
        of = slice(low, found.starts[n + 1])
        own = Measured(measured.places[of], measured.covariances[of], measured.shares[of], measured.lost[of])
        part = update_scan(select_tracks(before, slice(first, starts[n + 1])), own, settings)
        for t in range(len(part.means)):
            for a in range(4):
                means[first + t, a] = part.means[t, a]
                for b in range(4):
                    covariances[first + t, a, b] = part.covariances[t, a, b]
            existence[first + t], missed[first + t] = part.existence[t], part.missed[t]
        for g in range(len(part.gates)):
            gates[pairs[n] + g, 0], gates[pairs[n] + g, 1] = first + part.gates[g, 0], low + part.gates[g, 1]
            weights[pairs[n] + g] = part.weights[g]
        pairs[n + 1] += len(part.gates)
        for j in range(len(part.explained)):
            explained[low + j] = part.explained[j]
    count = pairs[-1]
    kept, likely = gates[:count].copy(), weights[:count].copy()
    return ScanUpdate(means, covariances, existence, missed, kept, likely, explained), pairs


@compiled
def _note_detections(
    starts: Indices,
    table: Columns,
    visible: Array,
    after: ScanUpdate,
    pairs: Indices,
    places: Indices,
    levels: tuple[float, float],
    by_existence: bool,
) -> None:
    """Note in the columns `times`, `views` and `weights` what the scans detected; levels as in `take_scans`."""
    now, least = levels
    detected, without = 1.0 - after.missed, np.zeros(len(visible), np.bool_)
    for n in range(0 if by_existence else len(starts) - 1):
        own = after.gates[pairs[n] : pairs[n + 1]].copy()
        for g in range(len(own)):
            own[g, 0], own[g, 1] = own[g, 0] - starts[n], own[g, 1] - places[n]
        flags = find_outcompeted(own, detected[starts[n] : starts[n + 1]])
        for t in range(len(flags)):
            without[starts[n] + t] = flags[t]
    for t in range(len(visible)):
        if detected[t] >= least and not without[t]:
            table.times[t, DETECTED_AT] = now
        if visible[t] >= EXPECTED:
            table.times[t, EXPECTED_AT] = now
        if detected[t] >= SURE:
            table.times[t, SURE_AT] = now
        table.weights[t] = max(detected[t], UNSEEN + _VIEWED * visible[t])
    for g in range(len(after.gates)):
        table.views[after.gates[g, 0], THIS_FRAME] = 0  # the association has already used this frame


@compiled
def _predict_views(
    starts: Indices,
    table: Columns,
    beliefs: Beliefs,
    views: Views,
    found: Found,
    now: float,
    settings: tuple[ScanSettings, AssociationSettings, LossRule],
) -> tuple[ScanPrediction, Measured]:
    """What frames show of tracks, written to the columns `times` and `views`, and the prediction of scans."""
    means, covariances = beliefs
    shows, since = np.zeros((len(means), 2, len(SAMPLES)), np.bool_), np.empty(len(means))
    visible = np.zeros(len(means))
    clear, lost = np.ones(len(found.places)), np.zeros(len(found.places))
    for n in range(len(starts) - 1):
        first, last, low, high = starts[n], starts[n + 1], found.starts[n], found.starts[n + 1]
        for t in range(first, last):
            table.views[t, THIS_FRAME] = table.views[t, FRAME_BEFORE] = 0
        for k in range(2):
            frame = views.frames[n, k]
            if frame[0] == -np.inf:
                continue
            lens = lens_of(views.optics[n], frame[1:4], frame[4:8])
            samples = see_samples(means[first:last], covariances[first:last], lens, views.solids)
            for t in range(len(samples)):
                for s in range(len(SAMPLES)):
                    shows[first + t, k, s] = samples[t, s]
                    table.views[first + t, k] |= np.int64(samples[t, s]) << s
                visible[first + t] = visible[first + t] if k else np.count_nonzero(samples[t]) / len(SAMPLES)
            if k == THIS_FRAME:
                _look_through_leaves(lens, found.places[low:high], views.leaves, clear[low:high])
                densities = turned_density(
                    table.sightings[first:last],
                    table.existence[first:last],
                    found.places[low:high],
                    found.covariances[low:high],
                    (found.since[n], now),
                    settings[2],
                )
                for j in range(low, high):
                    lost[j] = densities[j - low]
        for t in range(first, last):
            seen_before = table.views[t, FRAME_BEFORE] > 0
            table.times[t, FRAME_AT] = views.frames[n, FRAME_BEFORE, 0] if seen_before else -np.inf
            since[t] = now - table.times[t, FRAME_AT]
    missed = miss_likelihood(means, covariances, shows, since, settings[0].detection_probability)
    before = predict_scan(beliefs, table.existence, visible, missed, settings[0], starts)
    return before, Measured(found.places, found.covariances, clear, lost)


@merged
def _look_through_leaves(lens: Lens, places: Array, leaves: Occluders, clear: Array) -> None:
    """Write the probabilities (N,) that enough of people at places (N, 2) m shows through leaves to detect them."""
    for j in range(len(places) if len(leaves.cylinders) else 0):
        point = places[j, 0], places[j, 1], TARGET_HEIGHT
        clear[j] = detectability(lens.eye, point, pixel_size(lens, point), leaves.cylinders, leaves.grid)


class Adopted(NamedTuple):
    """The fleet's tracks after a scan, and which of them end."""

    means: Array
    covariances: Array
    existence: Array
    misses: Indices
    sightings: Array
    unlikely: Flags  # probably of nobody, by their existence or, with m of n, by their misses
    wide: Flags
    counts: Indices  # (N, 3): of unlikely and wide tracks, of others that may share a person, and of detected people


@compiled
def adopt_tracks(
    starts: Indices,
    columns: tuple[Array, Array, Array, Indices, Indices, Array],
    now: float,
    settings: ScanSettings,
) -> Adopted:
    """The fleet's tracks on N UAVs after a scan at `now` s, with the negative information of all frames.

    columns: `shares`, `novel`, `times`, `views`, `misses` and `sightings` of messages.
    """
    shares, novel, times, views, misses, sightings = columns
    means, covariances = find_beliefs(shares, novel)
    latest = find_latest_sightings(sightings, times, means, now)
    shown, since = np.zeros((len(means), 2, len(SAMPLES)), np.bool_), np.empty(len(means))
    undetected = False
    for t in range(len(means)):
        since[t] = now - times[t, FRAME_AT]
        if not times[t, DETECTED_AT] >= now:
            undetected = True
            for k in range(len(SAMPLES)):
                shown[t, THIS_FRAME, k] = views[t, THIS_FRAME] >> k & 1 != 0
                shown[t, FRAME_BEFORE, k] = views[t, FRAME_BEFORE] >> k & 1 != 0
    if undetected:
        missed = miss_likelihood(means, covariances, shown, since, settings.detection_probability)
        tempered = temper(missed, settings.negative_information)
        means, covariances = negative_information_update(means, covariances, tempered)
    counted = count_misses(misses, times, now, settings.delete[1])
    existence = read_existence(shares) if settings.by_existence else np.ones(len(means))
    unlikely, wide = np.empty(len(means), np.bool_), np.empty(len(means), np.bool_)
    recent, counts = np.empty(len(means), np.bool_), np.zeros((len(starts) - 1, 3), np.int64)
    for n in range(len(counts)):
        first, last = starts[n], starts[n + 1]
        for t in range(first, last):
            misses_counted = 0
            for k in range(settings.delete[1]):
                misses_counted += counted[t] >> k & 1
            missing = misses_counted >= settings.delete[0]
            unlikely[t] = existence[t] < settings.deletion_threshold if settings.by_existence else missing
            wide[t] = covariances[t, 0, 0] + covariances[t, 1, 1] > settings.max_variance
            recent[t] = times[t, DETECTED_AT] > now - SHARED_WITHIN and not (unlikely[t] or wide[t])
            counts[n, 0] += unlikely[t] or wide[t]
            counts[n, 2] += latest[t, SIGHTED_AT] >= now
        counts[n, 1] = len(find_rivals(existence[first:last], recent[first:last]))
    return Adopted(means, covariances, existence, counted, latest, unlikely, wide, counts)
