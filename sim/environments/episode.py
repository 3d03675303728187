"""One episode of an environment: a mission, flown from decision to decision."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.planner import Situation
from sim.facts.flight import Flight
from sim.facts.metrics.holding import FAR
from sim.mission.mission import Mission
from sim.mission.snapshot import Snapshot, find_reported_positions
from sim.running.fly import record
from sim.scenario.scenario import Scenario
from sim.views.drawing.film import Film
from tracking.metrics.ospa import gospa
from tracking.numerics.arrays import Array

NAME = "environment"  # shown as the planner on films and in recordings


class Episode:
    """One mission from decision to decision; after the last decision UAVs hover until the end of the mission."""

    def __init__(self, scenario: Scenario, seed: int, repeat: int) -> None:
        """Fly to the first decision."""
        self.mission = Mission(scenario, seed=seed, repeat=repeat)
        self.team: dict[int, Situation] = {}  # situations of the working UAVs at this decision, by id
        self.over = False  # True at the last decision, or when all UAVs have broken down
        self.now: Snapshot  # this scan, without plans
        self.images: dict[int, NDArray[np.uint8]] = {}  # the last frame of each UAV that has taken one
        self._taken: dict[int, float] = {}  # s, times of these frames
        self._flown: list[Snapshot] = []
        self._film: Film | None = None
        self._drawn = -math.inf  # s, the last scan that the film knows
        self._image: NDArray[np.uint8]  # of that scan
        self._last = scenario.decision_times[-1]
        try:
            self._go_on()
        except BaseException:
            self.close()
            raise

    def step(self, velocities: Mapping[int, Array]) -> None:
        """Fly to the next decision with a velocity (2,) m/s for each UAV of the team."""
        self._flown.append(self.mission.step([velocities[i] for i in self.team]))
        self._go_on()

    def _go_on(self) -> None:
        """Fly to the next decision, or to the end of the mission if no UAV works any more."""
        mission = self.mission
        self._keep_frames()
        while not (team := mission.situations) and not mission.over:
            self._flown.append(mission.step())
            self._keep_frames()
        self.team = {situation.own.id: situation for situation in team}
        self.now = mission.present
        self.over = not team or mission.time >= self._last
        while self.over and not mission.over:
            self._flown.append(mission.step(np.zeros((len(mission.team), 2))))

    def _keep_frames(self) -> None:
        """Keep the frames of the present scan, as slow cameras may take theirs between decisions."""
        taken = {i: frame for i, frame in enumerate(self.mission.images) if frame is not None}
        self.images |= taken
        self._taken |= dict.fromkeys(taken, self.mission.time)

    @property
    def people(self) -> Array:
        """True positions (M, 2) m of the people who are present."""
        return self.now.people[~np.isnan(self.now.people[:, 0])]

    def metrics(self, uav: int) -> dict[str, Any]:
        """Time, and true OSPA and GOSPA of one UAV's reported tracks; only the time if it has broken down."""
        metrics: dict[str, Any] = {"time": self.now.time}
        if uav in self.now.working:
            metrics["ospa"] = float(self.now.ospa[uav, 0])
            metrics["gospa"] = gospa(find_reported_positions(self.now.tracks[uav]), self.people, FAR).distance
        return metrics

    def draw(self) -> NDArray[np.uint8]:
        """This scan as a film's frame (720, 1280, 3) RGB, with map, true people, tracks and frames of cameras."""
        if self._film is None:
            self._film = Film(
                self.mission.scenario, self.mission.forest, planner=NAME, believed=self.mission.believed_forest
            )
        if self._drawn < self.now.time:
            for snapshot in self._flown:
                if self._drawn < snapshot.time < self.now.time:
                    self._film.follow(snapshot, self._find_last_frames(snapshot.time))
            self._drawn = self.now.time
            self._image = self._film.draw(self.now, self._find_last_frames(self.now.time))
        return self._image.copy()

    def _find_last_frames(self, time: float) -> list[NDArray[np.uint8] | None]:
        """The last frame of each UAV if it was taken at this time [s], otherwise None."""
        return [self.images[i] if self._taken.get(i) == time else None for i in range(len(self.mission.scenario.uavs))]

    def flight(self) -> Flight:
        """The recording so far, with tables and figures; ValueError before the first step."""
        return record(self.mission, self._flown, NAME)

    def close(self) -> None:
        """End the mission."""
        self.mission.close()
