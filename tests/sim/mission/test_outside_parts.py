"""Trackers, motion models, fusion rules, sensor modes and walks from outside fly, or end a run in one line."""

import json
import os
import re
import shutil
import sys
from functools import cache

import numpy as np
import pytest
from helpers.pages import DOCS, ROOT, blocks
from helpers.processes import python
from helpers.studies import task_of

from sim.mission.archive import compute_digest, load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.study.trial_flight import fly_trial
from tracking.errors import InputError
from tracking.filter.motion import make_motion_model
from tracking.fusion.rule import LocalBeliefs, make_fusion_rule

pytestmark = pytest.mark.usefixtures("without_pictures")
NEAREST = (DOCS / "examples" / "own_tracker.py").read_text("utf-8")
PAGE = (DOCS / "how-to" / "plugins.md").read_text("utf-8")
MODELS, _, MODES, WAYS = (content for language, content in blocks(PAGE) if language == "py")
SOUP = DOCS / "examples" / "soup"
SHORT = ("duration=1", "sensing.mode=ideal")
OPEN = ("duration=5", "sensing.mode=ideal", "trees.density=0")
MEAN = "t.belief.mean"


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Makes a module of the test's."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, name, raising=False)

    return make


def flown(folder, *overrides, planner="greedy"):
    """Recording and summary of a mission."""
    summary = run_mission(Trial(load_scenario("forest", overrides), planner, 0), folder, video=False)
    return load_recording(folder / "mission.npz"), summary


LATE = ("network.delay=0.2", "network.hold=0.6", "network.loss=0.3")


@pytest.mark.parametrize(
    ("name", "late", "farthest"),
    [
        ("mytracker:Nearest", (), 1.5),
        ("mytracker:Nearest", LATE, 2.5),
        ("soup:SoupJPDA", (), 1.5),
        pytest.param("soup:SoupJPDA", LATE, 2.5, marks=pytest.mark.slow),  # each part is tested above
    ],
)
def test_a_tracker_from_outside_keeps_all_people_of_an_open_scene(tmp_path, monkeypatch, module, name, late, farthest):
    module("mytracker", NEAREST)
    monkeypatch.syspath_prepend(str(SOUP))
    recording, summary = flown(tmp_path / "out", *OPEN, *late, f"tracking.tracker={name}")
    assert summary["faults"] == [] and f'"tracker":"{name}"' in recording.scenario
    assert set(recording.track_ids.tolist()) == {0, 1, 2, 3} and recording.ospa[..., 0].max() < farthest
    assert np.ptp(recording.track_sightings[:, 2]) > 1.0  # as `TrackExchange` tells them


def test_stone_soups_tracks_of_unknown_people_are_found(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SOUP))
    name, unknown = "tracking.tracker=soup:SoupJPDA", "tracking.initial_tracks=none"
    recording, _ = flown(tmp_path / "out", *OPEN, name, unknown, "sensing.field_of_view=unlimited", planner="hover")
    assert len(set(recording.track_ids.tolist())) == 4 and recording.ospa[10:, :, 0].max() < 1.5


@cache
def digest_of(*overrides):
    """Digest of the recording of a short mission."""
    return fly_trial(task_of(load_scenario("forest", [*SHORT, *overrides]), "hover", 0)).row.recording


@pytest.mark.parametrize(
    "override",
    [
        *("tracking.motion=mymodels:Standing", "network.fusion=mymodels:EqualWeights", "sensing.mode=mymode:Radar"),
        'people.walks=["myways:Patrol", "levy"]',
    ],
)
def test_one_file_from_outside_changes_the_tracks(tmp_path, module, override):
    assert override in PAGE
    for name, code in (("mymodels", MODELS), ("mymode", MODES), ("myways", WAYS)):
        module(name, code)
    recording, summary = flown(tmp_path / "theirs", *SHORT, override, planner="hover")
    assert override.partition("=")[2] in json.dumps(summary["scenario"]) and summary["faults"] == []
    assert compute_digest(recording) == digest_of(override) != digest_of()


SUMS = """
from tracking.fusion.hcmci import HybridConsensus


class Zeros(HybridConsensus):
    def contribution(self, local):
        given = super().contribution(local)
        if local.uav:
            own = given.averaged + given.summed[:, :20]
            return given._replace(averaged=own, summed=self.nothing(given.summed))
        return given

    def nothing(self, summed):
        return 0.0 * summed


class Nothing(Zeros):
    def nothing(self, summed):
        return summed[:, :0]
"""


def test_a_fusion_rule_may_add_up_on_some_uavs_only(tmp_path, module):
    module("sums", SUMS)
    zeros, nothing = (flown(tmp_path / rule, *SHORT, f"network.fusion=sums:{rule}")[0] for rule in ("Zeros", "Nothing"))
    assert np.array_equal(nothing.track_means, zeros.track_means) and len(zeros.track_means)


def test_built_in_names_give_built_in_classes_that_know_a_lone_uavs_belief():
    assert type(make_motion_model("ncv", 0.2, 0.5, 3.0, 1.6)).__name__ == "NearlyConstantVelocity"
    assert type(make_fusion_rule("hcmci")).__name__ == "HybridConsensus"
    mean, P = np.array([[1.0, 2.0, 0.5, 0.0]]), np.eye(4)[None] * 4.0
    nothing = np.zeros((0, 4)), np.zeros((0, 4, 4))
    local = LocalBeliefs(0, mean, P, np.ones(1), nothing, np.zeros((0, 2)), np.zeros((0, 2), int), np.zeros(0, int))
    for name in ("kla", "hcmci"):
        averaged, summed, _ = make_fusion_rule(name).contribution(local)
        assert averaged[0, :4].tolist() == (mean[0] / 4).tolist() and not summed.any()


