"""Made-up missions for pages: losses known beforehand, a breakdown, contacts and faults."""

import dataclasses

import numpy as np

from helpers import synthetic
from helpers.flights import IDEAL
from helpers.flights import recorded as recorded_in_flight
from helpers.recordings import broken, record
from sim.mission.fault import Fault
from sim.mission.recording import encode_faults
from sim.views.drawing.film import Film, Video

EVIL = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)> & \"it's\""
LOST = ((2, 5, 9), (1, 8, 8), (0, 15, 20))  # person, first and last scan
FAULTS = [Fault(0.0, None, EVIL), Fault(1.0, None, EVIL), Fault(2.0, 2, "broke down, hovers from now on")]


def flown(scans=21, **changes):
    """A made-up mission."""
    return record(scans, planner=EVIL, seed=7, **changes)


def eventful():
    """A mission with losses known beforehand, a UAV that breaks down at scan 10, contacts and faults."""
    recording = flown()
    means = recording.track_means.copy()
    scan = np.repeat(np.arange(63), np.diff(recording.track_offsets)) // 3
    for person, first, last in LOST:
        means[(recording.track_ids == person + 1) & (first <= scan) & (scan <= last), :2] += 4.0
    return dataclasses.replace(broken(recording, 2, 10), track_means=means, faults=encode_faults(FAULTS))


def lost_between_tenths():
    """A mission at 20 scans a second in which all people are lost at scan 3, at 0.15 s, until scan 6."""
    recording = recorded_in_flight(*IDEAL, "rates.sensing=20", "sensing.field_of_view=unlimited", duration=1)
    means, uavs = recording.track_means.copy(), recording.poses.shape[1]
    scan = np.repeat(np.arange(len(recording.track_offsets) - 1), np.diff(recording.track_offsets)) // uavs
    means[(scan >= 3) & (scan <= 5), :2] += 30.0
    return dataclasses.replace(recording, track_means=means)


def film_of(path, recording):
    setting = recording.setting
    with Video(path, Film(setting, recording.forest, planner="hover"), fps=5) as video:
        for k in range(len(recording.times)):
            snapshot = recording.snapshot(k)
            video.add(snapshot, synthetic.frames(setting, recording.forest, snapshot))
    return path
