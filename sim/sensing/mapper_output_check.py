"""Validates the maps of plug-in mappers for trackers, planners and recordings."""

from dataclasses import astuple

import numpy as np

from tracking.geometry.visibility import Tree
from tracking.mapping.mapper import COVERED, OPEN, UNSEEN, MappedTree, SeenGround
from tracking.plugins.plugin_error import Unusable, plugin_call
from tracking.plugins.result_check import Form, check_kind

_FORMS = {
    "sizes": Form(
        (6,), farthest=1e6, unit="m"
    ),  # the fields of a `Tree` but for its leaves, as mapped trees are opaque
    "covariances": Form((5, 5), definite=True, unit="m²"),
    "existence": Form(),
    "rim": Form(),
}
_MOST_TREES, _MOST_CELLS = 100_000, 10_000_000


def read_map(mapper: object) -> tuple[tuple[MappedTree, ...], SeenGround]:
    """Trees and ground of a plug-in mapper; PluginError if they cannot be used."""
    with plugin_call(mapper, "trees"):
        trees = check_trees(mapper.trees())  # type: ignore[attr-defined]
    with plugin_call(mapper, "ground"):
        return trees, check_ground(mapper.ground())  # type: ignore[attr-defined]


def check_trees(given: object) -> tuple[MappedTree, ...]:
    """New trees with numbers that can be used; `Unusable` says what is wrong."""
    if not isinstance(given, (tuple, list)):
        raise Unusable(f"trees are no tuple or list but of type {type(given).__name__}")
    if len(given) > _MOST_TREES:
        raise Unusable(f"{len(given)} trees are more than {_MOST_TREES}")
    for tree in given:
        check_kind("a tree", tree, MappedTree)
        check_kind("its tree", tree.tree, Tree)
    rows = {
        "sizes": [astuple(each.tree)[:6] for each in given],
        "covariances": [each.covariance for each in given],
        "existence": [each.existence for each in given],
        "rim": [each.rim for each in given],
    }
    empty = {name: np.zeros((0, *form.axes)) for name, form in _FORMS.items()}
    found = {name: form.check(name, rows[name] or empty[name], len(given)) for name, form in _FORMS.items()}
    sizes, existence, rims = found["sizes"], found["existence"], found["rim"]
    if np.any(sizes[:, 2] <= 0.0) or np.any(sizes[:, 5] < 0.0):
        raise Unusable("trees have no radius above 0, or a trunk with one below 0")
    if np.any(sizes[:, 3] < 0.0) or np.any(sizes[:, 3] > sizes[:, 4]):
        raise Unusable("trees have a base below 0 or above the top")
    if np.any((existence < 0.0) | (existence > 1.0) | (rims < 0.0) | (rims > 1.0)):
        raise Unusable("existence and rim are not from 0 to 1")
    parts = zip(sizes.tolist(), found["covariances"], existence.tolist(), rims.tolist(), strict=True)
    return tuple(MappedTree(Tree(*size), covariance, likely, rim) for size, covariance, likely, rim in parts)


def check_ground(given: object) -> SeenGround:
    """New ground with states that there are; `Unusable` says what is wrong."""
    check_kind("ground", given, SeenGround)
    assert isinstance(given, SeenGround)
    states = np.asarray(given.states)
    whole = states.ndim == 2 and states.dtype.kind in "iu" and states.size <= _MOST_CELLS
    if not whole or states.min(initial=UNSEEN) < UNSEEN or states.max(initial=OPEN) > COVERED:
        raise Unusable(f"states are no table of 0, 1 and 2, of at most {_MOST_CELLS} cells")
    place = Form((3,), farthest=1e6, unit="m").check("corner and cell", [*given.corner, given.cell])
    west, south, cell = place.tolist()
    if not cell > 0.0:
        raise Unusable(f"cell is {cell}, not above 0 m")
    return SeenGround((west, south), cell, states.astype(np.uint8))
