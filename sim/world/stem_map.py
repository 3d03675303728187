"""Stem maps: trees at given places, as forest inventories list them in CSV files."""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sim.scenario.csv_tables import RowErrors, TableRow, read_csv
from sim.scenario.environment import MOST_LEAVES, STANDS, Trees
from sim.scenario.scenario import Scenario
from sim.world.trajectories import Trajectories
from tracking.errors import InputError, spell
from tracking.geometry.visibility import Forest, Tree
from tracking.numerics.arrays import Array

MAX_STEMS = 100_000
# Columns of exported trees: the fields of `Tree` with their units. The last is there if any canopy is porous, and empty
# for opaque ones.
TREE_COLUMNS = tuple(f"{f.name}_{'m2_per_m3' if f.name == 'leaf_area_density' else 'm'}" for f in fields(Tree))
_SIZES = ("crown_radius", "crown_base", "height", "trunk_radius", "dbh")
_COLUMNS = ("x", "y", *_SIZES, "leaf_area_density")
_CANOPY = {"canopy_radius": "crown_radius", "canopy_base": "crown_base", "canopy_top": "height"}
# Other names of the columns, such as those of `trees.csv` by `export --to csv`.
_ALIASES = {
    **{column.upper(): column for column in _COLUMNS},
    **_CANOPY,
    **{f"{name}_m": column for name, column in {**{c: c for c in _COLUMNS[:-2]}, **_CANOPY}.items()},
    **{"dbh_cm": "dbh", "leaf_area_density_m2_per_m3": "leaf_area_density"},
}
# Unit, how many of it make a metre, and the most that is allowed, of what is not in m.
_UNITS = {"dbh": ("cm", 100.0, 20_000.0), "leaf_area_density": ("m²/m³", 1.0, MOST_LEAVES)}
_SAME_PLACE = 0.01  # m, distance below which two rows are the same stem


@dataclass(frozen=True, eq=False)
class StemMap:
    """Trees of a stem map in the order of its rows."""

    trees: tuple[Tree, ...]
    rows: tuple[TableRow, ...]  # that of each tree
    unused: tuple[str, ...]  # columns that are not used, such as the species

    @property
    def places(self) -> Array:
        """Positions (T, 2) m of the stems."""
        return np.array([(tree.x, tree.y) for tree in self.trees], dtype=float).reshape(-1, 2)


def read_stem_map(path: Path, field: str, missing: Trees, least: float = 0.01) -> StemMap:
    """Read a stem map with the columns x and y [m], and maybe others for sizes; `missing` gives sizes that are missing.

    Sizes are crown_radius, crown_base, height and trunk_radius, of at least `least` m; or dbh, the diameter at breast
    height [cm], in place of trunk_radius; leaf_area_density [m²/m³] makes a crown porous. `missing.origin` is
    subtracted from positions. InputError begins with `field` and names file, line and column of a wrong entry, also
    that of a second stem at the same place.
    """
    rows: list[TableRow] = []
    trees: list[Tree] = []
    errors = RowErrors(f"{field}: {path}")
    for row in read_csv(path, field, ("x", "y"), _ALIASES):
        if len(rows) == MAX_STEMS:
            raise InputError(f"{row.where}: has more than the {MAX_STEMS} trees that are allowed")
        rows.append(row)
        with errors.collect():
            trees.append(_make_tree(row, missing, least))
    errors.raise_all()
    unused = [name for name in rows[0].values if name and name not in _COLUMNS] if rows else []
    found = StemMap(tuple(trees), tuple(rows), tuple(unused))
    same = cKDTree(found.places).query_pairs(_SAME_PLACE)
    if same:
        first, second = min(same, key=lambda pair: pair[1])
        raise rows[second].error("x", f"the stem of line {rows[first].line} stands at the same place")
    return found


def find_unused_columns(trees: Trees) -> list[str]:
    """A remark on columns of the scenario's stem map that are not used; InputError as from `read_stem_map`."""
    if trees.stem_map is None or trees.file in STANDS:  # who takes a packaged stand need not know its columns
        return []
    unused = read_stem_map(trees.stem_map, "trees.file", trees).unused
    return [f"trees.file: not used: column{'s' * (len(unused) > 1)} {', '.join(unused)}"] if unused else []


