"""Observation of one person by one UAV at one scan: view, pixels, detection and data association."""

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from sim.facts.flight import Flight
from sim.facts.metrics.score import find_owners_at
from sim.facts.rerender import Rerenderer
from sim.facts.sightings import Sighting, find_sightings, tell_map_error, tell_pose_error
from sim.facts.tracking_replay import replay_tracking
from sim.sensing.detection_truth import match_detections
from tracking.account import Association
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.distances import squared_distance


@dataclass(frozen=True, eq=False)
class PersonMeasurement:
    """The measurement of a person."""

    measurement: int
    pixel: Array | None  # (2,), None in ideal sensing
    place: Array  # (2,) m
    error: float  # m
    sigmas: float  # the error in standard deviations of the measurement


@dataclass(frozen=True, eq=False)
class PersonObservation:
    """Observation of one person by one UAV at one scan."""

    uav: int
    works: bool
    sighting: Sighting
    away: float  # m, horizontal distance from the camera to the person; NaN if absent
    errors: list[str]  # as `tell_pose_error` and `tell_map_error`
    whole: int | None  # number of pixels of the person in the frame if nothing hid it; None if it was not rendered
    found: PersonMeasurement | None
    owners: Indices  # (N,), person of each measurement; -1 for a false alarm
    # of all tracks and measurements; None if the camera took no frame, or if the tracker cannot be run again
    association: Association | None


class Observer(ExitStack):
    """Observations of people in a flight: frames are rendered again, and trackers run again."""

    def __init__(self, flight: Flight) -> None:
        super().__init__()
        self.flight = flight
        self.recording = flight.recording
        self.replay = replay_tracking(self.recording)
        # Called with a scan k and a UAV; cached, because track stories ask for the same scans again.
        self.owners = lru_cache(1024)(self._owners)

    @cached_property
    def again(self) -> Rerenderer:
        """The renderer, which only some questions need."""
        return self.enter_context(Rerenderer(self.recording))

    def observe(self, k: int, uav: int, person: int) -> PersonObservation:
        """The observation of one person by one UAV at scan k."""
        recording = self.recording
        setting = self.recording.setting
        sighting = find_sightings(recording, k, uav, setting.true_camera(uav))[person]
        owners, shown = self.owners(k, uav), self._renders(k, uav) and sighting.in_image
        return PersonObservation(
            uav=uav,
            works=bool(recording.working[k, uav]),
            sighting=sighting,
            away=float(np.hypot(*(recording.people[k, person] - recording.cameras[k, uav, :2]))),
            errors=tell_pose_error(recording, k, uav) + tell_map_error(recording, k, uav, person),
            whole=self.again.count_whole(k, uav, person) if shown else None,
            found=self._found(k, uav, person, owners),
            owners=owners,
            association=self.replay.association(k, uav),
        )

    def _renders(self, k: int, uav: int) -> bool:
        return self.recording.setting.sensing.renders and bool(self.recording.frames_taken[k, uav])

    def _owners(self, k: int, uav: int) -> Indices:
        """The person (N,) of each measurement of one UAV at scan k; -1 for a false alarm.

        With rendered frames, pixels of detections decide as in flight. In ideal sensing, it is the nearest person, as
        in metrics.
        """
        recording = self.recording
        if not self._renders(k, uav):
            return find_owners_at(recording, k, uav)[0]
        seen = np.flatnonzero(recording.matched[k, uav])
        pixels = recording.pixels_at(k, uav)
        found = np.full(len(recording.scan_at(k, uav).measurements), -1)
        if len(seen):
            rows = match_detections(pixels, self.again.rendered(k, uav).people, recording.person_count)[seen]
            found[rows[rows >= 0]] = seen[rows >= 0]
        return found

    def _found(self, k: int, uav: int, person: int, owners: Indices) -> PersonMeasurement | None:
        rows = np.flatnonzero(owners == person).tolist()
        if not rows:
            return None
        row = rows[0]
        scan, pixels = self.recording.scan_at(k, uav), self.recording.pixels_at(k, uav)
        error = scan.measurements[row] - self.recording.people[k, person]
        return PersonMeasurement(
            measurement=row,
            pixel=pixels[row] if len(pixels) else None,
            place=scan.measurements[row],
            error=float(np.hypot(*error)),
            sigmas=float(np.sqrt(squared_distance(error, scan.covariances[row]))),
        )
