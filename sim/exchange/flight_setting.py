"""The scenario of a flight from elsewhere: its own settings of trackers and network, and what its files contain."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sim.exchange.values import LoggedFlight, LoggedUav
from sim.scenario.loading import decode
from sim.scenario.scenario import Scenario, leave_out_removed_keys
from tracking.errors import InputError, spell
from tracking.geometry.person import TARGET_HEIGHT
from tracking.numerics.arrays import Array

# Hz, rates of scans: the first of which the times of all frames are multiples, or else the first of the finer ones at
# which no UAV has two frames in a scan.
_RATES = (1, 2, 4, 5, 8, 10, 15, 16, 20, 24, 25, 30)
_FINE_RATES = (20, 25, 30, 40, 50, 60, 100, 120, 200, 250, 500, 1000)
EXACT = 1e-3  # periods, largest difference of times from a multiple
_HIGHEST = 10_000  # m, as of altitudes of UAVs
_PHYSICS = 240  # Hz, or a multiple of the rate of scans; nothing is simulated
# Keys of trees that say how to read a stem map.
_TREES = ("same_place", "status", "canopy_radius", "canopy_base", "canopy_top", "trunk_radius", "leaf_area_density")
_SIMULATED = ("dynamics", "wind", "appearance", "first_decision", "ground")  # keys without a meaning for a flight


def _find_rate(given: Mapping[str, Any], uavs: Sequence[LoggedUav]) -> int:
    """Rate [Hz] of a flight's scans: that of `rates.sensing`, or one that fits the times of frames.

    InputError if a UAV has two frames in one scan.
    """
    times = [np.array([frame.time for frame in uav.frames]) for uav in uavs]
    every = np.concatenate(times)
    asked = given.get("rates", {}).get("sensing")
    fitting = [r for r in _RATES if np.abs(every * r - np.round(every * r)).max() <= EXACT]
    for rate in [asked] if isinstance(asked, int) and asked > 0 else [*fitting, *_FINE_RATES]:
        crowded = _find_crowded(times, rate)
        if crowded is None:
            return int(rate)
    assert crowded
    uav, time, gap = crowded
    two = f"UAV {uav} has two frames {spell(gap, 3)} s apart, at {spell(time)} s, in one scan of {rate} Hz"
    unit = "" if asked else "; are times in seconds?"
    raise InputError(f"rates.sensing: {two}; allowed are rates at which each scan has one frame of a UAV{unit}")


def _find_crowded(times: Sequence[Array], rate: int) -> tuple[int, float, float] | None:
    """UAV, time and gap [s] of two frames in one scan; None if there are none."""
    for uav, own in enumerate(times):
        same = np.flatnonzero(np.diff(np.round(own * rate)) == 0)
        if len(same):
            return uav, float(own[same[0]]), float(own[same[0] + 1] - own[same[0]])
    return None


def pick_tree_keys(given: Mapping[str, Any]) -> dict[str, Any]:
    """What the tables of a scenario say of how to read a stem map."""
    table = given.get("trees")
    return {key: table[key] for key in _TREES if key in table} if isinstance(table, dict) else {}


def find_stem_map(folder: Path) -> Path | None:
    """The stem map of a flight, if it has one."""
    return next((folder / name for name in ("trees.csv", "trees.geojson") if (folder / name).exists()), None)


def make_setting(folder: Path, given: Mapping[str, Any], flight: LoggedFlight) -> Scenario:
    """The scenario of a flight from the tables of its `scenario.toml`, and from its other files."""
    rate = _find_rate(given, flight.uavs)
    # Of the last scan with a frame, whose own time may be a little earlier or later.
    end = given.get("duration", max(round(uav.frames[-1].time * rate) for uav in flight.uavs) / rate)
    data = _leave_out(leave_out_removed_keys(given), *_SIMULATED)  # which exports of earlier releases have
    tracking = {"initial_tracks": "none", **data.get("tracking", {})}
    if tracking["initial_tracks"] == "known" and flight.labels is None:
        hint = 'set it to "none", or add truth.csv'
        raise InputError(f'tracking.initial_tracks: "known" needs the people, and {folder} has no truth.csv; {hint}')
    walked = {"start": flight.start, "origin": flight.origin, "outside": "clip"}
    people: dict[str, Any] = {"count": 0}
    if flight.labels:
        people = {**data.get("people", {}), **walked, "trajectories": os.path.abspath(flight.labels)}
    stems = find_stem_map(folder)
    return decode(
        {
            **data,
            "duration": end or 1 / rate,
            "dynamics": "kinematic",
            "geo": msgspec.to_builtins(flight.geo),
            "trees": {"file": os.path.abspath(stems), **pick_tree_keys(given)} if stems else {"density": 0},
            "people": people,
            "uavs": list(_list_uavs(data.get("uavs", ()), flight)),
            "rates": {**data.get("rates", {}), "sensing": rate, "physics": rate * -(-_PHYSICS // rate)},
            "sensing": {
                **{key: value for key, value in data.get("sensing", {}).items() if key != "detector"},
                "mode": "ideal",
            },
            "tracking": tracking,
            "network": _leave_out(data.get("network", {}), "plan_delay"),
        }
    )


def _list_uavs(given: Sequence[Mapping[str, Any]], flight: LoggedFlight) -> Iterator[dict[str, Any]]:
    """Tables of UAVs, with their usual altitudes; of those that are given, breakdowns and navigation are kept."""
    for i, uav in enumerate(flight.uavs):
        altitude = float(np.median(uav.poses.rows[:, 2]))
        if not TARGET_HEIGHT < altitude <= _HIGHEST:
            above = f"heights are in metres above the ground below, to {_HIGHEST}, and cameras above people"
            above += "; is ground.file in metres above the sea, as poses are?" * (flight.ground.surface is not None)
            raise InputError(f"poses: UAV {i}, column z_m: is {spell(altitude, 3)} m in the median; {above}")
        own = given[i] if i < len(given) else {}
        kept = {key: own[key] for key in ("fails_at", "navigation") if key in own}
        # Where a UAV starts is not used; with a radius, all may do so at one place.
        view = {"start": (0.0, 0.0), "start_radius": 1.0, "altitude": altitude}
        yield {**view, **uav.camera.view, **kept}


def _leave_out(table: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in keys}
