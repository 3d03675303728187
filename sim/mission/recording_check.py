"""Validation of a recording that was read: shapes, order of times, poses and covariances."""

from collections.abc import Callable, Iterator

import msgspec
import numpy as np
from numpy.typing import NDArray

from sim.mission.recording import LONGEST_FAULT, MAPS, MOST_FAULTS, Recording, decode_faults
from sim.scenario.quantities import REPEATS
from sim.world.contacts import KINDS
from tracking.numerics.arrays import Array

FARTHEST = 1e6  # m, m/s, m²; more than any value of a mission, but too little to overflow in drawings
Finding = tuple[str, bool, str]  # a field, True if it is wrong, and what is wrong then


def check_recording(recording: Recording) -> None:
    """ValueError that names the first field with values that no mission can have."""
    for rules in (
        _check_sizes,
        _check_texts,
        _check_world,
        _check_measurements,
        _check_tracks,
        _check_plans,
        _check_counts,
        _check_maps,
    ):
        for name, wrong, what in rules(recording):
            if wrong:
                raise ValueError(f"field '{name}': {what}")


def _check_sizes(r: Recording) -> Iterator[Finding]:
    yield "poses", 0 in r.poses.shape, "has no scan or no UAV"
    times = r.times
    yield "times", not _is_finite(times) or times[0] < 0 or bool(np.any(np.diff(times) <= 0)), "do not rise from 0 s on"
    for name, offsets, rows in (
        ("measurement_offsets", r.measurement_offsets, len(r.measurements)),
        ("track_offsets", r.track_offsets, len(r.track_ids)),
    ):
        wrong = offsets[0] != 0 or offsets[-1] != rows or np.any(offsets[1:] < offsets[:-1])
        yield name, bool(wrong), f"does not rise from 0 to {rows}"


def _check_texts(r: Recording) -> Iterator[Finding]:
    yield "planner", not r.planner.isprintable() or len(r.planner) > 10_000, "is no printable text"
    yield "seed", r.seed < 0, "is negative"
    yield "repeat", not 0 <= r.repeat < REPEATS, f"is {r.repeat}, not 0 to {REPEATS - 1}"
    yield "scenario", _fails(msgspec.json.Decoder(dict).decode, r.scenario), "is no JSON object"
    yield "faults", _fails(decode_faults, r.faults), "is no list of faults, each with time, uav and message"
    faults = r.all_faults
    n = r.uav_count
    yield "faults", len(faults) > MOST_FAULTS, f"are more than {MOST_FAULTS}"
    wrong = any(not f.message.isprintable() or len(f.message) > LONGEST_FAULT for f in faults)
    yield "faults", wrong, f"have a message that is not one line of at most {LONGEST_FAULT} characters"
    wrong = any(not 0 <= f.time <= r.times[-1] or not 0 <= (f.uav or 0) < n for f in faults)
    yield "faults", wrong, "name a time or a UAV that is not there"


def _check_world(r: Recording) -> Iterator[Finding]:
    yield from _check_trees("trees", r.trees)
    absent = np.isnan(r.people[..., 0])
    partly = bool(np.any(absent != np.isnan(r.people[..., 1])))
    yield "people", partly or not _is_finite(r.people[~absent]), "have places that are partly NaN or not finite"
    yield "headings", not _is_finite(r.headings[~absent]), "are not finite where a person is"
    believed = () if r.believed is None else (("believed", r.believed),)
    for name, poses in (("poses", r.poses), ("cameras", r.cameras), *believed):
        yield name, not _is_finite(poses), "are not finite"
        norms = np.sum(poses[..., 3:] ** 2, axis=-1)
        yield name, bool(np.any(np.abs(norms - 1) > 1e-6)), "have quaternions whose norm is not 1"
    yield "commands", not _is_finite(r.commands), "are not finite"
    limits = np.array([r.uav_count, len(r.trees), len(r.trees), r.person_count, 1])
    c, cells = r.contacts, (*r.poses.shape[:2], len(KINDS))
    wrong = bool(np.any(c < 0) or np.any(c[:, :3] >= cells) or np.any(c[1:, 0] < c[:-1, 0]))
    yield "contacts", wrong, "names a scan, UAV or kind that is not there, or not in order"
    yield "contacts", not wrong and bool(np.any(c[:, 3] >= limits[c[:, 2]])), "names what is not there"


