"""Shares of people that images show under porous crowns and in the open: the figures of docs/results/canopy.md."""

import math

import numpy as np

from sim.scenario.environment import Area, Trees
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import DEFAULT_FLEET
from sim.sensing.detection_truth import count_visible_pixels
from sim.sensing.renderer import Renderer
from sim.world.forest import grow
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest

DENSITIES = (0.1, 0.3, 1.0, 2.0, math.inf)  # m²/m³
_PEOPLE = 8
_CAMERA = Camera(math.radians(60), 256)


def view_people(density: float, views: int, seed: int = 0) -> np.ndarray:
    """Rows of people in random views of the default forest: under a crown or not, and the share that shows."""
    rng, rows = np.random.default_rng(seed), []
    leaves = None if math.isinf(density) else density
    forest = grow(Trees(leaf_area_density=leaves), Area(), rng)
    crowns = np.array([(tree.x, tree.y, tree.canopy_radius) for tree in forest.trees])
    with World(Scenario(), forest, _PEOPLE, seed) as full, World(Scenario(), Forest(()), _PEOPLE) as bare:
        renderers = Renderer(full), Renderer(bare)
        for k in range(views):
            pose = Pose.level(*rng.uniform((-60, -35), (60, 35)), DEFAULT_FLEET[k % 3].altitude)
            half = pose.position[2] * math.tan(_CAMERA.fov / 2) - 2.0
            people = pose.position[:2] + rng.uniform(-half, half, (_PEOPLE, 2))
            headings = rng.uniform(-math.pi, math.pi, _PEOPLE)
            for world in (full, bare):
                world.place_people(people, headings)
            shown, whole = (count_visible_pixels(r.render(_CAMERA, pose).people, _PEOPLE) for r in renderers)
            under = (np.hypot(*(people[:, None] - crowns[:, :2]).transpose(2, 0, 1)) < crowns[:, 2]).any(axis=1)
            rows.append(np.column_stack([under, shown / np.maximum(whole, 1)]))
    return np.concatenate(rows)


def main(views: int = 600) -> None:
    """Print, by leaf area density, how many people an image shows at all, and how many of these by less than half."""
    print("| m²/m³ | under crowns: shown | of these at least half hidden | in the open: at least half hidden |")
    print("|---|---|---|---|")
    for density in DENSITIES:
        rows = view_people(density, views)
        under, open_ = rows[rows[:, 0] > 0, 1], rows[rows[:, 0] == 0, 1]
        parts = np.mean(under > 0), np.mean(under[under > 0] <= 0.5), np.mean(open_[open_ > 0] <= 0.5)
        print("|", " | ".join(["opaque" if math.isinf(density) else f"{density:g}", *(f"{p:.0%}" for p in parts)]), "|")


if __name__ == "__main__":
    main()