def _make_tree(row: TableRow, missing: Trees, least: float) -> Tree:
    sizes = {name: _read_size(row, name, least) for name in _SIZES}
    if sizes["trunk_radius"] is None and sizes["dbh"] is not None:
        sizes["trunk_radius"] = sizes["dbh"] / 200  # from a diameter in cm
    given = (sizes["crown_radius"], sizes["crown_base"], sizes["height"], sizes["trunk_radius"])
    usual = (missing.canopy_radius, missing.canopy_base, missing.canopy_top, missing.trunk_radius)
    radius, base, top, trunk = (other if size is None else size for size, other in zip(given, usual, strict=True))
    if base > top or (base == top and least > 0):
        column = "height" if sizes["crown_base"] is None else "crown_base"
        raise row.error(
            column, f"the crown begins at {base:g} m and ends at {top:g} m; missing sizes are the scenario's"
        )
    x, y = row.number("x") - missing.origin[0], row.number("y") - missing.origin[1]
    density = _read_size(row, "leaf_area_density", 0.0)
    return Tree(x, y, radius, base, top, trunk, missing.leaf_area if density is None else density)


def _read_size(row: TableRow, name: str, least: float) -> float | None:
    """A size, with the units of `_UNITS`; None if it is missing."""
    size = row.optional_number(name)
    unit, factor, most = _UNITS.get(name, ("m", 1.0, 200.0))
    if size is not None and not least * factor <= size <= most:
        raise row.error(name, f"{spell(size)} {unit} is not allowed; expected {least * factor:g} to {most:g}")
    return size


def plant(scenario: Scenario, recorded: Trajectories | None) -> Forest:
    """The forest of the scenario's stem map.

    recorded: people's trajectories from a file, through which no trunk may stand. InputError names the row of a stem
    outside the area, a crown that is not far enough below every UAV, or a trunk on somebody's path.
    """
    path = scenario.trees.stem_map
    assert path is not None
    found = read_stem_map(path, "trees.file", scenario.trees)
    _check_places(found, scenario)
    _check_heights(found, scenario)
    if recorded is not None:
        _check_paths(found, recorded)
    return Forest(found.trees)


def _check_places(found: StemMap, scenario: Scenario) -> None:
    half = np.array([scenario.area.width, scenario.area.height]) / 2
    outside = np.abs(found.places) > half
    if not outside.any():
        return
    k, axis = np.argwhere(outside)[0]
    low, high = found.places.min(axis=0), found.places.max(axis=0)
    x, y = (low + high) / 2 + scenario.trees.origin
    width, height = np.ceil(high - low)
    place = f"{spell(found.places[k, axis])} m from the centre is outside the area, {-half[axis]:g} to {half[axis]:g} m"
    fit = f"all stems fit into an area of {width:.0f} x {height:.0f} m with trees.origin = [{spell(x)}, {spell(y)}]"
    raise found.rows[k].error("xy"[axis], f"{place}; {fit}")


def _check_heights(found: StemMap, scenario: Scenario) -> None:
    if not found.trees:
        return
    k = max(range(len(found.trees)), key=lambda k: found.trees[k].canopy_top)
    clear = found.trees[k].canopy_top + scenario.least_height_above_canopies
    for i, uav in enumerate(scenario.uavs):
        if uav.altitude <= clear:
            footprint = uav.footprint * clear / uav.altitude
            raise found.rows[k].error(
                "height",
                f"the tallest crown reaches {found.trees[k].canopy_top:g} m, and uavs.{i} is at {uav.altitude:.1f} m; "
                f"above {clear:g} m is allowed, for its fov_deg {uav.fov_deg:g} a footprint above {footprint:.1f} m",
            )


def _check_paths(found: StemMap, recorded: Trajectories) -> None:
    there = ~np.isnan(recorded.positions[..., 0])
    if not there.any() or not found.trees:
        return
    radii = np.array([tree.trunk_radius for tree in found.trees] + [0.0])  # the last one stands for no tree
    # Of overlapping trunks the nearest axis may be that of a thinner one.
    gaps, stems = cKDTree(found.places).query(recorded.positions[there], [1, 2, 3], distance_upper_bound=radii.max())
    inside = gaps < radii[stems]
    if inside.any():
        n, nth = np.argwhere(inside)[0]
        sample, person = np.argwhere(there)[n]
        k = stems[n, nth]
        at = f"person {person} of people.trajectories walks at {recorded.times[sample]:.2f} s"
        raise found.rows[k].error("x", f"a trunk of {radii[k]:g} m radius stands where {at}")