# By key and method: the class, the method's arguments, and what it gives, of which a line makes nonsense.
MODEL = "from tracking.filter.kalman import NearlyConstantVelocity\n", "NearlyConstantVelocity"
RULE = "from tracking.fusion.rule import KullbackLeiblerAverage\n", "KullbackLeiblerAverage"
TRACKER = f"from dataclasses import replace\n{NEAREST}\n\n", "Nearest"
MODE = f"from dataclasses import replace\nfrom tracking.detection.detector import Frame\n{MODES}\n\n"
METHODS = {
    "step": ("tracking.tracker", *TRACKER, "scan"),
    "coast": ("tracking.tracker", *TRACKER, "time"),
    "message": ("tracking.tracker", *TRACKER, "degree"),
    "accept": ("tracking.tracker", *TRACKER, "message"),
    "predict_all": ("tracking.motion", *MODEL, "means, covariances"),
    "contribution": ("network.fusion", *RULE, "local"),
    "sense": ("sensing.mode", MODE, "Radar", "shot"),
}
MADE = {"predict_all": "def __init__(self, dt, sigma_a, *speeds):\n        super().__init__(dt, sigma_a)\n\n    "}


@pytest.mark.parametrize(
    ("call", "line", "complaint"),
    [
        ("accept", f"for t in self.tracks: {MEAN}[:] = np.nan", "tracks after accept: means of tracks are not finite"),
        ("coast", "1 / 0", "cannot take a scan: ZeroDivisionError: "),
        ("message", "return replace(given, shares=given.shares[1:])", "shares of shape (3, 22), not (4, 22)"),
        ("message", "return replace(given, scan=9)", "it is of scan 9 at 0.0 s, not of scan 1 at 0.0 s"),
        ("predict_all", "given[1][:] *= -1.0", "cannot predict: covariances are not symmetric and positive definite"),
        ("contribution", "given.averaged[0] = np.inf", "cannot contribute: averaged are not finite"),
        ("sense", "return None", "cannot sense: output: NoneType is no sim.sensing.sensor_mode.SensorOutput"),
        ("sense", "return replace(given, ground=given.ground[:, 0])", "cannot sense: ground of shape (2,), not (2, 2)"),
        ("sense", "return replace(given, frame=3)", "frame: int is no tracking.detection.detector.Frame"),
    ],
)
def test_nonsense_in_flight_ends_the_run_in_one_line(tmp_path, module, call, line, complaint):
    key, code, base, arguments = METHODS[call]
    code += f"import numpy as np\n\n\nclass Wrong({base}):\n    {MADE.get(call, '')}def {call}(self, {arguments}):\n"
    code += f"        given = super().{call}({arguments})\n        {line}\n        return given\n"
    module("wrong", code)
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        flown(tmp_path / "out", *SHORT, f"{key}=wrong:Wrong", planner="hover")
    assert str(error.value).startswith(f"{key}: 'wrong:Wrong' ") and "\n" not in str(error.value)
    assert re.search(r"wrong\.py:[0-9]+, in \S+\)$", str(error.value))
    assert not (tmp_path / "out").exists()


def test_of_the_frame_of_a_sensor_mode_the_image_alone_is_used(tmp_path, module):
    key, code, base, arguments = METHODS["sense"]
    code += f"import numpy as np\n\n\nclass Bare({base}):\n    {MADE.get('sense', '')}def sense(self, {arguments}):\n"
    frame = "Frame(shot.uav, shot.time, None, None, np.zeros((8, 8, 3), np.uint8))"
    code += f"        return replace(super().sense({arguments}), frame={frame})\n"
    module("bare", code)
    flown(tmp_path / "out", *SHORT, "sensing.false_alarms=2", f"{key}=bare:Bare", planner="hover")
    assert (tmp_path / "out" / "mission.npz").exists()


@pytest.mark.parametrize(
    ("call", "line"),
    [
        ("step", "scan.measurements[:] = scan.pose.position[:] = np.nan"),
        ("accept", "message.ids[:] = 0"),
        ("contribution", "local.means[:] = local.covariances[:] = np.nan"),
        ("sense", "shot.people[:] = shot.true.position[:] = shot.true.quaternion[:] = np.nan"),
    ],
)
def test_a_plug_in_that_changes_what_it_is_given_changes_nothing(module, call, line):
    key, code, base, arguments = METHODS[call]
    code += f"import numpy as np\n\n\nclass Plain({base}):\n    pass\n\n\nclass Spoils({base}):\n"
    code += f"    def {call}(self, {arguments}):\n        given = super().{call}({arguments})\n        {line}\n"
    module("spoils", f"{code}        return given\n")
    rows = [
        fly_trial(task_of(load_scenario("forest", [*SHORT, f"{key}=spoils:{name}"]), "greedy", 0)).row
        for name in ("Plain", "Spoils")
    ]
    assert rows[0].ospa.tobytes() == rows[1].ospa.tobytes() and rows[1].error == ""


@pytest.mark.docs
def test_the_example_passes_its_own_tests(tmp_path):
    shutil.copytree(SOUP, tmp_path / "soup")
    path = os.pathsep.join([str(tmp_path / "soup"), str(ROOT)])
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "tests"]
    done = python(*words, cwd=tmp_path / "soup", PYTHONPATH=path)
    assert "2 passed" in done.stdout, done.stdout
