"""Recordings and their files, changed by hand."""

import dataclasses
import io
import zipfile

import numpy as np

from helpers import synthetic
from sim.recording.recording import Recorder, Recording
from sim.scenario.scenario import resolved


def record(scans=11, seed=0, **options):
    setting = synthetic.scenario(**options)
    trees = synthetic.forest(setting)
    recorder = Recorder()
    for snapshot in synthetic.snapshots(setting, trees, scans, seed):
        recorder.add(snapshot)
    return recorder.recording(scenario=resolved(setting), planner="hover", seed=2**70, forest=trees)


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
