"""`understory check-mapper`: ours conforms, each broken mapper fails the check that fits, and missions go on."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.commands import called
from helpers.flights import fly

from sim.scenario.loading import load_scenario
from sim.sensing.mapper_check import check_mapper
from tracking.errors import InputError
from tracking.geometry.visibility import Tree
from tracking.mapping.mapper import ParallaxMapper, SeenGround


class Good(ParallaxMapper):
    """As ours, and writes into images."""

    def add(self, frame):
        super().add(frame)
        frame.image.flags.writeable = True
        frame.image[:] = 0


class Raising(ParallaxMapper):
    def add(self, frame):
        raise RuntimeError("two\nlines")


class Silent(ParallaxMapper):
    def trees(self):
        return None


class Bare(ParallaxMapper):
    """Gives trees without errors."""

    def trees(self):
        return [found.tree for found in super().trees()]


class Upside(ParallaxMapper):
    def trees(self):
        return [replace(found, tree=replace(found.tree, canopy_base=9.0)) for found in super().trees()]


class Certain(ParallaxMapper):
    def trees(self):
        return [replace(found, existence=1.5) for found in super().trees()]


class Odd(ParallaxMapper):
    def ground(self):
        return SeenGround((0.0, 0.0), 1.0, np.full((3, 3), 7))


class Listing(ParallaxMapper):
    """Gives lists for arrays."""

    def trees(self):
        return [replace(found, covariance=found.covariance.tolist()) for found in super().trees()]

    def ground(self):
        found = super().ground()
        return replace(found, states=found.states.tolist() or np.zeros((0, 0), dtype=np.uint8))


class Eager(ParallaxMapper):
    """Cannot be asked before the first frame."""

    frames = 0

    def add(self, frame):
        super().add(frame)
        self.frames += 1

    def trees(self):
        return super().trees() if self.frames else 1 / 0


class Blind(ParallaxMapper):
    def trees(self):
        return ()


class Shifted(ParallaxMapper):
    def trees(self):
        return [replace(found, tree=replace(found.tree, x=found.tree.x + 3.0)) for found in super().trees()]


class Imagining(ParallaxMapper):
    """Sees a tree everywhere."""

    def trees(self):
        like = super().trees()[:1] or ParallaxMapper().trees()
        places = [Tree(6.0 * k, 30.0, 2.0, 2.0, 5.0) for k in range(9)]
        return [*super().trees(), *(replace(found, tree=tree) for found in like for tree in places)]


class Wooded(ParallaxMapper):
    """Takes open ground for covered and the other way."""

    def ground(self):
        found = super().ground()
        return replace(found, states=np.array([0, 2, 1], dtype=np.uint8)[found.states])


class Sure(ParallaxMapper):
    def trees(self):
        return [replace(found, covariance=found.covariance / 1e3) for found in super().trees()]


class Random(ParallaxMapper):
    def trees(self):
        shift = np.random.default_rng().normal(scale=0.01)
        return [replace(found, tree=replace(found.tree, x=found.tree.x + shift)) for found in super().trees()]


BROKEN = {
    Raising: {"map": "RuntimeError: two lines"},
    Eager: {"map": "ZeroDivisionError"},
    Silent: {"map": "trees are no tuple or list but of type NoneType"},
    Bare: {"map": "a tree: Tree is no tracking.mapping.mapper.MappedTree"},
    Upside: {"map": "a base below 0 or above the top"},
    Certain: {"map": "existence and rim are not from 0 to 1"},
    Odd: {"map": "states are no table of 0, 1 and 2"},
    Blind: {"trees": "0 of 6"},
    Shifted: {"trees": "0 of 6 within 1 m, 6 that are none"},
    Imagining: {"trees": "6 of 6 within 1 m, 9 that are none"},
    Wooded: {"ground": "right are"},
    Sure: {"covariances": "far too small"},
    Random: {"same frames, same result": "another instance"},
}


def named(kind):
    return f"{__name__}:{kind.__name__}"


@pytest.mark.parametrize("name", ["parallax", named(Good), named(Listing)])
def test_good_mappers_conform(name):
    findings = check_mapper(name)
    assert [str(f) for f in findings if not f.passed] == []
    assert "6 of 6 within 1 m, 0 that are none" in str(findings[1]) and "0 trees" in str(findings[2])
    assert ("it writes into frame.image" in str(findings[0])) == (name == named(Good))


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_mapper_fails_the_check_that_fits(kind):
    failed = {f.check: f.seen for f in check_mapper(named(kind)) if f.passed is False}
    for name, words in BROKEN[kind].items():
        assert words in failed.pop(name)
    assert set(failed) <= {"ground"}  # whose covered cells are those of the trees


def test_the_command_prints_a_line_per_check_and_exits_with_1(monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", list(sys.path))
    code, out, err = called(["check-mapper", "parallax"], monkeypatch, capsys)
    assert (code, err) == (0, "") and out.endswith("It conforms.\n") and out.count("passed ") == 7
    code, out, _ = called(["check-mapper", named(Blind)], monkeypatch, capsys)
    assert code == 1 and "1 of 7 checks failed" in out
    code, out, err = called(["check-mapper", "paralax"], monkeypatch, capsys)
    assert (code, out) == (2, "") and "did you mean parallax?" in err and err.count("\n") == 1


class Failing(ParallaxMapper):
    """Fails after two seconds."""

    def ground(self):
        if self._views and self._views[-1][0] > 2.0:
            raise ValueError("no memory left")
        return super().ground()


def test_a_mapper_that_fails_in_flight_is_a_fault_and_its_uav_goes_on_with_its_last_map_and_those_of_others():
    settings = ["mapping.forest=mapped", f"mapping.mapper={named(Failing)}", "trees.density=75"]
    mission, snapshots = fly(*settings, "mapping.share=false", planner="greedy", seed=3, duration=6)
    alone = mission.beliefs.believed(0)
    assert len(snapshots) == 31 and np.any(alone.unknown.values == 0.0)
    assert sum("mapper: ValueError: no memory left" in fault.message for fault in mission.faults) >= 6
    mission, snapshots = fly(*settings, planner="greedy", seed=3, duration=6)
    together = mission.beliefs.believed(0)
    assert np.count_nonzero(together.unknown.values) < np.count_nonzero(alone.unknown.values)
    assert all(snapshot.map_bytes.all() for snapshot in snapshots[5::5])  # once a second
    with pytest.raises(InputError, match=r"mapping.mapper: .*parallax"):
        load_scenario("forest", ["mapping.mapper=paralax"])


def test_a_mapper_of_lists_flies():
    settings = ["mapping.forest=mapped", f"mapping.mapper={named(Listing)}", "trees.density=75"]
    mission, _ = fly(*settings, planner="greedy", seed=3, duration=6)
    assert mission.faults == [] and any(mission.beliefs.believed(uav).trees for uav in range(3))


def test_a_mapper_that_cannot_be_asked_before_the_first_frame_is_refused_in_one_line():
    with pytest.raises(InputError) as error:
        fly("mapping.forest=mapped", f"mapping.mapper={named(Eager)}", planner="hover", duration=1)
    words = r"mapping.mapper: '.*:Eager' cannot be asked before the first frame: ZeroDivisionError: .* \(.* in trees\)"
    assert re.fullmatch(words, str(error.value))
