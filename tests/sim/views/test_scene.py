"""The scene holds who is drawn, where, as whom and in which trouble: the intents that are flown, states, names."""

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.flown_pages import eventful

from planning.planner import Plan
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.facts.people import STATES, PeopleFacts
from sim.views.drawing.palette import ALARM, LOST
from sim.views.page.data import make_page_data
from sim.views.scene import SceneMaker, make_scene, make_scenes, mark_track
from tracking.filter.kalman import Gaussian
from tracking.track import Track

DELAYS = [0.0, 1.0, 3.4]
STEPS = np.array([[3.0, 4.0], [-4.0, 3.0], [0.0, -5.0]])  # m/s, of each UAV, which turns each second


class Turning:
    """Flies each UAV another way from second to second, whatever it planned before."""

    def plan(self, team, rng):
        return [Plan(np.roll(STEPS, -s.own.id - round(s.time), axis=0)) for s in team]


@pytest.fixture(scope="module", params=DELAYS)
def delayed(request):
    """A delay, and a mission flown with it."""
    options = (*IDEAL, "trees.density=0", f"network.plan_delay={request.param}")
    return request.param, recorded(*options, planner=Turning(), duration=6)


def expected(delayed, k, uav):
    """The places at the end of each step left, by the recording alone; none while no plan is due.

    The first step of each plan ends where the UAV is when the next one is due, which the recording tells.
    """
    delay, recording = delayed
    since = k - round(5 * delay)
    if since < 0:
        return None
    over, controls = k + 5 - since % 5, recording.plans[since // 5, uav]
    return recording.poses[over, uav, :2] + np.vstack([np.zeros(2), np.cumsum(controls[1:], axis=0)])


def test_intents_are_what_is_flown_from_when_a_plan_is_due_and_the_page_has_them(delayed):
    recording = delayed[1]
    scenes = list(make_scenes(recording, PeopleFacts(recording).hold_states))
    page = make_page_data(Flight(recording), None)["uavs"]
    for k in range(len(recording.times) - 5):
        for uav in range(3):
            ends, intent = expected(delayed, k, uav), scenes[k].uavs[uav].intent
            assert (intent is None) == (ends is None) == (page[k][uav][-1] is None)
            if ends is not None:
                np.testing.assert_allclose(intent, [recording.poses[k, uav, :2], *ends], atol=1e-9)
                np.testing.assert_allclose(np.reshape(page[k][uav][-1], (-1, 2)), ends, atol=0.0051)


def flat(scene):
    """A scene in a form that can be compared."""
    uavs = [(u.name, u.colour, u.trouble, u.touched, np.array(u.view).tolist(), np.array(u.intent).tolist(),
             [(t.name, t.colour, t.mean.tolist()) for t in u.tracks]) for u in scene.uavs]  # fmt: skip
    people = [(p.number, p.place.tolist(), p.hold, p.view) for p in scene.people]
    return scene.time, scene.owner, uavs, people, [(t.colour, t.places.tolist()) for t in scene.trails]


def test_scenes_in_flight_those_of_a_recording_and_that_of_one_scan_are_the_same():
    recording = eventful()
    history = PeopleFacts(recording)
    flown = SceneMaker(recording.setting)
    for k, scene in enumerate(make_scenes(recording, history.hold_states)):
        assert flat(flown.add(recording.snapshot(k))) == flat(scene)
        if k % 5 == 4:
            assert flat(make_scene(recording, k, history.hold_states[k])) == flat(scene)


def test_people_are_as_seen_and_held_as_the_history_says_and_uavs_break_down():
    recording = eventful()
    history = PeopleFacts(recording)
    for k, scene in enumerate(make_scenes(recording, history.hold_states)):
        assert [person.number for person in scene.people] == np.flatnonzero(recording.present[k]).tolist()
        for person in scene.people:
            best = STATES[history.camera_states[k, :, person.number].max()]
            assert person.view == ("seen" if best in ("seen", "missed") else best)
            assert (person.look.trouble == LOST) == (history.hold_states[k, person.number] == HOLDS.index("lost"))
        broken = scene.uavs[2]
        assert broken.works == (k < 10) and scene.owner == 0
        if k >= 10:
            assert broken.name == "UAV 2: broken down" and broken.trouble == ALARM
            assert broken.view is None and broken.intent is None


def test_names_of_tracks_that_are_not_reported_have_a_question_mark():
    belief = Gaussian(np.zeros(4), np.eye(4))
    assert [mark_track(Track(8, belief, r), 3).name for r in (1.0, 0.51, 0.5, 0.01)] == ["3", "3", "3?", "3?"]
