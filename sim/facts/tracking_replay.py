"""Accounts of a recorded mission's trackers: the same trackers take the recorded scans again."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sim.mission.recorded_links import find_recorded_links, keep_sending
from sim.mission.recording import Recording
from sim.mission.tracker_fleet import TrackerFleet
from sim.mission.tracker_setup import make_initial_tracks
from tracking.account import Association, ScanAccount
from tracking.filter.motion import MOTION_MODELS, MotionModel
from tracking.fusion.member import TRACKERS, Member
from tracking.fusion.rule import FUSION_RULES
from tracking.track import Track
from tracking.tracker import Tracker

_UNKNOWN = "weights, births and reasons are unknown"


@dataclass(frozen=True)
class TrackerState:
    """One UAV's tracker after a scan."""

    account: ScanAccount
    motion: MotionModel


@dataclass(frozen=True)
class TrackingReplay:
    """States of the trackers of n UAVs up to the first scan that they did not repeat bit for bit."""

    states: list[dict[int, TrackerState]]  # of the UAVs that work, by scan and UAV
    note: str  # why there are no states from some scan on; empty if there are all

    def accounts_at(self, k: int) -> list[tuple[int, ScanAccount]]:
        """Accounts of scan k, each with its UAV; empty if they are unknown."""
        return [(uav, state.account) for uav, state in self._states_at(k).items()]

    def association(self, k: int, uav: int) -> Association | None:
        """Association of one UAV at scan k; None if it is unknown, or if its camera took no frame."""
        state = self._states_at(k).get(uav)
        return state.account.association if state else None

    def motion(self, k: int, uav: int) -> MotionModel | None:
        """Motion model that one UAV's tracker had learned by scan k; None if it is unknown."""
        state = self._states_at(k).get(uav)
        return state.motion if state else None

    def _states_at(self, k: int) -> dict[int, TrackerState]:
        return self.states[k] if k < len(self.states) else {}


@lru_cache(maxsize=1)  # because callers ask about all scans of one mission
def replay_tracking(recording: Recording) -> TrackingReplay:
    """Give the recorded scans to the trackers of the mission once more.

    Without randomness of their own they make the recorded tracks, unless another version made the recording. Plug-ins
    are not run, because a recording is a file from anywhere.
    """
    scenario = recording.setting
    states = list[dict[int, TrackerState]]()
    for registry, name in (
        (TRACKERS, scenario.tracking.tracker),
        (MOTION_MODELS, scenario.tracking.motion),
        (FUSION_RULES, scenario.network.fusion),
    ):
        if name not in registry.built_in:
            return TrackingReplay(states, f"{name} is a plug-in, which is not run again: {_UNKNOWN}")
    here, there = recording.people[[0, min(1, len(recording.people) - 1)]]
    try:
        trackers = TrackerFleet(scenario, make_initial_tracks(scenario, here, there))
        for k, links in enumerate(find_recorded_links(recording)):
            time, working = float(recording.times[k]), np.flatnonzero(recording.working[k]).tolist()
            scans = {i: recording.scan_at(k, i) for i in working if recording.frames_taken[k, i]}
            trackers.step(time, scans, links, working)
            for i in working:
                keep_sending(trackers.relay, recording, k, i)
            if any(_read_bits(trackers[i].tracks) != _read_bits(recording.tracks_at(k, i)) for i in working):
                other = "this version's trackers make other tracks than the recorded ones"
                return TrackingReplay(states, f"from {time:.1f} s on {other}: {_UNKNOWN}")
            states.append({i: _read_state(trackers[i]) for i in working})
    except ValueError as error:
        return TrackingReplay(states, f"the trackers cannot be run again: {error}")
    return TrackingReplay(states, "")


def _read_state(tracker: Member) -> TrackerState:
    assert isinstance(tracker, Tracker)  # the built-in one
    return TrackerState(tracker.account, tracker.motion)


def _read_bits(tracks: tuple[Track, ...]) -> list[tuple[int, bytes, bytes]]:
    return [(track.id, track.belief.mean.tobytes(), track.belief.covariance.tobytes()) for track in tracks]
