"""The curve over the loss of messages is of the missions that it says."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from sim.report import message_losses as losses
from sim.scenario.loading import load
from sim.study.backends import Borrowed
from sim.study.tasks import task_of
from sim.study.trial import fly


@contextmanager
def threads(workers):
    with ThreadPoolExecutor(workers) as executor:
        yield Borrowed(executor)


def test_table_and_figure_hold_the_missions_they_name(monkeypatch):
    monkeypatch.setattr(losses, "LOSSES", (0.0, 0.8))
    monkeypatch.setattr(losses, "Pool", threads)
    found = losses.curves(["kla"], [3, 1], 1, ["duration=1", "trees.density=0"])
    setting = [
        load("forest", ["sensing.mode=ideal", "duration=1", "trees.density=0", f"network.loss={loss}"])
        for loss in (0.0, 0.8)
    ]
    alone = [[fly(task_of(s, "sma-nbo-mwtp", seed)).row for seed in (3, 1)] for s in setting]
    shares = [[row.metrics["disagreement_m"] for row in rows] for rows in alone]
    assert [[row.metrics["disagreement_m"] for row in rows] for rows in found["kla"]] == shares
    assert [[row.seed for row in rows] for rows in found["kla"]] == [[3, 1], [3, 1]]
    mean, error = np.mean(shares[1]), np.abs(np.diff(shares[1]))[0] / 2  # of two values
    row = losses.table(found).splitlines()[-1]
    assert row.startswith("| 80% | `kla` | ") and row.endswith(f"| {mean:.4f} ± {error:.4f} m |")
    left, right = losses.figure(found).axes
    np.testing.assert_allclose(right.lines[0].get_ydata(), np.mean(shares, axis=1))
    np.testing.assert_array_equal(left.lines[0].get_xdata(), [0, 80])
