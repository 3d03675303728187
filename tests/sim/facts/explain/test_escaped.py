"""Where explanations have people who turned out of sight: where the planner had them during the mission."""

import math

import numpy as np
import pytest
from helpers.flights import fly, recording_of

from planning.baselines import Greedy
from sim.facts.explain.explanation import explain_person
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import find_parts, make_person_facts
from sim.facts.flight import Flight
from sim.facts.words import format_percent
from tracking.management.escapes import Escapes

PAIR = "uavs=[{{start=[-28,-2],footprint=20{0}}},{{start=[28,2],footprint=27,rate=0.5{0}}}]"
NAMES = ["east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east"]
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


def test_words_give_the_probabilities_and_places_of_the_parts(mission):
    recording, told = mission[0], 0
    with Observer(Flight(recording)) as observer:
        for k, person in np.ndindex(recording.people.shape[:2]):
            holders = make_person_facts(observer, k, person).holders if k % 7 == 0 else ()
            for kept, *turned in (holder.parts for holder in holders if len(holder.parts) > 1):
                turned.sort(key=lambda part: -part.existence)
                away = [part.belief.mean[:2] - part.sighting[:2] for part in turned]
                names = [NAMES[round(math.degrees(math.atan2(y, x)) / 45.0) % 8] for x, y in away]
                shares = [format_percent(part.existence) for part in (kept, *turned)]
                ways = [f"{math.hypot(*way):.0f} m {name} " for way, name in zip(away, names, strict=True)]
                whole = format_percent(sum(part.existence for part in turned))
                line = (
                    f"by escape=20: goes on as predicted with {shares[0]}, or turned, to where no frame "
                    f"of a decision looked, with {whole}, from the last detection "
                )
                line += ", ".join(way + share for way, share in zip(ways, shares[1:], strict=True))
                facts = make_person_facts(observer, k, person)
                assert line in [sentence for group in explain_person(facts) for sentence in group.sentences]
                told += 1
    assert told >= 3
