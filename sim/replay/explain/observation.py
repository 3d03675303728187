"""One person to one UAV at one scan: the view, the pixels, the detection, and its data association."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from sim.recording.recording import Recording
from sim.replay.explain.association import Association
from sim.replay.frames.rerender import Rerenderer
from sim.replay.frames.sightings import Sighting
from sim.scenario.scenario import Scenario
from sim.sensing.cameras import view_of
from sim.sensing.detection_truth import matched_detections, visible_pixels
from tracking.numerics.arrays import Array, Indices
from tracking.numerics.assignment import pairs_within
from tracking.numerics.distances import squared_distance


@dataclass(frozen=True, eq=False)
class PersonMeasurement:
    """The measurement of a person."""

    measurement: int
    pixel: Array | None  # (2,); None in ideal sensing
    place: Array  # (2,) m
    error: float  # m
    sigmas: float  # of the error, in the standard deviations that the measurement claims


@dataclass(frozen=True, eq=False)
class PersonObservation:
    """One person to one UAV at one scan."""

    uav: int
    works: bool
    sighting: Sighting
    away: float  # m on the ground, from below the camera to the person; NaN where absent
    whole: int | None  # pixels that the frame would show of the person without trees; None where it was not rendered
    found: PersonMeasurement | None
    owners: Indices  # (N,), the person of each measurement; -1 for a false alarm
    association: Association | None  # of all tracks and measurements; None where the camera took no frame


class Observer(ExitStack):
    """Observations of people in a recording; renders frames again where these were rendered."""

    def __init__(self, recording: Recording, scenario: Scenario) -> None:
        super().__init__()
        self.recording, self.scenario = recording, scenario
        self.again = self.enter_context(Rerenderer(recording))
        self._bare: Rerenderer | None = None
        # Of a scan k and a UAV; stories ask for some of the last again.
        self.association = lru_cache(1024)(partial(Association.of, recording, scenario))

    def observe(self, k: int, uav: int, person: int) -> PersonObservation:
        """The observation of one person by one UAV at scan k."""
        recording, view = self.recording, view_of(self.scenario.uavs[uav], self.scenario)
        sighting = Sighting.all_of(recording, self.scenario, k, uav, view)[person]
        works = bool(recording.working[k, uav])
        association = self.association(k, uav)
        rows = self._measured(k, uav) if association else np.full(recording.people.shape[1], -1)
        return PersonObservation(
            uav=uav,
            works=works,
            sighting=sighting,
            away=float(np.hypot(*(recording.people[k, person] - recording.cameras[k, uav, :2]))),
            whole=self._whole(k, uav, sighting) if works else None,
            found=self._found(k, uav, person, int(rows[person])),
            owners=_owners(rows, len(recording.scan_at(k, uav).measurements)),
            association=association,
        )

    def owners(self, k: int, uav: int) -> Indices:
        """The person of each measurement (N,) of one UAV at scan k; -1 for a false alarm."""
        return _owners(self._measured(k, uav), len(self.recording.scan_at(k, uav).measurements))

    def _renders(self, k: int, uav: int) -> bool:
        return self.scenario.sensing.renders and self.scenario.has_frame(uav, k)

    def _whole(self, k: int, uav: int, sighting: Sighting) -> int | None:
        """Pixels of the person in the same frame of the same world without its trees."""
        if not self._renders(k, uav) or not (sighting.inside or sighting.pixels):
            return None
        if self._bare is None:
            treeless = replace(self.recording, trees=np.zeros((0, 6)))
            self._bare = self.enter_context(Rerenderer(treeless))
        people = self._bare.rendered(k, uav).people
        return int(visible_pixels(people, self.recording.people.shape[1])[sighting.person])

    def _measured(self, k: int, uav: int) -> Indices:
        """The measurement of each person (M,); -1 for people not detected.

        Rendered frames tell as they did in flight, by the detection's pixel. In ideal sensing it is the nearest.
        """
        recording = self.recording
        detected, people = recording.matched[k, uav], recording.people[k]
        rows = np.full(len(people), -1)
        if self._renders(k, uav):
            mask = self.again.rendered(k, uav).people
            rows = matched_detections(recording.pixels_at(k, uav), mask, len(people))
        elif detected.any():
            gaps = recording.scan_at(k, uav).measurements[None] - people[detected][:, None]
            seen = np.flatnonzero(detected)
            for target, found in pairs_within(np.sum(gaps**2, axis=2), np.inf):
                rows[seen[target]] = found
        return np.where(detected, rows, -1)

    def _found(self, k: int, uav: int, person: int, row: int) -> PersonMeasurement | None:
        if row < 0:
            return None
        scan, pixels = self.recording.scan_at(k, uav), self.recording.pixels_at(k, uav)
        error = scan.measurements[row] - self.recording.people[k, person]
        return PersonMeasurement(
            measurement=row,
            pixel=pixels[row] if len(pixels) else None,
            place=scan.measurements[row],
            error=float(np.hypot(*error)),
            sigmas=float(np.sqrt(squared_distance(error, scan.covariances[row]))),
        )


def _owners(rows: Indices, count: int) -> Indices:
    owners = np.full(count, -1)
    people = np.flatnonzero(rows >= 0)
    owners[rows[people]] = people
    return owners
