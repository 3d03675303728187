"""Planned visibility of people and tracks, against flight on as planned."""

import numpy as np
import pytest
from helpers.flights import recorded

from planning.planner import Plan
from sim.facts.explain.planned_visibility import HIDDEN, IN_VIEW, OUT_OF_VIEW, find_planned_visibility
from sim.facts.people import PeopleFacts
from sim.mission.tracker_setup import make_tracker_parameters
from tracking.filter.kalman import Gaussian


class Straight:
    """Flies each UAV straight on for ever."""

    controls = np.array([[3.0, 1.0], [2.0, -1.5], [-1.0, 4.0]])

    def plan(self, team, rng):
        return [Plan(np.tile(self.controls[s.own.id], (5, 1))) for s in team]


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_what_a_plan_has_in_store_is_what_comes_when_it_is_flown(delay):
    options = ("sensing.mode=ideal", "dynamics=kinematic", "trees.density=75", f"network.plan_delay={delay}")
    recording = recorded(*options, planner=Straight(), duration=6)
    views = PeopleFacts(recording).views
    scans, uavs, people = views.inside.shape
    kinds = set()
    for k, i, m in ((k, i, m) for k in range(0, scans, 3) for i in range(uavs) for m in range(people)):
        planned = find_planned_visibility(recording, k, i, m, None)
        if recording.times[k] < delay:
            assert planned is None
            continue
        made = 0.0 if k < 5 else (k - round(5 * delay)) // 5
        assert planned.made == made and planned.times[-1] == pytest.approx(made + delay + 5.0)
        left = min(len(planned.times), scans - 1 - k)
        after = slice(k + 1, k + 1 + left)
        came = np.where(views.hidden_by[after, i, m] >= 0, HIDDEN, IN_VIEW)
        np.testing.assert_array_equal(planned.person[:left], np.where(views.inside[after, i, m], came, OUT_OF_VIEW))
        np.testing.assert_array_equal(planned.person[left:], -1)
        np.testing.assert_allclose(planned.path[:left], recording.poses[after, i, :2], atol=1e-9)
        kinds |= set(planned.person.tolist())
    assert kinds == {-1, OUT_OF_VIEW, HIDDEN, IN_VIEW}


def test_a_track_is_in_store_where_its_velocity_takes_it():
    options = ("sensing.mode=ideal", "dynamics=kinematic", "trees.density=0", "tracking.motion=ncv")
    recording = recorded(*options, planner=Straight(), duration=1)
    below = np.concatenate([recording.poses[2, 0, :2], Straight.controls[0]])
    planned = find_planned_visibility(recording, 2, 0, 0, Gaussian(below, np.eye(4)))
    assert planned.track.tolist() == [IN_VIEW] * 23  # of 5 s from 0 on, 0.4 s have gone
    other = find_planned_visibility(recording, 2, 0, 0, Gaussian(below * [1, 1, -1, -1], np.eye(4)))
    # They part by 1.2 m east and west a scan; at the height of a person half the view is 9.5 m.
    assert other.track.tolist() == [IN_VIEW] * 7 + [OUT_OF_VIEW] * 16


def test_a_track_out_of_sight_is_where_planners_expect_its_person():
    """A running person who parts from the UAV is expected to slow down, and is longer in view than at 3.2 m/s."""
    options = ("sensing.mode=ideal", "dynamics=kinematic", "trees.density=0")
    recording = recorded(*options, planner=Straight(), duration=1)
    belief = Gaussian(np.concatenate([recording.poses[2, 0, :2], -Straight.controls[0]]), 0.01 * np.eye(4))
    planned, inside = find_planned_visibility(recording, 2, 0, 0, belief), []
    for place in planned.path:
        belief = make_tracker_parameters(recording.setting).motion.predict(belief)
        inside.append(np.abs(belief.mean[:2] - place).max() < 9.5)
    assert planned.track.tolist() == np.where(inside, IN_VIEW, OUT_OF_VIEW).tolist() and 7 < sum(inside) < 23
