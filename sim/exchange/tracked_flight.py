"""The trackers of a fleet on a flight from elsewhere, and their recording."""

import time as clock
from collections.abc import Callable

import numpy as np

from sim.exchange.flight_log import FlightLog
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.score import owners_of
from sim.mission.radio import draw_links
from sim.mission.recorder import Recorder
from sim.mission.snapshot import Snapshot, measure_errors
from sim.mission.tracker_fleet import TrackerFleet
from sim.mission.tracker_setup import make_initial_tracks
from sim.scenario.random_streams import stream
from sim.scenario.scenario import encode_scenario
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import at_target_height, detectable_shares
from tracking.numerics.arrays import Array, Flags
from tracking.numerics.distances import squared_distance
from tracking.track import Scan

_OWN = 13.8  # largest squared distance of a detection from its person: 99.9 % of chi-square


def track_flight(
    log: FlightLog, *, name: str = "flight", seed: int = 0, progress: Callable[[int], None] = lambda k: None
) -> Outcome:
    """Give a flight to the trackers of its scenario; the outcome has a recording like that of a mission.

    name: in place of a planner. seed: decides which messages a network with losses loses. Where people are unknown, the
    recording has none. `progress` is called with each scan.
    """
    begun, setting, network = clock.perf_counter(), log.setting, log.setting.network
    uavs = range(len(setting.uavs))
    truth = [log.people.at(time) if log.people else (np.zeros((0, 2)), np.zeros(0)) for time in setting.scan_times]
    people = [positions for positions, _ in truth]
    initial = make_initial_tracks(setting, people[0], people[min(1, len(people) - 1)])
    trackers = TrackerFleet(setting, log.forest, initial)
    cameras, radio, recorder = log.cameras, stream(seed, "network"), Recorder()
    for k, time in enumerate(setting.scan_times):
        poses = [Pose(row[:3], row[3:]) for row in log.poses[k]]
        working = [i for i in uavs if setting.works(i, time)]
        scans = {i: log.observed[k, i][0] for i in working if log.frames[k, i]}
        links = draw_links(network, time, log.poses[k, :, :3], radio)
        sent = trackers.step(time, scans, links, working)
        tracks = [trackers[i].tracks if i in working else () for i in uavs]
        views = [_find_people(log, cameras[i], scans.get(i), people[k]) for i in uavs]
        nothing = (np.zeros((0, 2)), np.zeros((0, 2, 2)))
        snapshot = Snapshot(
            time=time,
            people=people[k],
            headings=truth[k][1],
            poses=poses,
            cameras=poses,
            frames=log.frames[k],
            commands=np.zeros((len(uavs), 2)),
            scans=[scans.get(i) or Scan(i, time, poses[i], *nothing) for i in uavs],
            pixels=[log.observed[k, i][1] if i in scans else nothing[0] for i in uavs],
            tracks=tracks,
            plans=None,
            # Where people are unknown, zeros; NaN of UAVs that do not work.
            ospa=(1.0 if log.people else 0.0) * measure_errors(tracks, working, people[k]),
            visible=np.array([shown for shown, _ in views], dtype=np.int64),
            matched=np.array([found for _, found in views]),
            bytes_sent=sent,
            plan_bytes=np.zeros(len(uavs), dtype=np.int64),
            plan_rounds=0,
        )
        recorder.add(snapshot)
        progress(k)
    recording = recorder.recording(
        scenario=encode_scenario(setting), planner=name, seed=seed, forest=log.forest, frames=log.frames
    )
    return Outcome(recording, wall_s=clock.perf_counter() - begun)


def _find_people(log: FlightLog, camera: Camera, scan: Scan | None, people: Array) -> tuple[Flags, Flags]:
    """Masks (M,) of the people in plain view of a scan's camera, as far as the map tells, and of those it detected."""
    shown, found = np.zeros((2, len(people)), dtype=np.bool_)
    if scan is None or not len(people):
        return shown, found
    points, there = at_target_height(np.nan_to_num(people)), ~np.isnan(people[:, 0])
    free = detectable_shares(log.forest.free_shares(scan.pose.position, points)[0])
    shown = there & camera.sees(scan.pose, points) & (free >= 0.5)
    owners = owners_of(scan.measurements, people, np.flatnonzero(there))
    for j in np.flatnonzero(owners >= 0).tolist():
        off = scan.measurements[j] - people[owners[j]]
        found[owners[j]] = squared_distance(off, scan.covariances[j]) <= _OWN
    return shown, found
