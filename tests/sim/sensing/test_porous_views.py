"""People under porous crowns: the share of them that images show, and the one that lines of sight compute."""

import math

import msgspec
import numpy as np
import pytest
from helpers.views import SCENARIO

from sim.scenario.environment import Area, Trees
from sim.sensing.renderer import Renderer
from sim.world.forest import grow
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, at_target_height

CAMERA = Camera(math.radians(60), 256)
DENSITIES = (0.1, 0.3, 0.6, 1.2, 2.0)
PEOPLE, VIEWS = 5, 8  # in each of the views of a map
KINDS = {
    "of 5 m": Trees(density=12),
    "of 1 to 3 m": Trees(per_hectare=300, canopy_radius=1.0, largest_radius=3.0),
    "of 6 to 14 m height": Trees(per_hectare=300, height=(6.0, 14.0), overlap=True),
}


def shares_of(trees, maps):
    """Rows of map, computed share and rendered share of one person in one view, at all densities in turn."""
    rng, rows = np.random.default_rng(0), []
    for seed in range(maps):
        setting = msgspec.structs.replace(trees, leaf_area_density=DENSITIES[seed % len(DENSITIES)])
        forest = grow(setting, Area(60.0, 60.0), np.random.default_rng(seed))
        with World(SCENARIO, forest, PEOPLE, seed) as full, World(SCENARIO, Forest(()), PEOPLE, seed) as bare:
            renderers = Renderer(full), Renderer(bare)
            for _ in range(VIEWS):
                pose = Pose.level(*rng.uniform(-18, 18, 2), rng.uniform(17, 24))
                half = pose.position[2] * math.tan(CAMERA.fov / 2) - 2.0
                places = pose.position[:2] + rng.uniform(-half, half, (PEOPLE, 2))
                headings = rng.uniform(-math.pi, math.pi, PEOPLE)
                for world in (full, bare):
                    world.place_people(places, headings)
                masks = [renderer.render(CAMERA, pose).people for renderer in renderers]
                shown, whole = (np.bincount(mask[mask >= 0], minlength=PEOPLE) for mask in masks)
                computed = forest.free_shares(pose.position, at_target_height(places))[0]
                rows += [(seed, *pair) for pair in zip(computed, shown / whole, strict=True)]
    return np.array(rows)


def mean_error(rows):
    """Mean over people of what is rendered less what is computed, and its standard error by maps."""
    errors = rows[:, 2] - rows[:, 1]
    by_map = [(np.sum(errors[of]), np.sum(of)) for of in (rows[:, 0] == seed for seed in np.unique(rows[:, 0]))]
    sums, counts = np.array(by_map).T
    return errors.mean(), np.sqrt(np.sum(np.square(sums - counts * errors.mean()))) / counts.sum()


@pytest.mark.parametrize("maps", [15, pytest.param(250, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", KINDS)
def test_people_show_as_much_as_lines_of_sight_say(kind, maps):
    """Of 2000 views in the mean to 0.02 and by tenths to 0.05, beyond three standard errors, which are 0.01 and 0.03.

    One line to the middle of a person stands for all of them. Beside crowns of 1 to 3 m, which are little wider than a
    person is tall, more shows of those whom it finds hidden, and less of those whom it finds free.
    """
    rows = shares_of(KINDS[kind], maps)
    error, deviation = mean_error(rows)
    assert abs(error) <= 0.02 + (3 * deviation if maps < 250 else 0.0)
    assert deviation < (0.05 if maps < 250 else 0.006)
    tenths = np.minimum((10 * rows[:, 1]).astype(int), 9)
    for tenth in np.unique(tenths).tolist():
        error, deviation = mean_error(rows[tenths == tenth])
        assert abs(error) <= 0.05 + 3 * deviation
