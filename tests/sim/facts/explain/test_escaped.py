"""Where explanations have people who turned out of sight: where the planner had them during the mission."""

import numpy as np
import pytest
from helpers.flights import fly, recording_of

from planning.baselines import Greedy
from sim.facts.explain.person import find_parts
from tracking.management.escapes import Escapes

PAIR = "uavs=[{{start=[-28,-2],footprint=20{0}}},{{start=[28,2],footprint=27,rate=0.5{0}}}]"
# A network that is cut, cameras fixed to bodies in wind, poses that err, messages that come late.
SETTINGS = {
    "cut": ("network.range=30", PAIR.format("")),
    "wind": ("wind.velocity=[5,0]", PAIR.format(",mount='body'")),
    "poses": (PAIR.format(",navigation='gnss'"),),
    "late": ("network.delay=1", PAIR.format("")),
}


class Remembering(Greedy):
    """A planner that keeps the parts of the tracks of each UAV at each decision."""

    def __init__(self):
        super().__init__()
        self.escapes, self.parts = {}, {}

    def plan(self, team, rng):
        for s in team:
            escapes = self.escapes.setdefault(s.own.id, Escapes())
            self.parts[s.time, s.own.id] = escapes.split(s.time, s.tracks, s.looks, s.forest, s.area)
        return super().plan(team, rng)


@pytest.fixture(scope="module", params=SETTINGS)
def mission(request):
    """A recording in which one camera has no frame at every other decision, and its planner."""
    planner = Remembering()
    flown, snapshots = fly("trees.density=75", *SETTINGS[request.param], planner=planner, seed=3, duration=14)
    return recording_of(flown, snapshots, seed=3), planner


def test_parts_are_those_that_the_uav_had_at_its_decisions(mission):
    recording, planner = mission
    split = 0
    for (time, uav), parts in planner.parts.items():
        k = int(np.searchsorted(recording.times, time))
        for id_ in recording.track_ids_at(k, uav).tolist():
            had = [part for part in parts if part.id == id_]
            found = find_parts(recording, k, uav, id_)
            assert [part.existence for part in found] == [part.existence for part in had]
            for one, other in zip(found, had, strict=True):
                np.testing.assert_array_equal(one.belief.mean, other.belief.mean)
            split += len(had) > 1
    assert split >= 10
