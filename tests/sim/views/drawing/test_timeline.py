"""The timeline of a mission: stretches of time counted by hand, and a figure that shows each of them."""

import numpy as np
import pytest
from helpers.people_facts import make_facts, spell_facts
from helpers.recordings import broken, record
from matplotlib.collections import PolyCollection

from sim.facts.event import Event
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS, Episode, find_episodes
from sim.facts.people import BROKEN, PeopleFacts
from sim.facts.sightings import STATES
from sim.views.drawing.plots import rgb
from sim.views.drawing.timeline import choose_rows, draw_timeline
from sim.views.palette import FALSE, HIDDEN, HOLD_COLOURS, LOST, uav_colour


def test_stretches_states_and_holds_are_those_counted_by_hand():
    assert tuple(HOLD_COLOURS) == HOLDS
    assert find_episodes(np.array([3])) == [Episode(0, 0, 3)]
    assert find_episodes(np.array([1, 1, 0, 2, 2])) == [Episode(0, 1, 1), Episode(2, 2, 0), Episode(3, 4, 2)]
    working = np.ones((6, 2), bool)
    working[4:, 1] = False
    present = np.array([[True]] * 5 + [[False]])
    looked = np.array([[True, k % 2 == 0] for k in range(6)])
    made = spell_facts(
        ["-xxx--", "x-x---"],
        ["--xx--", "x-----"],
        ["---x--", "x-----"],
        [[-1, 5, -1, 6, -1, -1], [-1, 5, -1, -1, -1, -1]],
        working=working,
        present=present,
        looked=looked,
    )
    names = [[STATES[s] if s != BROKEN else "broken" for s in lane] for lane in made.camera_states[:, :, 0].T]
    assert names[0] == ["out of view", "hidden", "missed", "seen", "out of view", "absent"]
    assert names[1] == ["seen", "seen", "hidden", "hidden", "broken", "broken"]  # no frames at odd scans
    assert made.last_frames[:, 1].tolist() == [0, 0, 2, 2, 2, 2]
    held = [HOLDS[s] for s in made.hold_states[:, 0]]
    assert held == ["not found yet", "held", "lost", "held by some", "lost", "absent"]
    working = np.array([[True, True], [True, False], [False, False]])
    made = spell_facts(["---", "---"], ["---", "---"], ["---", "---"], [[1, 1, -1], [-1, -1, -1]], working=working)
    assert [HOLDS[s] for s in made.hold_states[:, 0]] == ["held by some", "held", "lost"]


def shades(figure):
    """Faces of the boxes in the figure, and their left, right and top edges."""
    (boxes,) = (c for c in figure.axes[0].collections if isinstance(c, PolyCollection))
    corners = [path.vertices for path in boxes.get_paths()]
    edges = [(c[:, 0].min(), c[:, 0].max(), c[:, 1].min()) for c in corners]
    return [(tuple(face[:3]), edge) for face, edge in zip(boxes.get_facecolors(), edges, strict=True)]


def event(kind, first, last, **concerned):
    return Event(kind, "", first, last, 0.2 * first, 0.2 * last, **concerned)


def test_the_figure_shows_each_stretch_at_its_time():
    made = spell_facts(["--xx", "xx--"], ["----", "xx--"], ["----", "xx--"], [[1, -1, -1, 1], [1, -1, -1, 1]])
    events = [event("false track", 0, 2, track=3)]
    found = shades(draw_timeline(made, np.ones((4, 2, 3)), events))
    spans = {colour: [edge[:2] for shade, edge in found if shade == pytest.approx(rgb(colour))]
             for colour in (LOST, HIDDEN, FALSE, uav_colour(0), uav_colour(1))}  # fmt: skip
    assert spans[LOST] == [pytest.approx((0.2, 0.6))] and spans[HIDDEN] == [pytest.approx((0.4, 0.6))]  # the end
    assert spans[FALSE] == [pytest.approx((0.0, 0.6))]
    assert spans[uav_colour(0)] == [] and spans[uav_colour(1)] == [pytest.approx((0.0, 0.4))]


def test_a_crowd_has_rows_of_those_lost_longest_and_one_of_all_others():
    """Of 60 people, person m is lost for m scans. UAV 1 of 9 has all in view, and UAV 8 even numbers."""
    scan, _, person = np.ogrid[:60, :9, :60]
    lost = (scan >= 1) & (scan <= person) & np.ones((60, 9, 60), bool)
    seen = np.zeros((60, 9, 60), bool)
    seen[:, 1], seen[:, 8, ::2] = True, True
    made = make_facts(seen, seen, seen, np.where(lost, -1, person))
    rows, folded = choose_rows(made)
    assert [row.person for row in rows] == list(range(59, 59 - len(rows), -1))
    assert folded == list(range(60 - len(rows))) and folded and len(rows) > 10
    assert all(row.uavs == ([1] if row.person % 2 else [1, 8]) for row in rows)
    events = [event("false track", 0, 59, track=k) for k in range(80)]
    figure = draw_timeline(made, np.ones((60, 9, 3)), events)
    assert figure.get_figheight() < 15
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels[:2] == ["person 59 (1)", "person 58 (1, 8)"] and len(labels) == len(rows) + 2
    assert labels[-2:] == [f"{len(folded)} others", "no person"]


@pytest.mark.parametrize(("uavs", "people", "scans"), [(3, 20, 21), (5, 2, 6), (8, 2, 6), (1, 0, 6), (2, 1, 1)])
def test_any_fleet_and_any_number_of_people_can_be_shown(uavs, people, scans):
    recording = record(scans, uavs=uavs, people=people)
    recording = broken(recording, 0, scans // 2 + 1)
    figure = draw_timeline(PeopleFacts(recording), recording.ospa, Flight(recording).events)
    labels = [text.get_text().partition(" (")[0] for text in figure.axes[0].get_yticklabels()]
    assert labels[:people] == [f"person {m}" for m in range(people)] and set(labels[people:]) <= {"no person"}
    assert (scans > 1) == any("UAV 0 broke down" in text.get_text() for text in figure.axes[1].texts)
    figure.draw_without_rendering()
