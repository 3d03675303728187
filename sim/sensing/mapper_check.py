"""Conformance of a mapper to `tracking.mapping.mapper.TreeMapper`, checked on rendered frames of a short flight."""

import timeit
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from sim.scenario.believed import MAPPERS
from sim.scenario.scenario import Scenario
from sim.scenario.uavs import Uav
from sim.sensing.mapper_output_check import read_map
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.detector import Frame
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree
from tracking.mapping.mapper import COVERED, OPEN, MappedTree, SeenGround
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length, squared_distance
from tracking.plugins.findings import Finding, check_nees, describe_time, find_change, require, try_checks
from tracking.plugins.plugin_error import plugin_call

_TREES = (
    Tree(-14.0, 6.0, 4.0),
    Tree(-4.0, -5.0, 3.0),
    Tree(3.0, 5.0, 3.5),
    Tree(12.0, -4.0, 4.0),
    Tree(18.0, 5.0, 3.0),
    Tree(-18.0, -4.0, 3.0),
)
_UAV = Uav(start=(74.0, 49.0))
_PATH = [(-24.0 + 0.4 * k, 0.0, 20.0) for k in range(121)]  # m, one place in 0.2 s, at 2 m/s
_ASKED = 5  # frames, from one time that a map is asked for to the next, as in missions
_NEAR = 1.0  # m from the middle of a tree to that of the one that is mapped for it


@cache
def stage_flight(*, empty: bool = False) -> tuple[Frame, ...]:
    """The frames of a straight flight over six trees, or over none, rendered once."""
    with World(Scenario(uavs=(_UAV,)), Forest(() if empty else _TREES), 0) as world:
        renderer, frames = Renderer(world), []
        for k, (x, y, z) in enumerate(_PATH):
            pose = Pose.level(x, y, z)
            frames.append(Frame(0, k / 5, _UAV.true_camera, pose, renderer.render(_UAV.true_camera, pose).image))
        return tuple(frames)


def check_mapper(mapper: str) -> list[Finding]:
    """Findings of all checks of a mapper, which conforms if none has `passed` False.

    mapper: a name or an import string. InputError if there is no such mapper, or it cannot be made.
    """
    MAPPERS.make(mapper)
    return try_checks(_Subject(mapper), _CHECKS)


@dataclass
class _Subject:
    """A mapper under test, by name or import string, and what it mapped in the flight."""

    name: str
    trees: tuple[MappedTree, ...] = ()
    ground: SeenGround = field(default_factory=lambda: SeenGround((0.0, 0.0), 1.0, np.zeros((0, 0), dtype=np.uint8)))
    writes: bool = False  # into the images of frames

    def fly(self, *, empty: bool = False) -> tuple[tuple[MappedTree, ...], SeenGround]:
        """What a new instance maps in the flight; PluginError if that cannot be used."""
        made: Any = MAPPERS.make(self.name)
        found = read_map(made)
        for k, frame in enumerate(stage_flight(empty=empty)):
            given = replace(frame, image=frame.image.copy())
            with plugin_call(made, "add"):
                made.add(given)
            self.writes |= not np.array_equal(given.image, frame.image)
            found = read_map(made) if k % _ASKED == 0 else found
        return found

    @property
    def gaps(self) -> Array:
        """Distances (N, T) m between the middles of mapped and true trees."""
        own, true = (np.array([(t.x, t.y) for t in trees]).reshape(-1, 2) for trees in (self.mapped, _TREES))
        return length(own[:, None] - true[None])

    @property
    def mapped(self) -> list[Tree]:
        """The trees without their errors."""
        return [found.tree for found in self.trees]


def _check_map(subject: _Subject) -> str:
    subject.trees, subject.ground = subject.fly()
    writes = "; it writes into frame.image: give it a copy of an image that you keep" if subject.writes else ""
    return f"{len(subject.trees)} trees, {subject.ground.states.size} cells of ground{writes}"


def _check_trees(subject: _Subject) -> str:
    near = subject.gaps <= _NEAR
    found, wrong = int(near.any(axis=0).sum()), int((~near.any(axis=1)).sum())
    told = f"{found} of {len(_TREES)} within {_NEAR:g} m, {wrong} that are none"
    require(2 * found >= len(_TREES) >= wrong, told)
    return told


def _check_empty(subject: _Subject) -> str:
    trees, _ = subject.fly(empty=True)
    require(len(trees) <= 2, f"{len(trees)} trees where there are none")
    return f"{len(trees)} trees"


def _check_ground(subject: _Subject) -> str:
    states, (west, south), cell = subject.ground.states, subject.ground.corner, subject.ground.cell
    rows, columns = np.indices(states.shape)
    places = np.column_stack([west + cell * (columns.ravel() + 0.5), south + cell * (rows.ravel() + 0.5)])
    trees = np.array([(tree.x, tree.y, tree.canopy_radius) for tree in _TREES])
    below = np.any(length(places[:, None] - trees[None, :, :2]) <= trees[:, 2], axis=1).reshape(states.shape)
    claims = ((states == OPEN, ~below), (states == COVERED, below))
    shares = [float(np.mean(right[claimed])) for claimed, right in claims if claimed.any()]
    seen = np.count_nonzero(states) * cell * cell
    told = f"{seen:.0f} m² seen; right are " + " and ".join(f"{share:.0%}" for share in shares)
    require(all(share >= 0.5 for share in shares), told)
    return told + (" of open and covered cells" if len(shares) == 2 else " of the cells")


def _check_covariances(subject: _Subject) -> str:
    squares: list[float] = []
    for found, gaps in zip(subject.trees, subject.gaps, strict=True):
        nearest = _TREES[int(gaps.argmin())]
        if gaps.min() <= _NEAR:
            error = np.array([[found.tree.x - nearest.x, found.tree.y - nearest.y]])
            squares += squared_distance(error, np.asarray(found.covariance)[None, :2, :2]).tolist()
    return check_nees(squares)


def _check_repeatable(subject: _Subject) -> str:
    trees, ground = subject.fly()
    differs = find_change((trees, ground), (subject.trees, subject.ground), "")
    require(not differs, "another instance maps otherwise from the same frames")
    return "equal on another instance"


def _check_time(subject: _Subject) -> str:
    seconds = timeit.timeit(subject.fly, number=1)
    return describe_time([seconds / len(_PATH)], "a frame of 128 x 128 pixels")


_CHECKS = {
    "map": _check_map,
    "trees": _check_trees,
    "no trees": _check_empty,
    "ground": _check_ground,
    "covariances": _check_covariances,
    "same frames, same result": _check_repeatable,
    "time": _check_time,
}
