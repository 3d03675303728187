"""The existence probability of a track is recorded, exported and read again, where there is one."""

import csv
import math

import numpy as np
from helpers.recordings import rewritten

from sim.mission.mission import Mission, Trial
from sim.recording.archive import load, save
from sim.recording.recording import Recorder
from sim.replay.export import export
from sim.scenario.loading import load as load_scenario
from sim.scenario.scenario import resolved

SETTINGS = ["duration=2", "sensing.mode=ideal", "trees.density=0"]


def recorded(life: str):
    setting = load_scenario("forest", [*SETTINGS, f"tracking.life={life}"])
    mission, recorder, given = Mission.of(Trial(setting, "hover", 1)), Recorder(), []
    for snapshot in mission.fly():
        recorder.add(snapshot)
        given += [track.existence for held in snapshot.tracks for track in held]
    return recorder.recording(scenario=resolved(setting), planner="hover", seed=1, forest=mission.forest), given


def exported(recording, folder) -> list[float]:
    export(recording, "csv", folder)
    with (folder / "tracks.csv").open(newline="") as file:
        return [float(row["existence"]) for row in csv.DictReader(file)]


def test_existence_comes_back_to_the_last_bit(tmp_path):
    recording, given = recorded("existence")
    assert given and all(0.0 < r < 1.0 for r in given) and len(set(given)) > 5
    save(recording, tmp_path / "mission.npz")
    again = load(tmp_path / "mission.npz")
    cells = [(k, i) for k in range(11) for i in range(3)]
    assert [track.existence for k, i in cells for track in again.tracks_at(k, i)] == given
    assert exported(again, tmp_path / "csv") == given


def test_counting_scans_and_old_recordings_have_none(tmp_path):
    counted, given = recorded("m_of_n")
    assert set(given) == {1.0} and np.all(np.isnan(counted.track_existence))
    save(recorded("existence")[0], tmp_path / "new.npz")
    old = load(rewritten(tmp_path / "new.npz", tmp_path / "old.npz", track_existence=None))
    assert np.all(old.track_existence == -1.0)
    for number, recording in enumerate((counted, old)):
        assert {track.existence for track in recording.tracks_at(10, 0)} == {1.0}
        assert all(math.isnan(r) for r in exported(recording, tmp_path / str(number)))
