"""Random streams: one per seed, component, part and repeat, and each of them for good."""

from itertools import combinations, product

from sim.scenario.random_streams import stream

COMPONENTS = ("forest", "walkers", "sensors", "planner", "network", "repeat")


def test_each_seed_component_part_and_repeat_has_one_stream_of_its_own_for_good():
    names = [*product((*range(20), 2**70), COMPONENTS, [()], (0, 1))]
    names += product((0, 1), ("sensors", "repeat"), ((1,), (1, 2)), range(5))
    streams, again = (
        [stream(s, name, *i, repeat=r).integers(2**63, size=4) for s, name, i, r in names] for _ in range(2)
    )
    assert [a.tolist() for a in streams] == [a.tolist() for a in again]
    assert all(not set(a) & set(b) for a, b in combinations(map(tuple, streams), 2))
    # Numbers once drawn: a hash that depends on the process, or another derivation, would change them.
    first = [stream(0, *of) for of in (("forest",), ("walkers",))] + [stream(0, "sensors", repeat=1)]
    known = [9347971557553004297, 7514059325403089197, 13513145829749232258]
    assert [found.bit_generator.random_raw() for found in first] == known
