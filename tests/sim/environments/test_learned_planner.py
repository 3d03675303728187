"""The recipe of Stable-Baselines3 from training to flight, with a stand-in for the library, which takes long to import.

`pytest -m docs tests/docs/test_examples.py` runs it with the library where that is installed.
"""

import json
import runpy
import shutil
import sys

import numpy as np
from helpers.pages import DOCS

STAND_IN = """
import numpy as np
from pathlib import Path

class PPO:
    def __init__(self, policy, env=None, **options):
        assert policy == "MlpPolicy" and {"n_steps", "batch_size", "seed", "device"} == set(options)
        self.env = env
    def learn(self, steps):
        observation, over = self.env.reset()[0], False
        while not over:
            assert self.env.observation_space.contains(observation) and np.abs(observation).max() <= 1.0
            observation, _, terminated, truncated, _ = self.env.step(self.env.action_space.sample())
            over = terminated or truncated
        self.size = len(observation)
    def save(self, path):
        Path(path).write_text(str(self.size))
    @classmethod
    def load(cls, path, device):
        made = cls.__new__(cls)
        made.size = int(Path(path).read_text())
        return made
    def predict(self, observation, deterministic):
        assert observation.shape == (self.size,) and observation.dtype == np.float32 and deterministic
        return np.array([[1.0, 1.0], [-1.0, 0.0], [0.0, 0.5]], dtype=np.float32), None
"""


def test_a_policy_is_trained_saved_and_flown_by_the_command(call, tmp_path, monkeypatch):
    (tmp_path / "stable_baselines3.py").write_text(STAND_IN)
    script = shutil.copy(DOCS / "examples" / "with_stable_baselines.py", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("stable_baselines3", "with_stable_baselines"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    runpy.run_path(str(script), run_name="__main__")
    planner = "with_stable_baselines:Learned(path=policy.zip)"
    code, _, err = call(
        "run", "--planner", planner, "--duration", "1.4", "--set", "sensing.mode=ideal", "--no-video", "--out", "out"
    )
    assert (code, err) == (0, "")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["faults"] == []
    with np.load(tmp_path / "out" / "mission.npz") as recording:
        flown = recording["commands"][6]
    np.testing.assert_allclose(flown, np.array([[0.5**0.5] * 2, [-1.0, 0.0], [0.0, 0.5]]) * 5.0, rtol=1e-6)
