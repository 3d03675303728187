"""Maps of the forest that UAVs believed, as the tables of a recording."""

from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

import numpy as np

from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import Forest, Occlusion, Tree
from tracking.numerics.arrays import Array


def encode_maps(forests: Sequence[Forest], uavs: int) -> dict[str, Any]:
    """The fields `MAPS` of a recording, from what UAVs believed, scan by scan; none if all believed one given map."""
    contents = {forest: _find_content(forest) for forest in dict.fromkeys(forests)}
    distinct = dict(zip(contents.values(), contents, strict=True))  # copies of a mission have copies of its map
    rasters = [forest.unknown for forest in distinct.values() if isinstance(forest.unknown, Raster)]
    if len(distinct) == 1 and not rasters:
        return {}
    numbers = {content: n for n, content in enumerate(distinct)}
    tables = [_list_trees(forest) for forest in distinct.values()]
    shape = rasters[0].values.shape if rasters else (1, 1)
    return {
        "maps": np.array([numbers[contents[forest]] for forest in forests], dtype=np.int64).reshape(-1, uavs),
        "map_sizes": np.array([len(table) for table in tables], dtype=np.int64),
        "map_trees": np.concatenate(tables),
        "map_unknown": np.stack([_find_values(forest, shape) for forest in distinct.values()]),
    }


def _find_content(forest: Forest) -> tuple[Any, ...]:
    """What two equal maps have in common."""
    unknown = forest.unknown.values.tobytes() if isinstance(forest.unknown, Raster) else forest.unknown
    return forest.trees, forest.occlusion, forest.deviation, forest.unknown_tree, unknown


def _list_trees(forest: Forest) -> Array:
    """The rows (R, 8) of `map_trees`."""
    deviations = np.broadcast_to(forest.deviation, len(forest.trees)).tolist()
    rows = [(*astuple(tree), deviation) for tree, deviation in zip(forest.trees, deviations, strict=True)]
    size = [(*astuple(forest.unknown_tree), np.inf)] if forest.unknown_tree else []
    return np.array(rows + size, dtype=float).reshape(-1, 8)


def _find_values(forest: Forest, shape: tuple[int, ...]) -> Array:
    return forest.unknown.values if isinstance(forest.unknown, Raster) else np.full(shape, forest.unknown)


def decode_map(rows: Array, unknown: Array, area: tuple[float, float], occlusion: Occlusion) -> Forest:
    """The map with these rows of `map_trees` and this raster over the area of width and height [m]."""
    trees, known = [Tree(*row[:7]) for row in rows.tolist()], np.isfinite(rows[:, 7])
    deviations = tuple(rows[known, 7].tolist())
    return Forest(
        tuple(tree for tree, is_known in zip(trees, known.tolist(), strict=True) if is_known),
        occlusion,
        deviations if any(deviations) else 0.0,
        Raster.over(area, unknown) if unknown.any() else 0.0,
        None if known.all() else trees[-1],
    )
