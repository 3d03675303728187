"""Registration of the packaged scenarios with Gymnasium, such as `understory/Forest-v0`, when this is imported."""

import gymnasium

from sim.scenario.loading import SCENARIOS

for _name in SCENARIOS:
    gymnasium.register(
        f"understory/{_name.capitalize()}-v0",
        "sim.environments.team:TeamEnv",
        vector_entry_point="sim.environments.vector:TeamVectorEnv",
        kwargs={"scenario": _name},
    )
