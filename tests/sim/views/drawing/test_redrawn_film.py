"""`understory replay`: the film is the one flown, a part shows the same pictures, wrong input leaves nothing."""

import dataclasses
import os
import shutil
import subprocess
import sys
from functools import partial
from itertools import count

import numpy as np
import pytest
from helpers import synthetic
from helpers.films import decoded
from helpers.processes import python

from sim.mission.archive import load_recording, save
from sim.mission.trial import Trial
from sim.running.results import run_mission as fly
from sim.scenario.loading import load_scenario
from sim.views import window
from sim.views.drawing import redrawn_film as module
from sim.views.drawing.film import Film, Video
from sim.views.drawing.redrawn_film import write_film
from tracking.errors import InputError

# A slow camera, a UAV that breaks down, trees that UAVs map, everything varied by the seed.
SETTINGS = ["duration=3", "trees.density=75", "uavs.1.rate=1", "uavs.2.fails_at=1.5", "appearance.randomise=true"]
SETTINGS += ["mapping.forest=mapped"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The folder of a run with its film; its planner exists no more."""
    folder = tmp_path_factory.mktemp("flown") / "run"
    fly(Trial(load_scenario("forest", SETTINGS), "greedy", 3), folder)
    recording = load_recording(folder / "mission.npz")
    (folder / "mission.npz").unlink()
    save(dataclasses.replace(recording, planner="gone:Planner"), folder / "mission.npz")
    return folder


@pytest.fixture
def replay(flown, tmp_path, call):
    """Calls `understory replay` in a folder that holds nothing but the recording, in `run`."""
    (tmp_path / "run").mkdir()
    shutil.copy(flown / "mission.npz", tmp_path / "run")
    return partial(call, "replay")


@pytest.fixture
def pictures(monkeypatch, tmp_path):
    """Pictures of a film, as drawn, by what `write_film` is asked for."""
    drawn, made = [], count()
    draw = Film.draw

    def keep(self, snapshot, frames):
        drawn.append(draw(self, snapshot, frames))
        return drawn[-1]

    monkeypatch.setattr(Film, "draw", keep)

    def of(recording, scans, **options):
        drawn.clear()
        write_film(recording, scans, tmp_path / f"film{next(made)}.mp4", progress=lambda k: None, **options)
        return list(drawn)

    return of


def test_the_film_is_the_one_flown_but_for_the_planners_name(replay, flown, tmp_path):
    assert replay("run")[0] == 0
    mine, theirs = decoded(tmp_path / "run" / "replay.mp4"), decoded(flown / "mission.mp4")
    assert mine[1] == theirs[1] == pytest.approx(np.arange(16) / 5)
    below = slice(64, None)  # the header, and the block of pixels that shares in it, names another planner
    for one, other in zip(mine[0], theirs[0], strict=True):
        assert np.mean(one[below] != other[below]) < 0.01
    save(dataclasses.replace(load_recording(flown / "mission.npz"), planner="greedy"), tmp_path / "named.npz")
    assert replay("named.npz")[0] == 0
    for one, other in zip(decoded(tmp_path / "replay.mp4")[0], theirs[0], strict=True):
        np.testing.assert_array_equal(one, other)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["mission.npz", "replay.mp4"]


@pytest.mark.parametrize(
    "layout", ["map+cameras", "uav1", *(pytest.param(n, marks=pytest.mark.slow) for n in ("cameras", "map"))]
)
def test_a_part_shows_the_same_pictures_as_the_whole(flown, pictures, layout):
    recording = load_recording(flown / "mission.npz")
    whole = pictures(recording, range(16), layout=layout)
    for scans in ([3], [8, 9], [11, 12, 13, 14, 15]):
        for k, picture in zip(scans, pictures(recording, scans, layout=layout), strict=True):
            np.testing.assert_array_equal(picture, whole[k])


def test_speed_changes_the_frame_rate_and_nothing_else(replay, tmp_path):
    for name, speed in (("plain", "1"), ("slow", "0.25x"), ("fast", "20")):
        assert replay("run", "--time", "0.4:1.6", "--speed", speed, "--out", f"{name}.mp4", "--layout", "map")[0] == 0
    plain, slow, fast = (decoded(tmp_path / f"{name}.mp4") for name in ("plain", "slow", "fast"))
    assert (len(plain[0]), len(slow[0]), len(fast[0])) == (7, 7, 7)
    np.testing.assert_allclose(plain[1], np.arange(7) / 5, atol=1e-4)
    np.testing.assert_allclose(slow[1], np.arange(7) / 1.25, atol=1e-4)
    np.testing.assert_allclose(fast[1], np.arange(7) / 100, atol=1e-4)


def test_people_from_a_file_that_is_gone_walk_again(pictures, tmp_path, without_pictures):
    path = tmp_path / "people.csv"
    path.write_text("t,id,x,y\n" + "".join(f"{t / 5},0,{t / 5},2\n" for t in range(11)))
    setting = load_scenario("forest", ["duration=1", f"people.trajectories={path}", "sensing.mode=ideal"])
    fly(Trial(setting, "hover", 0), tmp_path / "run", video=False)
    path.unlink()
    assert len(pictures(load_recording(tmp_path / "run" / "mission.npz"), range(6))) == 6


def test_ctrl_c_and_a_full_disk_leave_nothing(replay, tmp_path, monkeypatch):
    add = Video.add
    full = OSError(28, "No space left on device", "replay.mp4")
    said = {
        "interrupted; nothing new is kept": KeyboardInterrupt,
        "replay.mp4: No space left on device; nothing is kept": full,
    }
    for line, error in said.items():
        count = []

        def fail(self, *arguments, error=error, count=count):
            count.append(1)
            if len(count) > 3:
                raise error
            return add(self, *arguments)

        with monkeypatch.context() as patched:
            patched.setattr(module.Video, "add", fail)
            code, _, err = replay("run")
            assert (code, err) == (1, f"understory: {line}\n")
        assert [path.name for path in (tmp_path / "run").iterdir()] == ["mission.npz"]


def test_views_that_cannot_be_shown_are_refused_in_one_line(replay, monkeypatch, tmp_path):
    for name in [name for name in sys.modules if name.startswith("sim.views.rerun_viewer")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rerun", None)
    code, _, err = replay("run", "--rerun", "a.rrd")
    assert (code, err) == (2, "understory: --rerun: needs rerun-sdk: pip install 'rerun-sdk>=0.39,<0.42'\n")
    assert not (tmp_path / "a.rrd").exists()
    setting = synthetic.scenario(mode="ideal")
    with pytest.raises(InputError, match="'uav1' is not allowed, ideal sensing takes no images; expected map"):
        module.check_layout("uav1", setting)


@pytest.mark.parametrize("display", [None, ":987"])
def test_without_a_display_the_window_is_one_line_and_exit_code_2(replay, monkeypatch, display):
    monkeypatch.delenv("DISPLAY", raising=False)
    reason = "DISPLAY is not set"
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
        reason = "cannot connect to X server"
    code, _, err = replay("run", "--gui")
    assert code == 2
    assert err == f"understory: --gui: no window can be opened here ({reason}); --video makes a film instead\n"


@pytest.fixture
def display(monkeypatch):
    """A display that is not shown."""
    if shutil.which("Xvfb") is None:
        pytest.skip("there is no Xvfb")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x400x24"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        monkeypatch.setenv("DISPLAY", ":" + os.read(read, 16).decode().strip())
        try:
            if window.explain_refusal():
                pytest.skip(f"Xvfb has no OpenGL: {window.explain_refusal()}")
            yield
        finally:
            server.terminate()
            os.close(read)
            os.close(write)


@pytest.mark.slow
def test_the_window_opens_and_ends_with_the_last_scan(flown, display):
    done = python("-m", "sim", "replay", flown, "--gui", "--time", "1:2", "--speed", "2")
    assert (done.returncode, done.stderr.strip()) == (0, "") and "Q or Esc closes it" in done.stdout
