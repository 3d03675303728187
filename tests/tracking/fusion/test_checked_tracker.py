"""Messages from outside: what they hold is as the fleet's own have it, up to the largest number of tracks."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.graphs import message

from tracking.fusion.checked_tracker import checked_message
from tracking.plugins.containment import Unusable

ONE = message(0, [3], np.zeros(4), np.eye(4), degree=0)


def test_partition_and_deletions_become_tuples_of_whole_numbers_and_times():
    sent = checked_message(replace(ONE, partition=[np.float64(2.0), 7], deleted=np.array([[4, 1]])))
    assert (sent.partition, sent.deleted) == ((2, 7.0), ((4, 1.0),))
    numbers = sent.partition + sent.deleted[0]
    assert [type(number) for number in numbers] == [int, float] * 2 and type(sent.partition) is tuple


@pytest.mark.parametrize("leader", [0.5, -1, -np.inf, 2**62])
def test_leaders_and_deleted_ids_are_whole_numbers(leader):
    for wrong in ({"partition": (leader, 0.0)}, {"deleted": ((leader, 0.0),)}):
        with pytest.raises(Unusable, match="are of other numbers than whole ones of at least 0"):
            checked_message(replace(ONE, **wrong))


def test_a_message_about_ten_thousand_tracks_is_taken():
    count = 10_000
    many = message(0, range(count), np.zeros((count, 4)), np.tile(np.eye(4), (count, 1, 1)), degree=0)
    assert len(checked_message(many).ids) == count
