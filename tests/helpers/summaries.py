"""Summaries as they are shown."""

import numpy as np
from rich.console import Console

from helpers.recordings import bare
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import make_results_table, summarise

SECONDS = {"physics": 1.0, "rendering": 2.0, "detection": 0.5, "tracking": 0.25, "planning": 3.0, "video": 4.0}


def hand_made():
    """Two scans, two UAVs, three people; the third arrives at the second scan."""
    people = np.array([[[0.0, 0.0], [10.0, 0.0], [np.nan, np.nan]], [[1.0, 0.0], [10.0, 1.0], [5.0, 5.0]]])
    # Per scan and UAV: measurements 2, 1, 0, 2; tracks 1, 2, 0, 1.
    first = [{0: (0.5, 0.0, 0, 0)}, {0: (0.0, 0.0, 0, 0), 1: (10.0, 2.0, 0, 0)}]
    return bare(
        people,
        [first, [{}, {2: (5.0, 5.5, 0, 0)}]],
        seed=7,
        measurement_offsets=np.array([0, 2, 3, 3, 5]),
        measurements=np.zeros((5, 2)),
        measurement_covariances=np.tile(np.eye(2), (5, 1, 1)),
        pixels=np.ones((5, 2)),
        ospa=np.array([[[0.5, 0.5, 0], [1.0, 1.0, 0]], [[0.25, 0.25, 0], [4.25, 4.25, 0]]]),
        visible=np.array([[[5, 1, 0], [0, 9, 0]], [[0, 0, 0], [7, 3, 2]]]),
        matched=np.array([[[1, 1, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0]]], dtype=bool),
    )


def summary(recording, *, asked=(), **known):
    """A summary of what was flown, its metrics computed anew."""
    outcome = Outcome(recording, **{"seconds": SECONDS, "wall_s": 14.0, **known})
    return summarise(outcome, asked)


def shown(result):
    console = Console(width=100, record=True, file=open("/dev/null", "w"))
    console.print(make_results_table(result))
    return console.export_text()
