"""Plug-ins by name: built-in ones are never looked for in the current folder."""

import pytest

from sim.scenario.environment import WALKS
from sim.scenario.sensing import DETECTORS, SENSOR_MODES
from tracking.errors import InputError
from tracking.filter.motion import MOTION_MODELS
from tracking.fusion.member import TRACKERS
from tracking.fusion.rule import FUSION_RULES


@pytest.mark.parametrize("registry", [TRACKERS, MOTION_MODELS, FUSION_RULES, DETECTORS, SENSOR_MODES, WALKS])
def test_modules_of_the_current_folder_hide_no_built_in_plug_in(tmp_path, monkeypatch, registry):
    for target in registry.built_in.values():
        file = tmp_path.joinpath(*target.partition(":")[0].split(".")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("raise RuntimeError\n")
    monkeypatch.chdir(tmp_path)
    for name, target in registry.built_in.items():
        found = registry.find(name)
        assert f"{found.__module__}:{found.__qualname__}" == target
        with pytest.raises(InputError, match="is a module of Understory, which hides that of the current folder"):
            registry.find(target)
