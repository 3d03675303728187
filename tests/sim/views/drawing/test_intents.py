"""The intents that film, page and Rerun show are those that are flown."""

import numpy as np
import pytest
from helpers.flights import IDEAL, recorded

from planning.planner import Plan
from sim.facts.flight import Flight
from sim.facts.metrics.holding import HOLDS
from sim.views.drawing.intents import Intents
from sim.views.drawing.map_view import MapView
from sim.views.drawing.palette import uav_colour
from sim.views.page.data import make_page_data

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


def test_intents_are_what_is_flown_from_when_a_plan_is_due(delayed):
    recording = delayed[1]
    intents = Intents(recording.setting)
    for k in range(len(recording.times) - 5):
        snapshot = recording.snapshot(k)
        intents.follow(snapshot)
        paths = intents.paths(snapshot)
        for uav in range(3):
            ends = expected(delayed, k, uav)
            assert (uav in paths) == (ends is not None)
            if ends is not None:
                np.testing.assert_allclose(paths[uav], [recording.poses[k, uav, :2], *ends], atol=1e-9)


def test_the_map_rings_the_end_of_what_is_flown(delayed):
    recording = delayed[1]
    size = (1080, 756)
    for k in (2, 7, 18):
        view = MapView(recording.setting, recording.forest, size)
        image, _ = view.draw_recorded(recording, k, np.full(recording.people.shape[1], HOLDS.index("held")))
        for uav in range(3):
            ends = expected(delayed, k, uav)
            if ends is not None:
                x, y = view.pixels(ends[-1])
                near = image[round(y) - 6 : round(y) + 6, round(x) - 6 : round(x) + 6].reshape(-1, 3)
                assert np.count_nonzero(np.abs(near.astype(int) - uav_colour(uav)).max(axis=1) < 60) > 15


def test_the_page_has_the_times_when_plans_are_due(delayed):
    delay, recording = delayed
    times = make_page_data(Flight(recording), None)["plans"]["times"]
    np.testing.assert_allclose(times, np.arange(7) + delay)


class Logged(dict):
    """Last content of each entity, in place of a stream."""

    def log(self, path, *shown, **_):
        self[path] = shown[0]


def test_rerun_shows_what_is_flown(delayed):
    scene = pytest.importorskip("sim.views.rerun.scene")
    recording = delayed[1]
    stream = Logged()
    logged = scene.Scene(stream, Flight(recording))
    for k in range(len(recording.times) - 5):
        logged.log(k)
        for uav in range(3):
            ends, line = expected(delayed, k, uav), stream.pop(f"world/intents/{uav}", None)
            assert (line is None) == (ends is None)
            if ends is not None:
                (strip,) = line.strips.as_arrow_array().to_pylist()
                np.testing.assert_allclose(np.array(strip)[1:, :2], ends, atol=1e-4)
