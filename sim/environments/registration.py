"""Registers each packaged scenario with Gymnasium when it is imported, such as `understory/Forest-v0`."""

import gymnasium

from sim.scenario.loading import SCENARIOS

for _name in SCENARIOS:
    gymnasium.register(
        f"understory/{_name.capitalize()}-v0", "sim.environments.team:TeamEnv", kwargs={"scenario": _name}
    )
