"""Recordings of made-up missions, and their files, changed by hand."""

import dataclasses
import io
import json
import zipfile

import numpy as np

from helpers import synthetic
from sim.mission.recorder import Recorder
from sim.mission.recording import VERSION, Recording
from sim.scenario.scenario import encode_scenario


def record(
    scans=11, *, setting=None, trees=45, planner="hover", seed=2**70, change=lambda snapshot: snapshot, **options
):
    """The recording of a made-up mission.

    `setting` or `options` give its scenario, `trees` their number, `change` what is recorded of each snapshot.
    """
    setting = setting or synthetic.scenario(**options)
    forest, recorder = synthetic.forest(setting, trees), Recorder()
    for snapshot in synthetic.snapshots(setting, forest, scans):
        recorder.add(change(snapshot))
    return recorder.recording(scenario=encode_scenario(setting), planner=planner, seed=seed, forest=forest)


def broken(recording, uav, scan):
    """The recording, but that a UAV has broken down at a scan."""
    gone = (np.arange(len(recording.times)) >= scan)[:, None] & (np.arange(recording.poses.shape[1]) == uav)
    return dataclasses.replace(recording, ospa=np.where(gone[:, :, None], np.nan, recording.ospa))


def bare(people, tracks, **changes):
    """A recording of people (K, M, 2) and, per scan and UAV, of tracks {id: (x, y, vx, vy)}; all else is nothing."""
    scans, uavs, count = len(people), len(tracks[0]), people.shape[1]
    cells = [cell for row in tracks for cell in row]
    means = np.array([mean for cell in cells for mean in cell.values()], dtype=float).reshape(-1, 4)
    fleet = [{"start": [9.0 * i - 60.0, 40.0]} for i in range(uavs)]
    scenario = json.dumps({"uavs": fleet, "people": {"count": count}})
    texts = {"version": VERSION, "scenario": scenario, "planner": "hover", "seed": 0, "interrupted": False}
    texts |= {"sees_truth": False, "faults": "[]", "repeat": 0}
    flight = {name: np.zeros((scans, uavs, n)) for name, n in (("poses", 7), ("cameras", 7), ("commands", 2))}
    flight |= {"times": np.arange(scans) / 5, "trees": np.zeros((0, 6)), "people": people}
    flight |= {"headings": np.zeros((scans, count)), "plan_times": np.zeros(0), "plans": np.zeros((0, uavs, 0, 2))}
    measured = {"measurement_offsets": np.zeros(scans * uavs + 1, dtype=np.int64), "measurements": np.zeros((0, 2))}
    measured |= {"measurement_covariances": np.zeros((0, 2, 2)), "pixels": np.zeros((0, 2))}
    tracked = {
        "track_offsets": np.cumsum([0, *map(len, cells)]),
        "track_ids": np.array([id for cell in cells for id in cell], dtype=np.int64),
        "track_means": means,
        "track_covariances": np.tile(np.eye(4), (len(means), 1, 1)),
        "track_existence": np.full(len(means), np.nan),
        "track_sightings": np.full((len(means), 3), np.nan),
    }
    truth = {"ospa": np.ones((scans, uavs, 3)), "visible": np.zeros((scans, uavs, count), dtype=np.int64)}
    truth |= {"matched": np.zeros((scans, uavs, count), dtype=bool), "contacts": np.zeros((0, 4), dtype=np.int64)}
    sent = {name: np.zeros((scans, uavs), dtype=np.int64) for name in ("bytes_sent", "plan_bytes")}
    sent |= {"plan_rounds": np.zeros(scans, dtype=np.int64)}
    return Recording(**{**texts, **flight, **measured, **tracked, **truth, **sent, **changes})


def assert_same(one, other):
    for field in dataclasses.fields(Recording):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert type(a) is type(b), field.name
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype and a.shape == b.shape, field.name
            assert a.tobytes() == b.tobytes(), field.name
        else:
            assert a == b, field.name


def rewritten(source, target, **changes):
    """A copy of an archive with some members replaced (bytes) or left out (None)."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = changes.get(name.removesuffix(".npy"), old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def npy(array):
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()
