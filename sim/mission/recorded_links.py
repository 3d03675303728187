"""Links of the UAVs of a recording, and the age of what they had received."""

import numpy as np

from sim.mission.radio import RadioLinks, draw_links
from sim.mission.recording import Recording
from sim.mission.scan_relay import ScanRelay, Sent
from sim.scenario.random_streams import stream
from tracking.numerics.arrays import Array


def find_recorded_links(recording: Recording) -> list[RadioLinks]:
    """The links of each scan, computed again from places, scenario, seed and repeat, which alone determine them."""
    network = recording.setting.network
    rng = stream(recording.seed, "network", repeat=recording.repeat)
    found = []
    for time, poses, working in zip(recording.times.tolist(), recording.poses, recording.working, strict=True):
        links = draw_links(network, time, poses[:, :3], rng)
        found.append(links._replace(up=np.asarray(links.up & working[:, None] & working)))
    return found


def keep_sending(relay: ScanRelay, recording: Recording, k: int, uav: int) -> None:
    """Send what a UAV sent beside scans at scan k, maps and then plans, which keep later scans waiting."""
    for sizes in (recording.map_bytes, recording.plan_bytes):
        if sizes is not None:
            relay.transmit(uav, float(recording.times[k]), int(sizes[k, uav]))


def measure_ages(recording: Recording) -> Array:
    """Age (K, n, n) s of the newest scan of the column's UAV that the row's one has at each scan.

    NaN of UAVs that do not work, of each UAV's own scans, before a first one arrives, and all in a network without
    delays, in which consensus has no single scans.
    """
    network = recording.setting.network
    uavs = recording.uav_count
    newest = np.full((uavs, uavs), np.nan)
    ages = np.full((recording.scan_count, uavs, uavs), np.nan)
    relay = ScanRelay(network, uavs)
    for k, links in enumerate(find_recorded_links(recording) if network.takes_time else ()):
        time, working = float(recording.times[k]), np.flatnonzero(recording.working[k]).tolist()
        for i in working:
            for sent in relay.receive(i, time):
                newest[i, sent.uav] = np.fmax(newest[i, sent.uav], sent.content.time)
        for i in working:
            own = [Sent(k, i, recording.scan_at(k, i))] if recording.frames_taken[k, i] else []
            relay.send(i, time, own, links, working, size=int(recording.bytes_sent[k, i]))
            keep_sending(relay, recording, k, i)
        both = np.ix_(working, working)
        ages[k][both] = time - newest[both]
    return ages
