"""A motion model, a fusion rule and a sensor mode from outside the packages are one file each."""

import json
import re
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planning.registry import DEFAULT_PLANNER
from sim.mission.trial import Trial
from sim.recording.archive import digest, load
from sim.running.run import run
from sim.scenario.loading import load as load_scenario
from sim.study.tasks import task_of
from sim.study.trial import fly
from tracking.filter.motion import motion_model
from tracking.fusion.rule import fusion_rule
from tracking.plugins.registry import InputError

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "plugins.md").read_text(encoding="utf-8")
MODELS, MODES, WAYS = re.findall(r"^```py\n(.*?)^```$", PAGE, flags=re.M | re.S)  # of the page
SHORT = ("duration=1", "sensing.mode=ideal")


@cache
def flown(*overrides):
    """Digest of the recording of a short mission."""
    return fly(task_of(load_scenario("forest", [*SHORT, *overrides]), "hover", 0)).row.recording


@pytest.mark.parametrize(
    "override",
    [
        *("tracking.motion=mymodels:Standing", "network.fusion=mymodels:EqualWeights", "sensing.mode=mymode:Radar"),
        'people.walks=["myways:Patrol", "levy"]',
    ],
)
def test_one_file_from_outside_changes_the_tracks(tmp_path, monkeypatch, override):
    assert override in PAGE
    (tmp_path / "mymodels.py").write_text(MODELS)
    (tmp_path / "mymode.py").write_text(MODES)
    (tmp_path / "myways.py").write_text(WAYS)
    monkeypatch.syspath_prepend(str(tmp_path))
    summary = run(Trial(load_scenario("forest", [*SHORT, override]), "hover", 0), tmp_path / "theirs", video=False)
    assert override.partition("=")[2] in json.dumps(summary["scenario"]) and summary["faults"] == []
    assert digest(load(tmp_path / "theirs" / "mission.npz")) == flown(override) != flown()


def test_built_in_names_give_built_in_classes_that_know_a_lone_uavs_belief():
    assert type(motion_model("ncv", 0.2, 0.5, 3.0)).__name__ == "NearlyConstantVelocity"
    assert type(fusion_rule("hcmci")).__name__ == "HybridConsensus"
    from tracking.fusion.rule import LocalBeliefs

    mean, P = np.array([[1.0, 2.0, 0.5, 0.0]]), np.eye(4)[None] * 4.0
    nothing = np.zeros((0, 4)), np.zeros((0, 4, 4))
    local = LocalBeliefs(0, mean, P, np.ones(1), nothing, np.zeros((0, 2)), np.zeros((0, 2), int), np.zeros(0, int))
    for name in ("kla", "hcmci"):
        averaged, summed, _ = fusion_rule(name).contribution(local)
        assert averaged[0, :4].tolist() == (mean[0] / 4).tolist() and not summed.any()


WRONG = """
import sys


class Raises:
    def __init__(self, *arguments):
        raise ValueError("table is empty")


class Exits:
    def __init__(self, *arguments):
        sys.exit(3)


class Timeless:
    def __init__(self, dt, sigma_a, max_speed):
        self.predict = self.predict_all = print
"""


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("network.fusion=pathlib:Path", "network.fusion: 'pathlib:Path' has no method contribution(local)"),
        ("network.fusion=wrongmodels:Raises", "network.fusion: 'wrongmodels:Raises' cannot be made: table is empty ("),
        ("network.fusion=wrongmodels:Exits", "network.fusion: 'wrongmodels:Exits' cannot be made: SystemExit: 3"),
        ("tracking.motion=no_such_module:Model", "tracking.motion: 'no_such_module:Model' cannot be imported: "),
        ("tracking.motion=wrongmodels:Raises", "'wrongmodels:Raises' cannot be made: table is empty ("),
        ("tracking.motion=wrongmodels:Timeless", "must have the attribute dt = 0.2, has nan"),
    ],
)
def test_what_is_no_rule_or_model_is_refused_before_the_flight(tmp_path, monkeypatch, override, complaint):
    (tmp_path / "wrongmodels.py").write_text(WRONG)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match=re.escape(complaint)):
        run(Trial(load_scenario("forest", [*SHORT, override]), DEFAULT_PLANNER, 0), tmp_path / "out", video=False)
    assert not (tmp_path / "out").exists()


NONSENSE = """
import numpy as np
from tracking.filter.kalman import NearlyConstantVelocity
from tracking.fusion.kla import KullbackLeiblerAverage


class Model(NearlyConstantVelocity):
    def __init__(self, dt, sigma_a, max_speed):
        super().__init__(dt, sigma_a)

    def predict_all(self, means, covariances):
        means, covariances = super().predict_all(means, covariances)
        {model}
        return means, covariances


class Rule(KullbackLeiblerAverage):
    def contribution(self, local):
        given = super().contribution(local)
        {rule}
        return given
"""
PREDICTS, CONTRIBUTES = "tracking.motion=nonsense:Model", "network.fusion=nonsense:Rule"


@pytest.mark.parametrize(
    ("override", "line", "complaint"),
    [
        (PREDICTS, "means[:] = np.nan", "cannot predict: means are not finite"),
        (PREDICTS, "means = means[:-1]", "cannot predict: means of shape (3, 4), not (4, 4)"),
        (PREDICTS, "covariances *= -1.0", "cannot predict: covariances are not symmetric and positive definite"),
        (PREDICTS, "raise KeyError('table')", "cannot predict: KeyError: 'table' ("),
        (CONTRIBUTES, "given.averaged[0] = np.inf", "cannot contribute: averaged are not finite"),
        (CONTRIBUTES, "given = given._replace(weights=np.ones((4, 1)))", "cannot contribute: weights of shape (4, 1)"),
        (CONTRIBUTES, "given.averaged[:, 4:] *= -1.0", "are not symmetric and positive definite"),
        (CONTRIBUTES, "return None", "cannot contribute: "),
    ],
)
def test_nonsense_in_flight_ends_the_run_in_one_line(tmp_path, monkeypatch, override, line, complaint):
    code = NONSENSE.format(model=line if override == PREDICTS else "", rule=line if override == CONTRIBUTES else "")
    (tmp_path / "nonsense.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "nonsense", raising=False)
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        run(Trial(load_scenario("forest", [*SHORT, override]), "hover", 0), tmp_path / "out", video=False)
    assert str(error.value).startswith(override.replace("=", ": '") + "'") and "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()
