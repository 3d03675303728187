"""Random streams: one per seed and component, and each of them for good."""

from itertools import combinations

import pytest

from sim.scenario.random_streams import stream

COMPONENTS = ("forest", "walkers", "sensors", "planner", "network")


def draws(seed: int, component: str) -> list[int]:
    return stream(seed, component).integers(2**63, size=4).tolist()


@pytest.mark.parametrize("seed", [0, 1, 2**70])
def test_the_same_seed_and_component_give_the_same_stream(seed):
    for component in COMPONENTS:
        assert draws(seed, component) == draws(seed, component)


def test_all_seeds_and_components_differ():
    streams = [draws(seed, component) for seed in range(20) for component in COMPONENTS]
    assert all(not set(a) & set(b) for a, b in combinations(streams, 2))


def test_what_other_components_draw_changes_nothing():
    alone = draws(3, "walkers")
    others = [stream(3, name) for name in ("forest", "a component of later", "planner")]
    subject = stream(3, "walkers")
    mixed = []
    for _ in range(4):
        for other in others:
            other.random(7)
        mixed.append(int(subject.integers(2**63)))
    assert mixed == alone


def test_streams_stay_as_they_are_in_every_process_and_version():
    # Numbers once drawn: a hash that depends on the process, or another derivation, would change them.
    first = [stream(0, name).bit_generator.random_raw() for name in ("forest", "walkers")]
    assert first == [9347971557553004297, 7514059325403089197]