def _check_measurements(r: Recording) -> Iterator[Finding]:
    yield "measurements", not _is_finite(r.measurements), "are not finite"
    yield "measurement_covariances", not _is_definite(r.measurement_covariances), "are no covariances"
    nowhere = np.isnan(r.pixels).all(axis=1)
    yield "pixels", not _is_finite(r.pixels[~nowhere]), "are partly NaN or not finite"
    for name in ("matched", "frames"):
        flags = getattr(r, name)
        wrong = flags is not None and bool(np.any(flags.view(np.uint8) > 1))
        yield name, wrong, "holds bytes that are neither true nor false"


def _check_tracks(r: Recording) -> Iterator[Finding]:
    yield "track_ids", bool(np.any(r.track_ids < 0)), "are below 0"
    yield "track_means", not _is_finite(r.track_means), "are not finite"
    yield "track_covariances", not _is_definite(r.track_covariances), "are no covariances"
    known = r.track_existence[~np.isnan(r.track_existence)]
    yield "track_existence", not np.all((known >= 0) & (known <= 1)), "is no probability or NaN"
    stored = r.track_sightings[~np.isnan(r.track_sightings).all(axis=1)]
    yield "track_sightings", not _is_finite(stored) or bool(np.any(stored[:, 2] < 0)), "are no place and time, or NaN"
    broken = np.isnan(r.ospa).all(axis=-1)
    yield "ospa", not _is_finite(r.ospa[~broken]) or bool(np.any(r.ospa < 0)), "is partly NaN, below 0 or not finite"


def _check_plans(r: Recording) -> Iterator[Finding]:
    wrong = bool(np.any(np.diff(r.plan_times) <= 0)) or not np.all(np.isin(r.plan_times, r.times))
    yield "plan_times", wrong, "do not rise from scan to scan"
    ended = np.asarray(np.isnan(r.plans).all(axis=-1))
    yield "plans", not _is_finite(r.plans[~ended]), "are partly NaN or not finite"
    yield "plans", bool(np.any(ended[:, :, :-1] & ~ended[:, :, 1:])), "go on after their end"


def _check_counts(r: Recording) -> Iterator[Finding]:
    for name in ("visible", "bytes_sent", "plan_bytes", "plan_rounds"):
        yield name, bool(np.any(getattr(r, name) < 0)), "holds numbers below 0"
    yield "map_bytes", r.map_bytes is not None and bool(np.any(r.map_bytes < 0)), "holds numbers below 0"


def _check_trees(name: str, trees: Array) -> Iterator[Finding]:
    places, density = trees[:, :6], trees[:, 6:]
    yield name, not _is_finite(places) or bool(np.any(places[:, [2, 5]] < 0)), "have a radius below 0 or no place"
    yield name, not np.all(density >= 0), "have a leaf area density below 0 or none"
    yield name, bool(np.any(trees[:, 3] > trees[:, 4])), "have a canopy that ends below its base"


def _check_maps(r: Recording) -> Iterator[Finding]:
    given = [getattr(r, name) is not None for name in MAPS]
    yield "maps", any(given) != all(given), f"come without {', '.join(MAPS[1:])}, or these without them"
    if r.maps is None or r.map_sizes is None or r.map_trees is None or r.map_unknown is None:
        return
    yield "maps", bool(np.any((r.maps < 0) | (r.maps >= len(r.map_sizes)))), "name a map that is not there"
    wrong = bool(np.any(r.map_sizes < 0)) or int(r.map_sizes.sum()) != len(r.map_trees)
    yield "map_sizes", wrong, f"are not the numbers of {len(r.map_trees)} trees"
    yield from _check_trees("map_trees", r.map_trees[:, :7])
    yield "map_trees", not np.all(r.map_trees[:, 7] >= 0), "have a deviation below 0 or none"
    wrong = 0 in r.map_unknown.shape or not _is_finite(r.map_unknown) or bool(np.any(r.map_unknown < 0))
    yield "map_unknown", wrong, "are no numbers of trees per m²"


def _is_finite(values: Array) -> bool:
    return bool(np.all(np.abs(values) <= FARTHEST))  # False for NaN


def _is_definite(covariances: NDArray[np.float64]) -> bool:
    """True if matrices (N, d, d) are finite and symmetric, with positive variances and definite position blocks."""
    if not _is_finite(covariances):
        return False
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    scale = variances.max(axis=1, initial=0.0)[:, None, None]
    symmetric = np.all(np.abs(covariances - covariances.transpose(0, 2, 1)) <= 1e-6 * scale)
    slim = covariances[:, 0, 1] ** 2 > (1 + 1e-9) * variances[:, 0] * variances[:, 1]
    return bool(symmetric and np.all(variances > 0) and not np.any(slim))


def _fails(decode: Callable[[str], object], text: str) -> bool:
    try:
        decode(text)
    except (ValueError, RecursionError):  # errors of msgspec are ValueErrors
        return True
    return False
