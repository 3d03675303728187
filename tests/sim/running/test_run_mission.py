"""A run leaves a whole folder or nothing."""

import itertools
import json
import signal
import time

import numpy as np
import pytest
from helpers.films import frames_of
from helpers.processes import python

from sim.mission.archive import load_recording
from sim.mission.atomic_files import PlaceTaken, make_new_folder
from sim.mission.trial import ScanProgress, Trial
from sim.running import results as module
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from tracking.errors import InputError

pytestmark = pytest.mark.usefixtures("heard")
FILES = ["mission.html", "mission.mp4", "mission.npz", "ospa.png", "summary.json", "timeline.png"]
STARTING, FLYING = "*.part", "*.part/.mission.mp4.*"


def trial(*overrides, duration=1, planner="hover"):
    return Trial(load_scenario("forest", [f"duration={duration}", "sensing.mode=ideal", *overrides]), planner, 5)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def interrupting(*scans):
    """A progress function that presses Ctrl-C at the given scans."""
    counter = itertools.count(1)

    def progress(moment):
        k = next(counter) if isinstance(moment, ScanProgress) else 0  # otherwise a function is compiled
        for _ in range(scans.count(k)):
            signal.raise_signal(signal.SIGINT)

    return progress


def test_a_run_leaves_files_that_agree(tmp_path):
    setting = load_scenario("forest", ["duration=2"])
    summary = run_mission(Trial(setting, "greedy", 3), tmp_path / "deep" / "out")
    assert names(tmp_path) == ["deep"] and names(tmp_path / "deep") == ["out"]
    out = tmp_path / "deep" / "out"
    assert names(out) == FILES and json.loads((out / "summary.json").read_text()) == summary
    recording = load_recording(out / "mission.npz")
    assert (recording.planner, recording.seed, recording.interrupted) == ("greedy", 3, False)
    assert json.loads(recording.scenario) == summary["scenario"]
    np.testing.assert_allclose(recording.times, np.arange(11) / 5)
    assert summary["ospa"]["mean_m"] == recording.ospa[:, :, 0].mean()
    assert frames_of(out / "mission.mp4") == ("h264", 11)
    seconds = summary["seconds"]
    flown = summary["wall_s"] - seconds["start_up"] - seconds["video"] - seconds["page"]
    assert summary["real_time_factor"] == pytest.approx(2.0 / flown) and seconds["page"] > 0.0
    assert set(summary["versions"]) >= {"python", "understory", "pybullet", "numpy"}


def test_ctrl_c_in_flight_keeps_what_was_flown_before_or_twice_nothing(tmp_path, monkeypatch, without_pictures):
    summary = run_mission(trial(), tmp_path / "out", progress=interrupting(4))
    assert summary["interrupted"] and summary["duration_s"] == pytest.approx(0.6)
    assert names(tmp_path / "out") == FILES
    recording = load_recording(tmp_path / "out" / "mission.npz")
    assert recording.interrupted and len(recording.times) == 4
    assert frames_of(tmp_path / "out" / "mission.mp4") == ("h264", 4)
    with pytest.raises(KeyboardInterrupt):
        run_mission(trial(), tmp_path / "new" / "out", progress=interrupting(4, 4))
    assert names(tmp_path) == ["out"]
    monkeypatch.setattr(module, "warm_up", lambda renders: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        run_mission(trial(), tmp_path / "other")
    assert names(tmp_path) == ["out"]


def test_ctrl_c_after_landing_changes_nothing_and_is_handled_as_before_a_run(tmp_path, monkeypatch, without_pictures):
    write = module.write_results

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return write(*arguments)

    monkeypatch.setattr(module, "write_results", interrupted)
    before = signal.getsignal(signal.SIGINT)
    assert not run_mission(trial(duration=0.2), tmp_path / "out")["interrupted"] and names(tmp_path / "out") == FILES
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(
    ("sign", "number"),
    [
        pytest.param(STARTING, signal.SIGINT, id="Ctrl-C at the start", marks=pytest.mark.slow),
        pytest.param(FLYING, signal.SIGTERM, id="SIGTERM in flight"),
        pytest.param(STARTING, signal.SIGTERM, id="SIGTERM at the start", marks=pytest.mark.slow),
        pytest.param(FLYING, signal.SIGINT, id="Ctrl-C in flight", marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_and_sigterm_in_a_real_process_leave_nothing_at_the_start_and_a_whole_run_in_flight(
    tmp_path, sign, number
):
    words = (
        "-m sim run --planner sma-nbo --set sensing.mode=ideal --duration 10min --out".split()
    )  # about as fast as the clock
    process = python(*words, tmp_path / "out", started=True)
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob(f".out.{sign}")) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(number)
    _, err = process.communicate(timeout=300)
    if sign == STARTING:
        assert (process.returncode, err) == (1, "understory: interrupted; nothing new is kept\n")
        assert names(tmp_path) == []
        return
    assert process.returncode == 0, err
    assert names(tmp_path) == ["out"] and names(tmp_path / "out") == FILES
    recording = load_recording(tmp_path / "out" / "mission.npz")
    assert recording.interrupted and 1 <= len(recording.times) < 3001
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["interrupted"]
    assert frames_of(tmp_path / "out" / "mission.mp4") == ("h264", len(recording.times))


def test_of_two_folders_of_one_name_at_a_time_both_are_kept(tmp_path):
    out = tmp_path / "out"
    with (
        pytest.raises(PlaceTaken, match="made by another program meanwhile; the results are in out-2"),
        make_new_folder(out) as part,
    ):
        (part / "mine").touch()
        with make_new_folder(out) as other:
            (other / "theirs").touch()
    assert names(tmp_path) == ["out", "out-2"]
    assert names(out) == ["theirs"] and names(tmp_path / "out-2") == ["mine"]


def test_links_to_folders_are_followed_and_roots_of_file_systems_refused(tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    for link, place in (("link", "empty"), ("dangling", "new")):
        (tmp_path / link).symlink_to(tmp_path / place)
        with make_new_folder(tmp_path / link) as part:
            (part / "file").touch()
        assert names(tmp_path / place) == ["file"] and (tmp_path / link).is_symlink()
    (tmp_path / "disk").mkdir()
    monkeypatch.setattr("pathlib.Path.is_mount", lambda path: True)
    with pytest.raises(InputError, match="disk is where a file system is mounted"), make_new_folder(tmp_path / "disk"):
        pass


def test_folders_that_were_there_survive_a_failure_and_runs_are_refused(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(RuntimeError), make_new_folder(out):
        raise RuntimeError
    assert names(tmp_path) == ["out"] and names(out) == []
    with make_new_folder(out) as part:
        (part / "summary.json").touch()
    assert names(tmp_path) == ["out"] and names(out) == ["summary.json"]
    with pytest.raises(InputError, match="already holds a run"), make_new_folder(out):
        pass
    assert names(out) == ["summary.json"]
    with pytest.raises(RuntimeError), make_new_folder(tmp_path / "runs" / "mine"):
        (tmp_path / "runs" / "theirs").mkdir()
        raise RuntimeError
    assert names(tmp_path / "runs") == ["theirs"]
