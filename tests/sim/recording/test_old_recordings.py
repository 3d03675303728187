"""Recordings that earlier versions of the program wrote still load, render and export.

Those in `data` were flown by `understory run --planner hover --duration 2` of the commits that recorded first, then
contacts, then bytes sent, and then, on two branches, plans sent and probabilities of existence.
"""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from helpers.summaries import summary

from sim.recording.archive import load
from sim.recording.recording import Recording
from sim.replay.export import export
from sim.replay.frames.pages import write_frames
from sim.replay.frames.rerender import find, scenario_of
from sim.replay.history import History

DATA = Path(__file__).parents[2] / "data"
# What each lacked, and what stands there.
LACKED = {
    "first": {
        "contacts",
        "bytes_sent",
        "plan_bytes",
        "plan_rounds",
        "sees_truth",
        "track_existence",
        "faults",
        "repeat",
    },
    "contacts": {"bytes_sent", "plan_bytes", "plan_rounds", "sees_truth", "track_existence", "faults", "repeat"},
    "bytes": {"plan_bytes", "plan_rounds", "sees_truth", "track_existence", "faults", "repeat"},
    "plans": {"track_existence", "faults", "repeat"},
    "existence": {"plan_bytes", "plan_rounds", "sees_truth", "faults", "repeat"},
}


@pytest.mark.parametrize("form", LACKED)
def test_an_older_form_loads_with_defaults_for_what_it_lacks(form):
    with np.load(DATA / f"mission-{form}.npz") as archive:
        assert {field.name for field in fields(Recording)} - set(archive) == LACKED[form]
    recording = load(DATA / f"mission-{form}.npz")
    assert recording.times.tolist() == [k / 5 for k in range(11)]
    assert (recording.planner, recording.seed, recording.repeat) == ("hover", 0, 0)
    assert (recording.sees_truth, recording.faults) == (False, "")
    lacks = LACKED[form]
    assert len(recording.contacts) == 0
    assert np.all(recording.bytes_sent == -1) == ("bytes_sent" in lacks) and recording.bytes_sent.shape == (11, 3)
    assert np.all(recording.plan_bytes == -1) == ("plan_bytes" in lacks) and recording.plan_bytes.shape == (11, 3)
    assert np.all(recording.track_existence == -1) == ("track_existence" in lacks)
    assert recording.track_existence.shape == recording.track_ids.shape
    network = summary(recording)["network"]
    assert (network["bytes_total"] is None) == ("bytes_sent" in lacks)
    assert len(History.of(recording, scenario_of(recording)).losses) == 0


@pytest.mark.parametrize("form", LACKED)
def test_an_older_form_renders_and_exports(form, tmp_path):
    recording = find(DATA / f"mission-{form}.npz")
    write_frames(recording, [5], 1, tmp_path / "frames", size=256, progress=lambda k: None)
    assert [p.name for p in (tmp_path / "frames").iterdir()] == ["uav1-scan0005-1.0s.png"]
    for target in ("csv", "stonesoup", "mot"):
        export(recording, target, tmp_path / target)
    rows = (tmp_path / "csv" / "tracks.csv").read_text().splitlines()
    assert len(rows) == 1 + len(recording.track_ids)
