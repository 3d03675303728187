"""Whatever a plug-in does, a run ends, says in a line what was wrong, and leaves a whole folder or nothing."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.hostile import DETECTED, DETECTOR, FLOWN, HEAD, PLANNER, REFUSED, UNDETECTED, made, planner
from helpers.processes import ROOT, python, started_with

from planning.planner import Plan
from sim.mission.plan_check import checked_plans
from sim.sensing.rendered_mode import RenderedMode
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose

CAMERA = Camera(1.0, 64)
FILES = ["mission.npz", "ospa.png", "summary.json", "timeline.png"]
MOST = 2 << 30  # bytes
LIMIT = 20  # s of the processor for each process; of wall time, which others share, more
ENDED = {
    **{claim: (PLANNER, code, 0, words) for claim, (code, words) in FLOWN.items()},
    **{claim: (DETECTOR, code, 0, words) for claim, (code, words) in DETECTED.items()},
    **{claim: (PLANNER, *ending) for claim, ending in REFUSED.items()},
    **{claim: (DETECTOR, *ending) for claim, ending in UNDETECTED.items()},
}


def flown(folder, code, options, *more):
    """A run as a user would start it, within 2 GB of memory and 20 s of the processor."""

    def limited():
        resource.setrlimit(resource.RLIMIT_AS, (MOST, MOST))
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))

    (folder / "hostile.py").write_text(HEAD + code)
    return subprocess.run(
        [sys.executable, "-m", "sim", "run", *options.split(), "--no-video", "--out", "out", *more],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200", "HOSTILE": str(folder), "OMP_NUM_THREADS": "1"},
        preexec_fn=limited,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=10 * LIMIT,
    )


@pytest.mark.slow
@pytest.mark.parametrize("claim", ENDED)
def test_whatever_a_plug_in_does_a_run_ends_and_says_so(claim, tmp_path):
    options, code, exit_code, words = ENDED[claim]
    done = flown(tmp_path, code, options, *(["--timeout", "10"] if "timeout" in words else []))
    assert done.returncode == exit_code, done.stderr
    assert "Traceback" not in done.stdout + done.stderr and started_with("HOSTILE", tmp_path) == []
    names = sorted(path.name for path in tmp_path.iterdir() if path.name != "__pycache__")
    if exit_code:
        assert done.stderr.startswith("understory: ") and done.stderr.count("\n") == 1
        assert words in done.stderr and done.stdout.strip() == "" and names == ["hostile.py"]
        return
    assert names == ["hostile.py", "out"] and sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    faults = json.loads((tmp_path / "out" / "summary.json").read_text())["faults"]
    assert bool(faults) == bool(words) and all(words in fault["message"] for fault in faults)
    assert done.stderr == "" and ("fault" in done.stdout.partition("┏")[0]) == bool(words)


@pytest.mark.slow
def test_without_a_timeout_a_second_ctrl_c_ends_what_hangs(tmp_path):
    hanging = "if team[0].time < 0.5: return still(team)", "print('hanging', flush=True)", "while True: time.sleep(1)"
    (tmp_path / "hostile.py").write_text(HEAD + planner(*hanging))
    words = ["run", *PLANNER.split(), "--no-video", "--out", "out"]
    with python("-m", "sim", *words, cwd=tmp_path, started=True) as process:
        assert any("hanging" in line for line in process.stdout)
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            time.sleep(0.5)
        assert process.communicate(timeout=60)[1] == "understory: interrupted; nothing new is kept\n"
    assert process.returncode == 1
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != "__pycache__") == ["hostile.py"]


PROCESS = (  # what these do outlasts a test
    "a planner asks for a keyboard",
    "threads without end",
    "processes without end",
    "a planner forks",
    "the folder is left",
    "standard output is closed",
)
HARMLESS = [claim for claim in FLOWN if claim not in PROCESS]


@pytest.mark.parametrize("claim", HARMLESS)
def test_of_a_planner_that_does_wrong_the_team_flies_its_last_intents(claim, random_team):
    code, words = FLOWN[claim]
    team, last = random_team(0), {i: Plan(np.array([[1.0, 0.0], [0.0, 2.0]])) for i in range(3)}
    plans, faults = checked_plans(made(code), team, last, np.random.default_rng(0))
    assert bool(faults) == bool(words) and all(words in fault.message for fault in faults)
    for plan, situation in zip(plans, team, strict=True):
        if not words:
            np.testing.assert_array_equal(plan.controls, [[0.0, 0.0]])  # as it planned
        elif "exceeds" not in faults[0].message:
            np.testing.assert_array_equal(plan.controls, [[0.0, 2.0]])
        assert np.linalg.norm(plan.controls, axis=1).max() <= situation.own.max_speed
    assert all(fault.trace == () or "hostile.py" in fault.trace[0] for fault in faults)


@pytest.mark.parametrize("claim", DETECTED)
def test_a_detector_that_does_wrong_finds_nothing(claim):
    code, words = DETECTED[claim]
    frame = Frame(0, 0.0, CAMERA, Pose.level(0.0, 0.0, 20.0), np.zeros((64, 64, 3), np.uint8))
    mode = SimpleNamespace(_detector=made(code))
    found, faults = RenderedMode._detected(mode, frame, None)
    assert bool(faults) == bool(words) and all(words in fault.message for fault in faults)
    assert len(found.ground) == (0 if words else 1) and CAMERA.fov == 1.0 and frame.pose.position[2] == 20.0
