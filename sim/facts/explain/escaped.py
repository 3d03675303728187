"""Where the person of a lost track may be: as predicted, or away from the track after a turn out of sight."""

import numpy as np

from sim.facts.recorded_fleet import make_known_forest
from sim.mission.recorded_links import find_recorded_links
from sim.mission.recording import Recording
from sim.sensing.cameras import view_of
from tracking.geometry.camera import Look
from tracking.management.escapes import Escapes
from tracking.track import SIGHTED_AT, Track


def find_parts(recording: Recording, k: int, uav: int, id_: int) -> list[Track]:
    """A UAV's track after scan k, split by `Escapes`; the track alone unless its person is out of sight.

    Frames at decisions count, of UAVs in contact. In a network that takes time the UAV's own alone count.
    """
    setting = recording.setting
    escapes, parts = Escapes(), list[Track]()
    area, cameras = (setting.area.width, setting.area.height), [view_of(one, setting) for one in setting.uavs]
    last = _find_track(recording, k, uav, id_)
    since = last[0].sighting[SIGHTED_AT] if last else np.nan
    links = find_recorded_links(recording)
    for j in range(int(np.searchsorted(recording.times, since)), k + 1):
        if not (setting.decides(j) or j == k):
            continue
        heard = links[j].contact[uav] & (not setting.network.takes_time)
        taken = [i for i in range(len(cameras)) if (heard[i] or i == uav) and recording.frames_taken[j, i]]
        looks = [Look(cameras[i], recording.believed_camera_at(j, i)) for i in taken] if setting.decides(j) else []
        tracks = _find_track(recording, j, uav, id_)
        parts = escapes.split(float(recording.times[j]), tracks, looks, make_known_forest(recording), area)
    return parts or last


def _find_track(recording: Recording, k: int, uav: int, id_: int) -> list[Track]:
    return [track for track in recording.tracks_at(k, uav) if track.id == id_]
