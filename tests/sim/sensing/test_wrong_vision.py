"""User errors about cameras, people and recordings: one clear line, exit code 2, nothing left."""

import shutil
import sys

import msgspec
import pytest
from helpers import synthetic

from sim import __main__ as cli
from sim.recording.archive import save
from sim.recording.recording import Recorder
from sim.scenario.loading import load, remarks
from sim.scenario.perception import Sensing
from sim.scenario.scenario import resolved
from sim.world import opengl

CSV = {
    "nothing.csv": "",
    "blank.csv": "\n \n",
    "header.csv": "t,id,x,y\n",
    "one.csv": "t,id,x,y\n0,ann,0,0\n1,ann,1,0\n",
}
RECORDED = ["--uav", "0", "--time"]
SET = "--set"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Files that hold a mission of 2 s, rendered by each renderer."""
    setting, folder = synthetic.scenario(), tmp_path_factory.mktemp("recordings")
    recorder, forest = Recorder(), synthetic.forest(setting)
    for snapshot in synthetic.snapshots(setting, forest, 11):
        recorder.add(snapshot)
    for name in ("tiny", "egl"):
        drawn = msgspec.structs.replace(setting, sensing=Sensing(renderer=name))
        save(recorder.recording(scenario=resolved(drawn), planner="p", seed=0, forest=forest), folder / f"{name}.npz")
    return folder


@pytest.fixture
def call(tmp_path, monkeypatch, capfd, recordings):
    """Calls the command line in a folder with recordings and trajectories: exit code and standard error."""
    for name, text in CSV.items():
        (tmp_path / name).write_text(text)
    for path in recordings.iterdir():
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["understory", *arguments])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        return code, capfd.readouterr().err

    return run


WRONG = {
    "unknown detector": (["run", SET, "sensing.detector=blop"], ["sensing.detector: 'blop'", "did you mean blob?"]),
    "detector that is no module": (["run", SET, "sensing.detector=no.where:Net"], ["'no.where:Net'", "'no'"]),
    "unknown mount": (["run", SET, "uavs.0.mount=gimball"], ["uavs.0.mount: 'gimball'", "did you mean gimbal?"]),
    "mount too oblique": (["run", SET, "uavs.0.tilt_deg=61"], ["uavs.0.tilt_deg: 61", "<= 60"]),
    "mount at the horizon": (["run", SET, "uavs.0.tilt_deg=60"], ["uavs.0", "tilt_deg 60", "less than 60"]),
    "no pixels": (["run", SET, "uavs.0.pixels=0"], ["uavs.0.pixels: 0 is not allowed", ">= 16"]),
    "half pixels": (["run", SET, "uavs.0.pixels=99.5"], ["uavs.0.pixels: 99.5 is not allowed", "int"]),
    "too many pixels": (["run", SET, "uavs.0.pixels=9999"], ["uavs.0.pixels: 9999", "<= 4096"]),
    "no field of view": (["run", SET, "uavs.0.fov_deg=0"], ["uavs.0.fov_deg: 0", ">= 1"]),
    "false alarms beyond count": (["run", SET, "sensing.false_alarms=1e19"], ["sensing.false_alarms: 1", "<= 1000"]),
    "negative false alarms": (["run", SET, "sensing.false_alarms=-1"], ["sensing.false_alarms: -1", ">= 0"]),
    "unknown renderer": (["run", SET, "sensing.renderer=elg"], ["sensing.renderer: 'elg'", "did you mean egl?"]),
    "time beyond the recording": (["frames", "tiny.npz", *RECORDED, "2.3"], ["--time: 2.3 s", "0 to 2 s"]),
    "time before the recording": (["frames", "tiny.npz", *RECORDED, "-1"], ["--time: '-1'", "0 s or more"]),
    "seed as a key": (["run", SET, "seed=3"], ["seed: unknown key", "an option: --seed"]),
    "planner as a key": (["compare", SET, "planner=hover"], ["planner: unknown key", "an option: --planner"]),
    "near a key": (["run", SET, "sead=3"], ["sead: unknown key", "allowed are version, duration"]),
    "planner by no name": (["run", "--planner", "mine"], ["'mine'", "package.module:Class"]),
    "no trajectories": (["run", SET, "people.trajectories=nothing.csv"], ["nothing.csv: is empty", "t,id,x,y"]),
    "blank trajectories": (["run", SET, "people.trajectories=blank.csv"], ["blank.csv: is empty", "t,id,x,y"]),
    "no rows": (["run", SET, "people.trajectories=header.csv"], ["header.csv: has no rows", "two or more"]),
}


def refused(call, folder, arguments, words):
    before = sorted(folder.rglob("*"))
    code, err = call(*arguments)
    assert code == 2
    assert err.startswith("understory: ") and err.count("\n") == 1
    for word in words:
        assert word in err
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(("arguments", "words"), WRONG.values(), ids=WRONG)
def test_wrong_input_is_one_line_exit_code_2_and_leaves_nothing(call, tmp_path, arguments, words):
    refused(call, tmp_path, arguments, words)


@pytest.mark.parametrize("lacking", ["device", "library"])
@pytest.mark.parametrize(
    "arguments",
    [["run", SET, "sensing.renderer=egl"], ["frames", "egl.npz", *RECORDED, "1"]],
    ids=["run", "frames"],
)
def test_without_opengl_what_needs_it_is_refused(call, tmp_path, monkeypatch, arguments, lacking):
    """The plug-in is told to use a device that does not exist, or finds a library that is none."""
    if lacking == "device":
        monkeypatch.setenv("EGL_VISIBLE_DEVICES", "99")
    else:
        for name in ("libEGL.so", "libEGL.so.1"):
            (tmp_path / name).touch()
        monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    opengl.refusal.cache_clear()
    try:
        refused(call, tmp_path, arguments, ["sensing.renderer: 'egl' cannot start here (", "); allowed is tiny"])
    finally:
        opengl.refusal.cache_clear()


def test_what_is_not_flown_as_the_scenario_says_is_said(call):
    quick = ["--planner", "hover", "--no-video", SET, "sensing.mode=ideal", SET, "trees.density=0"]
    code, err = call("run", *quick, "--duration", "0.5", SET, "people.trajectories=one.csv", SET, "people.count=7")
    assert code == 0
    assert err.splitlines() == [
        "understory: duration: 0.5 s is no multiple of the 0.2 s between scans; the last scan is at 0.4 s",
        "understory: people.count: not used, as people.trajectories gives all paths",
    ]


def test_false_alarms_for_which_the_tracker_is_not_set_are_remarked_on():
    assert remarks(load("forest", ["sensing.false_alarms=1"])) == [
        "tracking.clutter_density: 1e-06 per m2 is far below the 0.0025 that sensing.false_alarms means; "
        "tracks will follow false alarms",
        'tracking.life: 2 of 3 false alarms make a track; "existence" weighs them against clutter',
    ]
    ready = ["sensing.false_alarms=1", "tracking.clutter_density=0.002", "tracking.life=existence"]
    assert remarks(load("forest", ready)) == []


@pytest.mark.parametrize("duration", ["0.2", "1", "40", "40.6", "3600", "0.6", "100.2"])
def test_whole_scans_and_walkers_need_no_remark(duration):
    assert remarks(load("forest", [f"duration={duration}", "people.count=7"])) == []
