"""The scene holds who is drawn, where, as whom and in which trouble: the intents that are flown, states, names."""

import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded
from helpers.flown_pages import eventful

import understory
from planning.planner import Plan
from sim.exchange.ros_scene import draw_people
from sim.facts.explain.planned_visibility import find_planned_visibility
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.facts.people import PeopleFacts
from sim.facts.sightings import STATES
from sim.views.frames.frame_facts import make_frame_facts
from sim.views.page.data import list_colours, make_page_data
from sim.views.palette import ALARM, LOST, format_css
from sim.views.scene import SceneMaker, make_scene, make_scenes, mark_track
from tracking.filter.kalman import Gaussian
from tracking.geometry.visibility import Forest, Tree
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


def test_people_are_held_as_the_history_says_and_uavs_break_down():
    recording = eventful()
    history = PeopleFacts(recording)
    for k, scene in enumerate(make_scenes(recording, history.hold_states)):
        assert [person.number for person in scene.people] == np.flatnonzero(recording.present[k]).tolist()
        for person in scene.people:
            assert (person.look.trouble == LOST) == (history.hold_states[k, person.number] == HOLDS.index("lost"))
        broken = scene.uavs[2]
        assert broken.works == (k < 10) and scene.owner == 0
        if k >= 10:
            assert broken.name == "UAV 2: broken down" and broken.trouble == ALARM
            assert broken.view is None and broken.intent is None


@pytest.mark.parametrize("seed", range(3))
def test_people_are_in_the_cameras_last_frames_as_the_facts_say_whoever_tells(seed):
    """Frames come at times of their own, as in flights from elsewhere, and the first scans may have none."""
    recording, rng = eventful(), np.random.default_rng(seed)
    shape = recording.matched.shape
    shown = recording.visible * (rng.random(shape) < 0.7)
    changes = {
        "frames": rng.random(shape[:2]) < 0.4,
        "visible": shown,
        "matched": (shown > 0) & (rng.random(shape) < 0.5),
    }
    recording = replace(recording, **changes)
    facts, told = PeopleFacts(recording), set()
    texts = [facts.view_texts(m) for m in range(recording.person_count)]
    for k, scene in enumerate(make_scenes(recording, facts.hold_states)):
        assert flat(scene)[3] == flat(make_scene(recording, k, facts.hold_states[k]))[3]
        for person in scene.people:
            best = STATES[facts.camera_states[k, :, person.number].max()]
            assert person.view == best and texts[person.number][k].startswith(best)
            told.add(best)
        for i in np.flatnonzero(recording.frames_taken[k]).tolist():
            sights = make_frame_facts(recording, k, i).people
            assert [sight.state for sight in sights] == [STATES[state] for state in facts.camera_states[k, i]]
            assert all(sight.status.startswith(sight.state) for sight in sights)
    assert told == {"out of view", "hidden", "missed", "seen"}


@pytest.mark.parametrize("options", [{}, {"network.plan_delay": 0.4}, {"uavs.0.navigation": "consumer"}])
def test_a_plan_leads_in_pictures_where_explanations_say_with_the_lag_of_quadrotors(options):
    settings = {"duration": 5, "sensing.mode": "ideal", **options}
    flight = understory.run("forest", Turning(), seed=1, settings=settings)
    recording, bent = flight.recording, 0.0
    for k, scene in enumerate(make_scenes(recording, flight.people.hold_states)):
        for uav in scene.uavs if k else ():
            planned = find_planned_visibility(recording, k, uav.number, 0, None)
            if planned is None:
                continue
            ends = np.isclose(planned.times % 1, options.get("network.plan_delay", 0.0))  # of the steps
            corners = uav.intent + uav.believed.position[:2] - uav.place
            np.testing.assert_allclose(planned.path[ends], corners[-ends.sum() :], atol=1e-9)
            raw = np.cumsum(recording.flown_at(k).plans[uav.number].controls, axis=0)[-1]
            bent = max(bent, np.linalg.norm(corners[-1] - corners[0] - raw) if k % 5 == 0 else 0.0)
    assert bent > 0.5


def test_the_page_has_the_names_trails_contacts_and_trees_of_the_scene():
    recording = eventful()
    recording.people[12:, 1] = np.nan  # leaves, and the trail stays for a while
    pines = tuple(Pine(float(x), 5.0) for x in (0, 20))
    vars(recording)["forest"] = Forest(pines)
    flight = Flight(recording)
    scenes, page = [*make_scenes(recording, flight.people.hold_states)], make_page_data(flight, None)
    assert [row[:3] for row in page["trees"][:4]] == [[x, 5.0, r] for x in (0, 20) for r in (5.0, 2.5)]
    assert [row[6] for row in page["trees"]][::2] == [
        "tree 0, canopy of 5 m radius", "tree 1, canopy of 5 m radius", "tree 0, trunk of 0.2 m radius"]  # fmt: skip
    looks, ways, touched = page["looks"], 0, set()
    for k, scene in enumerate(scenes):
        for person in scene.people:
            label, named, *_ = looks["people"][page["people"][k][person.number][0]]
            assert (label, named) == (person.name, person.named and format_css(person.named))
            assert bool(person.named) == (person.hold in ("lost", "not found yet")) == (person.title != person.name)
        texts = [m["text"] for m in draw_people(scene)["markers"] if m.get("ns") == "names"]
        assert texts == [person.title for person in scene.people if person.named]
        assert [looks["uavs"][uav[0]][5] for uav in page["uavs"][k]] == [uav.touched for uav in scene.uavs]
        touched |= {uav.touched for uav in scene.uavs}
        shown = [trail for trail in scene.trails if len(trail.places)]
        for (look, path, first, until), trail in zip(page["trails"][k], shown, strict=True):
            np.testing.assert_allclose(page["paths"][path][first:until], trail.places, atol=0.0051)
            assert looks["trails"][look] == (format_css(trail.colour), trail.of_track)
            ways += trail.of_track
    assert ways > 40 and len(touched) > 1


class Pine(Tree):
    """A tree with two crowns."""

    @property
    def solids(self):
        trunk, crown = super().solids
        return trunk, crown, crown._replace(radius=crown.radius / 2, bottom=crown.top, top=2 * crown.top)


def test_styles_and_scripts_of_the_page_have_colours_of_the_palette_alone():
    assets = "".join(path.read_text() for path in files("sim.views.page").iterdir() if path.name.startswith("page"))
    assert set(re.findall(r"colours\.(\w+)|var\(--(?!wide|narrow)(\w+)", assets)) <= {
        pair for name in list_colours() for pair in ((name, ""), ("", name))
    }


def test_names_of_tracks_that_are_not_reported_have_a_question_mark():
    belief = Gaussian(np.zeros(4), np.eye(4))
    assert [mark_track(Track(8, belief, r), 3).name for r in (1.0, 0.51, 0.5, 0.01)] == ["3", "3", "3?", "3?"]
