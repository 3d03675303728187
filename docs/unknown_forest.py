"""How good the maps are that UAVs make and share, for docs/results/unknown-forest.md: `python docs/unknown_forest.py`.

It flies the default mission on seeds 200 to 219, once as it is and once with light, ground and leaves of other kinds,
and compares the map of each UAV at the end with the true trees. Trees count whose middle cannot be below an unknown
tree, as far as the UAV believes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

import understory
from sim.mission.recording import Recording
from tracking.geometry.line_of_sight import value_at
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array, Flags

SEEDS = range(200, 220)
WORLDS: dict[str, dict[str, Any]] = {"default": {}, "other appearances": {"appearance.randomise": True}}
STEP = 0.5  # m, between points at which shadows are compared


class Maps(NamedTuple):
    """Sums over maps, and errors of each mapped tree that counts."""

    seen: int
    found: int
    mapped: int
    false: int
    errors: Array  # (N, 4): distance of the middle, errors of radius and top [m], and NEES of the middle
    shadows: list[float]  # intersection over union of the ground below believed and true crowns


def measure(recordings: Iterable[Recording]) -> Maps:
    """Compare the last map of each UAV with the true trees."""
    counts, errors, shadows = np.zeros(4, dtype=np.int64), list[tuple[float, ...]](), list[float]()
    for recording in recordings:
        true = recording.forest.trees
        for uav in range(recording.uav_count):
            believed = recording.believed_at(recording.scan_count - 1, uav)
            seen = [value_at(believed.unknown_around, tree.x, tree.y) == 0.0 for tree in true]
            places = np.array([(tree.x, tree.y) for tree in true])
            found = set[int]()
            deviations = np.broadcast_to(believed.deviation, len(believed.trees))
            for tree, deviation in zip(believed.trees, deviations.tolist(), strict=True):
                gaps = np.hypot(*(places - (tree.x, tree.y)).T)
                n = int(gaps.argmin())
                hit = gaps[n] < true[n].canopy_radius and n not in found
                counts += (0, 0, 1, not hit)
                if hit and seen[n]:
                    nees = (gaps[n] / deviation) ** 2
                    sizes = tree.canopy_radius - true[n].canopy_radius, tree.canopy_top - true[n].canopy_top
                    errors.append((gaps[n], *sizes, nees))
                found |= {n} if hit else set()
            counts += (sum(seen), sum(seen[n] for n in found), 0, 0)
            shadows += compare_shadows(believed, true, recording)
    return Maps(*counts.tolist(), np.array(errors), shadows)


def compare_shadows(believed: Forest, true: tuple[Tree, ...], recording: Recording) -> list[float]:
    """Intersection over union of the ground below crowns where no unknown tree can be; empty without such ground."""
    half = recording.setting.area.width / 2, recording.setting.area.height / 2
    x, y = np.meshgrid(*(np.arange(-side + STEP / 2, side, STEP) for side in half))
    pairs = zip(x.ravel().tolist(), y.ravel().tolist(), strict=True)
    sure = np.array([value_at(believed.unknown_around, *place) == 0.0 for place in pairs]).reshape(x.shape)
    one, other = (cover(trees, x, y) & sure for trees in (believed.trees, true))
    return [float((one & other).sum() / (one | other).sum())] if (one | other).any() else []


def cover(trees: tuple[Tree, ...], x: Array, y: Array) -> Flags:
    """Mask of the points below any crown."""
    found = np.zeros(x.shape, dtype=np.bool_)
    for tree in trees:
        found |= (x - tree.x) ** 2 + (y - tree.y) ** 2 <= tree.canopy_radius**2
    return found


def write_line(name: str, maps: Maps) -> str:
    """A line of the table."""
    centre, radius, top = np.sqrt(np.mean(maps.errors[:, :3] ** 2, axis=0)).tolist()
    recall, false = maps.found / maps.seen, maps.false / maps.mapped
    shares = f"{100 * recall:.1f} ({maps.found} of {maps.seen}) | {100 * false:.1f} ({maps.false} of {maps.mapped})"
    errors = f"{centre:.2f} | {radius:.2f} | {top:.2f} | {np.mean(maps.errors[:, 3]) / 2:.2f}"
    return f"| {name} | {shares} | {errors} | {np.mean(maps.shadows):.2f} |"


def fly(seed: int, settings: dict[str, Any]) -> Recording:
    """Fly the default mission with UAVs that map and share."""
    return understory.run(seed=seed, settings={"mapping.forest": "mapped", **settings}).recording


def main(seeds: Iterable[int] = SEEDS, **settings: Any) -> None:  # noqa: ANN401 - keys of the scenario
    """Print the table."""
    print("| appearance | recall [%] | false [%] | middle [m] | radius [m] | top [m] | NEES / 2 | shadows |")
    print("|---|---|---|---|---|---|---|---|")
    for name, world in WORLDS.items():
        print(write_line(name, measure(fly(seed, {**world, **settings}) for seed in seeds)))


if __name__ == "__main__":
    main(range(*map(int, sys.argv[1:3])) if len(sys.argv) > 2 else SEEDS)
