"""Scans a second of environments, beside the steps of MPE2's simple_spread; docs/results/benchmarks.md has the table.

What is compared takes turns, times are those of the processor, and of several the least counts. In ordinary test runs
each runs once, on little, and its times are not judged.
"""

import time
from functools import partial

import gymnasium
import numpy as np
import pytest

import understory
from sim.environments.vector import TeamVectorEnv

QUICK = {"sensing.mode": "ideal", "dynamics": "kinematic"}
CASES = {  # settings, and least scans a second
    "ideal, kinematic": (QUICK, 400),
    "the same, a decision each scan": ({**QUICK, "rates.planning": 5}, 200),
    "ideal, quadrotors": ({"sensing.mode": "ideal"}, 120),
    "rendered, kinematic": ({"dynamics": "kinematic"}, 100),
    "rendered, quadrotors": ({}, 60),
}


def flown(settings, duration):
    """Seconds of an episode, and of the reset before it, each with the scans that it flew."""
    env = understory.parallel_env("forest", settings={**settings, "duration": duration})
    start = time.process_time()
    env.reset(seed=1)
    begun = time.process_time()
    while env.agents:
        env.step(dict.fromkeys(env.agents, np.full(2, 0.1)))
    return begun - start, time.process_time() - begun, len(env.flight().recording.times) - 1


def spread(cycles):
    """Seconds of an episode of simple_spread with three agents, and its steps."""
    env = pytest.importorskip("mpe2.simple_spread_v3").parallel_env(N=3, max_cycles=cycles, continuous_actions=True)
    env.reset(seed=0)
    start, steps = time.process_time(), 0
    while env.agents:
        env.step({agent: np.full(5, 0.5, dtype=np.float32) for agent in env.agents})
        steps += 1
    return time.process_time() - start, steps


def test_scans_a_second_of_environments(judged):
    rounds, duration = (5, 40) if judged else (1, 2)
    runs = {name: [] for name in CASES}
    for _ in range(rounds):
        for name, (settings, _) in CASES.items():
            runs[name].append(flown(settings, duration))
    for name, (_, bound) in CASES.items():
        resets, seconds, scans = (min(column) for column in zip(*runs[name], strict=True))
        print(f"\n{name}: {scans / seconds:.0f} scans a second, {scans / (seconds + resets):.0f} with the reset")
        print(f"of {1e3 * resets:.0f} ms; bound {bound}")
        assert scans == 5 * duration and (not judged or scans / seconds >= bound)


def test_steps_a_second_of_simple_spread(judged):
    runs = [spread(200 if judged else 5) for _ in range(5 if judged else 1)]
    seconds, steps = min(runs)
    print(f"\nsimple_spread, three agents: {steps / seconds:.0f} steps a second")
    assert steps == (200 if judged else 5)


def steps_a_second(make, judged):
    """Steps a second of wall time of 16 environments, in turn for each way to make them; of several the most."""
    count, steps, rounds = (16, 20, 3) if judged else (2, 1, 1)
    found = dict.fromkeys(make, 0.0)
    for _ in range(rounds):
        for name, way in make.items():
            envs = way(count)
            envs.reset(seed=list(range(count)))
            envs.step(np.zeros((count, 3, 2)))
            start = time.perf_counter()
            for _ in range(steps):
                envs.step(np.full((count, 3, 2), 0.1))
            found[name] = max(found[name], steps * count / (time.perf_counter() - start))
            envs.close()
    for name, rate in found.items():
        print(f"\n{count} environments, {name}: {rate:.0f} steps a second of wall time")
    return found


def test_steps_a_second_of_vectors(judged):
    """Environments in one process, in one each, and in one for each core."""
    make = partial(gymnasium.make_vec, "understory/Forest-v0", settings=QUICK)
    ways = {"sync": "sync", "async": "async", "a process a core": None}
    found = steps_a_second({name: partial(make, vectorization_mode=mode) for name, mode in ways.items()}, judged)
    assert not judged or found["a process a core"] >= 0.9 * found["async"]


def test_two_processes_of_a_vector_beside_one(judged):
    """On two cores that do nothing else."""
    found = steps_a_second({n: partial(TeamVectorEnv, processes=n, settings=QUICK) for n in (1, 2)}, judged)
    assert not judged or found[2] >= 1.7 * found[1]
