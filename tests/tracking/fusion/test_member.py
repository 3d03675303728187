"""Trackers and messages from outside: wrong tracks and messages are refused, and the error names what left them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.graphs import message
from helpers.scenes import CAMERA, MOTION

from tracking.errors import InputError
from tracking.fusion.member import check_message, make_tracker
from tracking.fusion.message import Partition
from tracking.geometry.camera import Pose
from tracking.parameters import TrackerParameters
from tracking.plugins.plugin_error import Unusable
from tracking.track import Scan

ONE = message(0, [3], np.zeros(4), np.eye(4), degree=0)


def test_partition_and_deletions_become_tuples_of_whole_numbers_and_times():
    sent = check_message(replace(ONE, partition=[np.float64(2.0), 7], deleted=np.array([[4, 1]])))
    assert (sent.partition, sent.deleted) == ((2, 7.0), ((4, 1.0),))
    numbers = sent.partition + sent.deleted[0]
    assert [type(number) for number in numbers] == [int, float] * 2 and type(sent.partition) is Partition


@pytest.mark.parametrize("leader", [0.5, -1, -np.inf])
def test_leaders_and_deleted_ids_are_whole_numbers(leader):
    for wrong in ({"partition": (leader, 0.0)}, {"deleted": ((leader, 0.0),)}):
        with pytest.raises(Unusable, match="are of other numbers than whole ones of at least 0"):
            check_message(replace(ONE, **wrong))


def test_a_message_about_ten_thousand_tracks_is_taken():
    count = 10_000
    many = message(0, range(count), np.zeros((count, 4)), np.tile(np.eye(4), (count, 1, 1)), degree=0)
    assert len(check_message(many).ids) == count


class Spoilt:
    """Leaves a wrong mean of its one track after a call."""

    mean = None

    def __init__(self, *given):
        self.tracks = ()

    def step(self, scan):
        belief = SimpleNamespace(mean=self.mean, covariance=np.eye(4))
        self.tracks = (SimpleNamespace(id=0, belief=belief, existence=1.0),)

    def coast(self, time):
        self.step(None)

    def message(self, degree):
        """Never called."""

    def accept(self, message):
        """Never called."""


@pytest.mark.parametrize(
    ("method", "mean", "complaint"),
    [
        ("step", [1.0, 2.0], r"of shape \(1, 2\), not \(1, 4\)"),
        ("coast", [0.0, 0.0, 0.0, np.nan], "are not finite"),
    ],
)
def test_wrong_tracks_are_an_error_of_the_method_that_left_them(monkeypatch, method, mean, complaint):
    given = {"step": Scan(0, 0.0, Pose.level(0.0, 0.0, 25.0), np.zeros((0, 2)), np.zeros((0, 2, 2))), "coast": 0.0}
    monkeypatch.setattr(Spoilt, "mean", mean)
    tracker = make_tracker(f"{__name__}:Spoilt", 0, CAMERA, TrackerParameters(MOTION))
    with pytest.raises(InputError) as error:
        getattr(tracker, method)(given[method])
    assert error.match(
        rf"^tracking\.tracker: '.*:Spoilt' cannot give its tracks after {method}: means of tracks {complaint} "
        rf"\(.*test_member\.py:\d+, in Spoilt\.{method}\)$"
    )
