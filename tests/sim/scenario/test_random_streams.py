"""Random streams: one per seed and component, and each of them for good."""

from itertools import combinations

from sim.scenario.random_streams import stream

COMPONENTS = ("forest", "walkers", "sensors", "planner", "network")


def draws(seed: int, component: str) -> list[int]:
    return stream(seed, component).integers(2**63, size=4).tolist()


def test_each_seed_and_component_has_one_stream_of_its_own_for_good():
    names = [(seed, component) for seed in (*range(20), 2**70) for component in COMPONENTS]
    streams = [draws(*name) for name in names]
    assert streams == [draws(*name) for name in names]
    assert all(not set(a) & set(b) for a, b in combinations(streams, 2))
    # Numbers once drawn: a hash that depends on the process, or another derivation, would change them.
    first = [stream(0, name).bit_generator.random_raw() for name in ("forest", "walkers")]
    assert first == [9347971557553004297, 7514059325403089197]
