"""The trackers of a fleet on a flight from elsewhere, and their recording."""

import time as clock
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim.exchange.scanned_flight import ScannedFlight
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.score import owners_of
from sim.mission.radio import draw_links
from sim.mission.recorder import Recorder
from sim.mission.snapshot import Snapshot, measure_errors
from sim.mission.tracker_fleet import TrackerFleet
from sim.mission.tracker_setup import make_initial_tracks
from sim.scenario.random_streams import stream
from sim.scenario.scenario import encode_scenario
from sim.world.believed_forest import believe_forest
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import at_target_height
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.distances import squared_distance
from tracking.track import Scan

_OWN = 13.8  # largest squared distance of a detection from its person: 99.9 % of chi-square


def name_flight(folder: Path) -> str:
    """The name of a flight from elsewhere, which stands in place of a planner."""
    name = folder.resolve().name
    return name if name.startswith("flight") else f"flight {name}"


def track_flight(
    flight: ScannedFlight, *, name: str = "flight", seed: int = 0, progress: Callable[[int], None] = lambda k: None
) -> Outcome:
    """Give a flight to the trackers of its scenario; the outcome has a recording like that of a mission.

    name: in place of a planner. seed: decides which messages a network with losses loses, and the map that UAVs
    believe. Where people are unknown, the recording has none. `progress` is called with each scan.
    """
    begun = clock.perf_counter()
    setting = flight.setting
    uavs = range(len(setting.uavs))
    nothing = np.zeros((0, 2))
    truth = [flight.people.at(time) if flight.people else (nothing, np.zeros(0)) for time in setting.scan_times]
    people = [positions for positions, _ in truth]
    initial = make_initial_tracks(setting, people[0], people[min(1, len(people) - 1)])
    trackers, forest = TrackerFleet(setting, initial), believe_forest(flight.forest, setting, seed)
    radio = stream(seed, "network")
    recorder = Recorder()
    for k, time in enumerate(setting.scan_times):
        poses = [Pose(row[:3], row[3:]) for row in flight.poses[k]]
        working = [i for i in uavs if setting.works(i, time)]
        scans = {i: replace(flight.observed[k, i].scan, forest=forest) for i in working if flight.frames[k, i]}
        links = draw_links(setting.network, time, flight.poses[k, :, :3], radio)
        sent = trackers.step(time, scans, links, working)
        tracks = [trackers[i].tracks if i in working else () for i in uavs]
        seen = [scans.get(i) or Scan(i, time, poses[i], nothing, np.zeros((0, 2, 2)), forest) for i in uavs]
        snapshot = Snapshot(
            time=time,
            people=people[k],
            headings=truth[k][1],
            poses=poses,
            cameras=poses,
            working=working,
            frames_taken=flight.frames[k],
            commands=np.zeros((len(uavs), 2)),
            scans=seen,
            pixels=[flight.observed[k, i].pixels if i in scans else nothing for i in uavs],
            tracks=tracks,
            plans=None,
            # Where people are unknown, zeros; NaN of UAVs that do not work.
            known_ospa=(1.0 if flight.people else 0.0) * measure_errors(tracks, working, people[k]),
            visible=np.array([_find_shown(flight, i, scans.get(i), people[k]) for i in uavs], dtype=np.int64),
            matched=np.array([_find_detected(scan, people[k]) for scan in seen]),
            bytes_sent=sent,
            plan_bytes=np.zeros(len(uavs), dtype=np.int64),
            plan_rounds=0,
        )
        recorder.add(snapshot)
        progress(k)
    recording = recorder.recording(
        scenario=encode_scenario(setting), planner=name, seed=seed, forest=flight.forest, frames=flight.frames
    )
    wall = clock.perf_counter() - begun
    return Outcome(recording, seconds={"tracking": wall}, wall_s=wall)


def _find_shown(flight: ScannedFlight, uav: int, scan: Scan | None, people: Array) -> Flags:
    """Mask (M,) of the people in plain view of a UAV's scan, as far as the map tells."""
    if scan is None or not len(people):
        return np.zeros(len(people), dtype=np.bool_)
    points = at_target_height(np.nan_to_num(people))
    camera = flight.cameras[uav]
    shown = camera.sees(scan.pose, points) & (flight.forest.detectabilities(camera.lens(scan.pose), points) >= 0.5)
    return np.asarray(shown & ~np.isnan(people[:, 0]))


def _find_detected(scan: Scan, people: Array) -> Flags:
    """Mask (M,) of the people whom a scan detected."""
    found = np.zeros(len(people), dtype=np.bool_)
    owners = owners_of(scan.measurements, people, np.flatnonzero(~np.isnan(people[:, 0])))
    for j in np.flatnonzero(owners >= 0).tolist():
        off = scan.measurements[j] - people[owners[j]]
        found[owners[j]] = squared_distance(off, scan.covariances[j]) <= _OWN
    return found
