"""Courses of several environments share one process."""

import numpy as np

import understory


def test_an_environment_that_begins_anew_leaves_the_world_of_another_alone():
    """The other one has the place in the engine that the first gave back at the end of its mission."""
    settings = {"duration": 1, "sensing.mode": "ideal"}
    one, other = (understory.parallel_env("forest", settings=settings) for _ in range(2))
    one.reset(seed=0)
    while one.agents:
        one.step(dict.fromkeys(one.agents, np.zeros(2)))
    other.reset(seed=1)
    one.reset(seed=2)
    for env in (other, one):
        env.step(dict.fromkeys(env.agents, np.zeros(2)))
        env.close()
