"""States of people to tracks while a mission flies are those of the whole recording."""

from dataclasses import replace

import numpy as np
from helpers import synthetic

from sim.evaluation.holding import HOLDS, Holding
from sim.recording.recording import Recorder
from sim.replay.history import History
from sim.scenario.scenario import resolved


def test_states_scan_by_scan_are_those_of_the_whole_history():
    setting = synthetic.scenario()
    forest, recorder = synthetic.forest(setting), Recorder()
    for snapshot in synthetic.snapshots(setting, forest):
        recorder.add(snapshot)
    recording = recorder.recording(scenario=resolved(setting), planner="hover", seed=0, forest=forest)
    means, rng = recording.track_means.copy(), np.random.default_rng(0)
    means[:, :2] += rng.normal(0.0, 0.5, (len(means), 2))
    far = rng.random(len(means)) < 0.3
    means[far, :2] += 3.0
    means[(recording.track_ids == 1) & (np.arange(len(means)) < 60), :2] += 50.0
    recording = replace(recording, track_means=means)
    expected, holding = History.of(recording, setting).hold_states, Holding(4, 3)
    found = [holding.step(recording.snapshot(k)) for k in range(len(recording.times))]
    np.testing.assert_array_equal(found, expected)
    assert set(np.unique(expected)) == set(range(len(HOLDS)))
