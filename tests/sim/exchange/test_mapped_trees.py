"""Trees mapped from rendered frames are those of the mission, and a stem map that can be flown."""

import math
from dataclasses import replace

import pytest

from sim.exchange.mapped_trees import list_frames, map_frames, write_stem_map
from sim.mission.trial import Trial
from sim.running.fly import fly_mission
from sim.scenario.environment import Trees
from sim.scenario.loading import resolve_scenario
from sim.world.stem_map import read_stem_map
from tracking.errors import InputError


def fly(planner, **settings):
    scenario = resolve_scenario("forest", settings=settings)
    return fly_mission(Trial(scenario, planner, 4)).recording


@pytest.fixture(scope="module")
def hovering():
    return fly("hover", duration=1.0)


def test_trees_of_a_rendered_forest_are_mapped_and_read_again(tmp_path):
    recording = fly("greedy", **{"duration": 16.0, "appearance.randomise": True})
    mapped = map_frames(list_frames(recording, 1), "parallax")
    assert len(mapped) >= 3
    for found in mapped:
        tree = min(recording.forest.trees, key=lambda tree: math.hypot(tree.x - found.tree.x, tree.y - found.tree.y))
        error = math.hypot(tree.x - found.tree.x, tree.y - found.tree.y)
        assert error < 4.0 * math.sqrt(found.covariance[0, 0] + found.covariance[1, 1])
        assert abs(found.tree.canopy_top - tree.canopy_top) < 4.0 * math.sqrt(found.covariance[4, 4])
    write_stem_map(mapped, tmp_path / "mapped.csv")
    read = read_stem_map(tmp_path / "mapped.csv", "trees.file", Trees())
    assert read.trees == tuple(found.tree for found in mapped)


def test_a_uav_that_hovers_maps_nothing(hovering):
    assert map_frames(list_frames(hovering, 0), "parallax") == ()


def test_wrong_arguments_are_named(hovering):
    with pytest.raises(InputError, match="uav: 3 is not allowed; expected 0 to 2"):
        next(list_frames(hovering, 3))
    with pytest.raises(InputError, match="mapper: 'nothing' is"):
        map_frames((), "nothing")
    with pytest.raises(InputError, match="cannot be rendered"):
        next(list_frames(replace(hovering, frames=hovering.frames_taken), 0))
