"""Where explanations have people who turned out of sight: where the planner had them during the mission."""

import numpy as np
import pytest
from helpers.flights import fly, recording_of

from planning.baselines import Greedy
from sim.replay.explain.escaped import find_parts
from sim.replay.explain.explanation import explain_person
from sim.replay.explain.observation import Observer
from sim.replay.explain.person import PersonFacts
from sim.replay.flight import Flight
from tracking.management.escapes import Escapes


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


@pytest.fixture(scope="module")
def mission():
    """A recording in which radios reach 30 m and one camera has no frame at every other decision, and its planner."""
    fleet = "uavs=[{start=[-28,-2],footprint=20},{start=[28,2],footprint=27,rate=0.5}]"
    planner = Remembering()
    flown, snapshots = fly("trees.density=75", "network.range=30", fleet, planner=planner, seed=3, duration=14)
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


def test_words_give_the_probabilities_of_the_parts(mission):
    recording, told = mission[0], 0
    with Observer(Flight(recording)) as observer:
        for k, person in np.ndindex(recording.people.shape[:2]):
            facts = PersonFacts.of(observer, k, person)
            if k % 7 or not any(len(holder.parts) > 1 for holder in facts.holders):
                continue
            (holder,) = [holder for holder in facts.holders if len(holder.parts) > 1][:1]
            kept, *turned = holder.parts
            text = "\n".join(line for group in explain_person(facts) for line in group.sentences)
            percents = [100.0 * share for share in (kept.existence, sum(part.existence for part in turned))]
            assert f"walks on as predicted with {percents[0]:.{0 if 10 <= percents[0] <= 90 else 1}f} %" in text
            assert sum(percents) <= 100.0
            told += 1
    assert told >= 5
