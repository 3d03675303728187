"""Columns of a fleet's messages: mixing of tracks that not all of them have, against single numbers."""

import numpy as np
import pytest
from helpers.graphs import message

from tracking.fusion.mixing import count_novel, make_columns, mix_tracks, stack_messages, widen


def random_messages(rng, counts):
    said = []
    for uav, count in enumerate(counts):
        means, covariances = rng.normal(size=(count, 4)), np.tile(np.eye(4), (count, 1, 1))
        novel = rng.normal(size=(count, 21 + uav)) * (rng.random((count, 1)) < 0.5)
        seen = rng.uniform(0.0, 5.0, count)
        said.append(message(uav, list(range(count)), means, covariances, degree=2, seen=seen, novel=novel))
    return said


@pytest.mark.parametrize("seed", range(5))
def test_a_track_that_a_message_lacks_counts_as_zeros_and_tells_nothing(seed):
    rng = np.random.default_rng(seed)
    said = random_messages(rng, (3, 2, 4))
    columns = stack_messages(said)
    after = make_columns(columns.counts.copy(), *columns.novel.shape[1:])
    rows = np.array([[0, 2, -1, 1, -1], [-1, 1, 0, -1, -1], [3, -1, 2, 1, 0]])
    mix_tracks(columns, after, np.array([0, 1, 2]), rows, np.array([2.0, 2.0, 2.0]))

    def read(n, t, name, empty):
        return getattr(said[n], name)[rows[n, t]] if rows[n, t] >= 0 else np.full_like(getattr(said[0], name)[0], empty)

    assert after.counts[0] == 5
    for t in range(5):
        own, *others = (read(n, t, "shares", 0.0) for n in range(3))
        expected = own.copy()
        for other in others:
            expected += (other - own) / 3.0
        np.testing.assert_array_equal(after.shares[0, t], expected)
        novel = np.zeros((3, columns.novel.shape[2]))
        for n in range(3):
            if rows[n, t] >= 0:
                novel[n, : said[n].novel.shape[1]] = said[n].novel[rows[n, t]]
        expected = novel[0].copy()
        for other in novel[1:]:
            expected += (other - novel[0]) / 3.0
        np.testing.assert_array_equal(after.novel[0, t], expected)
        np.testing.assert_array_equal(
            after.times[0, t], np.max([read(n, t, "times", -np.inf) for n in range(3)], axis=0)
        )
        latest = max((read(n, t, "sightings", -np.inf) for n in range(3)), key=lambda each: each[2])
        np.testing.assert_array_equal(after.sightings[0, t], latest)


def test_columns_made_wider_keep_their_tracks_and_count_the_same_numbers():
    said = random_messages(np.random.default_rng(1), (3, 0, 5))
    columns = stack_messages(said)
    wider = widen(columns, 9)
    assert wider.shares.shape == (3, 9, 22)
    for n, m in enumerate(said):
        np.testing.assert_array_equal(wider.shares[n, : len(m.ids)], m.shares)
        np.testing.assert_array_equal(wider.shares[n, -1], 0.0)
    assert count_novel(wider).tolist() == count_novel(columns).tolist()
    assert [8 * (count_novel(columns)[n] + m.numbers) for n, m in enumerate(said)] == [m.size for m in said]
