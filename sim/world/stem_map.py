"""Stem maps: trees at given places, as forest inventories list them in CSV files."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sim.scenario.csv_tables import RowErrors, TableRow, read_csv
from sim.scenario.environment import MOST_LEAVES, STANDS, Trees
from sim.scenario.geo import NOWHERE_ON_THE_MAP, Geo
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
_LENGTHS = ("x", "y", *_SIZES)
_COLUMNS = (*_LENGTHS, "leaf_area_density")
_CANOPY = {"canopy_radius": "crown_radius", "canopy_base": "crown_base", "canopy_top": "height"}
# Other names of the columns, such as those of `trees.csv` by `export --to csv`.
_ALIASES = {
    **{column.upper(): column for column in _COLUMNS},
    **_CANOPY,
    **{f"{name}_m": column for name, column in {**{c: c for c in _LENGTHS[:-1]}, **_CANOPY}.items()},
    **{"dbh_cm": "dbh", "leaf_area_density_m2_per_m3": "leaf_area_density"},
}
_PER_METRE = {"mm": 1000.0, "cm": 100.0, "dm": 10.0, "m": 1.0, "km": 0.001, "ft": 1 / 0.3048, "in": 1 / 0.0254}
_DIAMETERS = {f"{part}_{of}": f"{part}_radius" for part in ("crown", "trunk") for of in ("diameter", "width")}
_NAMES = {
    **{column: column for column in _COLUMNS},
    **_CANOPY,
    **_DIAMETERS,
    **{"canopy_diameter": "crown_radius", "canopy_width": "crown_radius"},
    **{f"{first}{axis}": axis for first in "gp" for axis in "xy"},  # those of ForestGEO
    **{"easting": "x", "northing": "y"},
}
# Names that stand for a column if no other one does; they may end with a unit.
_SPARES = _NAMES | {f"{name}_{unit}": column for name, column in _NAMES.items() for unit in _PER_METRE}
_FORESTGEO = {"hom", "gx", "px", "stemtag", "censusid"}  # columns of its tables, whose diameters are in mm from 10 mm
# Medians [m] and largest values [m] beyond which sizes are far from any forest, and what may have happened.
_USUAL = {
    "trunk radii": (0.005, 0.5, 2.0, "names such as dbh_mm and trunk_diameter_cm give units"),
    "crown radii": (0.2, 12.0, 30.0, "names such as crown_diameter and crown_radius_cm tell diameters and units"),
    "heights": (1.0, 60.0, 116.0, "names such as height_ft and height_cm give units"),
}
_LARGEST = 200.0  # m, of any size
_MOST_WOOD = 500.0  # m²/ha, area of trunks; dense forests have a fifth
_SMALLEST = 1.0  # m, extent of a forest
_SPARSE = 100.0  # m, from one stem to the next
_NARROW = 5.0  # m, least side of the ground of which densities are told
_MANY = 20  # stems from which densities mean something
_DEGREES = "are x and y in degrees? expected metres, such as eastings and northings; x_km and y_km are read, too"
_SAME_PLACE = 0.01  # m, distance below which two rows are the same place
_SHOWN = 20  # places of several stems that one message names


@dataclass(frozen=True, eq=False)
class StemMap:
    """Trees of a stem map in the order of its rows."""

    trees: tuple[Tree, ...]
    rows: tuple[TableRow, ...]  # that of each tree
    summary: str  # what was read, in one line
    remarks: tuple[str, ...]  # what is assumed, far from any forest, or not used

    @property
    def places(self) -> Array:
        """Positions (T, 2) m of the stems."""
        return np.array([(tree.x, tree.y) for tree in self.trees], dtype=float).reshape(-1, 2)


def read_stem_map(
    path: Path, field: str, missing: Trees, least: float = 0.01, geo: Geo = NOWHERE_ON_THE_MAP
) -> StemMap:
    """Read a stem map with the columns x and y [m], and maybe others for sizes; `missing` gives sizes that are missing.

    Sizes are crown_radius, crown_base, height and trunk_radius, of at least `least` m; or dbh, the diameter at breast
    height, in place of trunk_radius; leaf_area_density [m²/m³] makes a crown porous. Names may end with a unit. Without
    one, dbh is in cm unless no forest could have such trunks. `missing.origin` is subtracted from positions; `geo` says
    where the map is, if they are on it. InputError begins with `field` and names file, line and column of a wrong
    entry, also of stems at the same place.
    """
    rows: list[TableRow] = []
    for row in read_csv(path, field, ("x", "y"), _ALIASES, spares=_SPARES, geo=geo):
        if len(rows) == MAX_STEMS:
            raise InputError(f"{row.where}: has more than the {MAX_STEMS} trees that are allowed")
        rows.append(row)
    name = f"{field}: {path}"
    units = {column: _find_unit(rows, column) for column in _LENGTHS}
    doubts = []
    if not units["dbh"]:
        units["dbh"] = unit = _guess_unit_of_diameters(rows, _PER_METRE[units["x"] or "m"])
        if unit != "cm":
            own = rows[0].names.get("dbh", "dbh")
            others = " or ".join(f"dbh_{other}" for other in ("mm", "cm", "m") if other != unit)
            taken = f"is taken to be in {unit}, which its entries fit better than cm"
            doubts.append(f"{name}, column {own}: {taken}; else name it {others}")
    stems: list[Tree] = []
    errors = RowErrors(name)
    for row in rows:
        with errors.collect():
            stems.append(_make_tree(row, missing, least, units))
    errors.raise_all()
    groups = _group_stems(np.array([(tree.x, tree.y) for tree in stems]).reshape(-1, 2), rows, missing, name)
    trees = tuple(_join([stems[k] for k in group]) for group in groups)
    if unused := [own for own in rows[0].values if own and own not in _COLUMNS] if rows else []:
        doubts.append(f"{field}: not used: column{'s' * (len(unused) > 1)} {', '.join(unused)}")
    found = StemMap(trees, tuple(rows[group[0]] for group in groups), "", ())
    return replace(found, summary=_describe(found, rows, units, name), remarks=(*_doubt(found, rows, name), *doubts))


def _find_unit(rows: Sequence[TableRow], column: str) -> str:
    """The unit that the file's own name of a column ends with; empty without one."""
    own = rows[0].names.get(column, "") if rows else ""
    unit = re.split(r"[\W_]+", own.lower().strip(" ()[]"))[-1]
    return unit if unit in _PER_METRE and own.lower() != unit else ""


def _read_numbers(rows: Sequence[TableRow], column: str) -> Array:
    """Entries (R,) of a column; NaN for those that are missing or wrong."""
    found = np.full(len(rows), np.nan)
    for n, row in enumerate(rows):
        with suppress(InputError):
            value = row.optional_number(column)
            found[n] = np.nan if value is None else value
    return found


def _guess_unit_of_diameters(rows: Sequence[TableRow], per_metre: float) -> str:
    """Unit of the column dbh: cm, unless only m or mm give trunks and an area of wood as forests have them.

    per_metre: of the coordinates.
    """
    found = _read_numbers(rows, "dbh")
    found = found[found > 0]
    if not len(found):
        return "cm"
    if np.median(found) < 1.0:
        return "m"
    names = {own.lower() for own in [*rows[0].values, *rows[0].names.values()]}
    # The second largest of a small table, as one entry may be wrong.
    if np.median(found) > 80.0 or np.quantile(found, 0.98, method="lower") > 300.0:
        return "mm"
    if names & _FORESTGEO and found.min() >= 10.0:
        return "mm"
    places = np.column_stack([_read_numbers(rows, axis) / per_metre for axis in "xy"])
    return "mm" if _compute_wood(found / 200, places[~np.isnan(places).any(axis=1)]) > _MOST_WOOD else "cm"


def _compute_wood(radii: Array, places: Array) -> float:
    """Area of trunks [m²/ha] where trees are; 0 for few trees, or along a line."""
    width, height = np.ptp(places, axis=0).tolist() if len(places) >= _MANY else (0.0, 0.0)
    if len(radii) < _MANY or min(width, height) < _NARROW:
        return 0.0
    return float(np.pi * (radii * radii).sum()) / (width * height / 1e4)


def _make_tree(row: TableRow, missing: Trees, least: float, units: Mapping[str, str]) -> Tree:
    sizes = {name: _read_size(row, name, least, units[name]) for name in _SIZES}
    if sizes["trunk_radius"] is None:
        sizes["trunk_radius"] = sizes["dbh"]
    given = (sizes["crown_radius"], sizes["crown_base"], sizes["height"], sizes["trunk_radius"])
    usual = (missing.canopy_radius, missing.canopy_base, missing.canopy_top, missing.trunk_radius)
    radius, base, top, trunk = (other if size is None else size for size, other in zip(given, usual, strict=True))
    if base > top or (base == top and least > 0):
        column = "height" if sizes["crown_base"] is None else "crown_base"
        raise row.error(
            column, f"the crown begins at {base:g} m and ends at {top:g} m; missing sizes are the scenario's"
        )
    x, y = (row.number(axis) / _PER_METRE[units[axis] or "m"] - missing.origin[n] for n, axis in enumerate("xy"))
    leaves = row.optional_number("leaf_area_density")
    if leaves is not None and not 0 <= leaves <= MOST_LEAVES:
        raise row.error("leaf_area_density", f"{spell(leaves)} m²/m³ is not allowed; expected 0 to {MOST_LEAVES:g}")
    return Tree(x, y, radius, base, top, trunk, missing.leaf_area if leaves is None else leaves)


def _read_size(row: TableRow, name: str, least: float, unit: str) -> float | None:
    """A height or radius [m], half of a diameter; None if it is missing."""
    size = row.optional_number(name)
    if size is None:
        return None
    per = _PER_METRE[unit or "m"]
    if not least * per <= size <= _LARGEST * per:
        hint = "" if unit or size < 0 else f"; a name such as {name}_cm gives another unit"
        allowed = f"expected {least * per:g} to {_LARGEST * per:g}{hint}"
        raise row.error(name, f"{spell(size)} {unit or 'm'} is not allowed; {allowed}")
    return size / per / (2.0 if name == "dbh" or _is_diameter(row.names.get(name, "")) else 1.0)


def _is_diameter(own: str) -> bool:
    return re.search("diameter|width", own.lower()) is not None


def _group_stems(places: Array, rows: Sequence[TableRow], missing: Trees, name: str) -> list[list[int]]:
    """Indices of the stems of each tree by their first row; InputError for stems at one place unless they merge."""
    if not len(places):
        return []
    spots, spot = np.unique(places, axis=0, return_inverse=True)
    gaps, near = cKDTree(spots).query(spots, range(1, 9), distance_upper_bound=_SAME_PLACE)
    first = list(range(len(spots)))  # of the spots of a tree, which are joined one by one
    for one, nth in np.argwhere(np.isfinite(gaps)).tolist():
        ends = sorted(_find_first(first, k) for k in (one, int(near[one, nth])))
        first[ends[1]] = ends[0]
    groups: dict[int, list[int]] = {}
    for k, own in enumerate(spot.ravel().tolist()):
        groups.setdefault(_find_first(first, own), []).append(k)
    several = [group for group in groups.values() if len(group) > 1]
    extent = float(np.ptp(places, axis=0).max())
    if several and len(spots) > 2 and extent < _SMALLEST:
        raise InputError(f"{name}: all stems are within {spell(extent, 2)} m; {_DEGREES}")
    if several and missing.same_place == "refuse":
        shown = ["lines " + ", ".join(str(rows[k].line) for k in group) for group in several[:_SHOWN]]
        more = [f"{len(several) - _SHOWN} more places"] * (len(several) > _SHOWN)
        merged = 'trees.same_place = "merge" makes them stems of one tree'
        raise InputError(f"{name}: stems stand at the same place: {'; '.join([*shown, *more])}; {merged}")
    return list(groups.values())


def _find_first(first: Sequence[int], k: int) -> int:
    while first[k] != k:
        k = first[k]
    return k


def _join(stems: Sequence[Tree]) -> Tree:
    """One tree where the first of the stems is, with the area of all trunks and the largest of each size."""
    if len(stems) == 1:
        return stems[0]
    trunk = math.sqrt(math.fsum(stem.trunk_radius * stem.trunk_radius for stem in stems))
    radius, top = max(stem.canopy_radius for stem in stems), max(stem.canopy_top for stem in stems)
    base = min(stem.canopy_base for stem in stems)
    return replace(stems[0], canopy_radius=radius, canopy_base=base, canopy_top=top, trunk_radius=trunk)


def _describe(found: StemMap, rows: Sequence[TableRow], units: Mapping[str, str], name: str) -> str:
    """Number of trees, the span of their sizes, and how many of them are in the file, in one line."""
    if not found.trees:
        return f"{name}: 0 trees"
    count = len(found.trees)
    width, height = np.ptp(found.places, axis=0)
    stems = f" of {len(rows)} stems" if len(rows) > count else ""
    parts = [f"{count} tree{'s' * (count != 1)}{stems} on {width:.0f} × {height:.0f} m"]
    absent = []
    for what, (columns, values) in _list_sizes(found).items():
        sources = []
        left = np.ones(len(rows), dtype=np.bool_)
        for column in columns:
            given = left & ~np.isnan(_read_numbers(rows, column))
            left &= ~given
            if given.any():
                unit = "" if _find_unit(rows, column) else f" in {units[column] or 'm'}"
                sources.append(f"{given.sum()} from {rows[0].names.get(column, column)}{unit}")
        if not sources:
            absent.append(what)
            continue
        sources += [f"{left.sum()} not in the file"] * bool(left.any())
        low, middle, high = np.quantile(values, [0.0, 0.5, 1.0]).tolist()
        span = (
            f"{spell(low, 3)} to {spell(high, 3)} m, {spell(middle, 3)} m in the median"
            if low < high
            else f"{spell(low, 3)} m"
        )
        parts.append(f"{what} of {span} ({', '.join(sources)})")
    parts += [f"{', '.join(absent)} not in the file"] * bool(absent)
    return f"{name}: {'; '.join(parts)}"


def _list_sizes(found: StemMap) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Columns and values (T,) m of what is told of trees, by its name."""
    return {
        "trunk radii": (("trunk_radius", "dbh"), np.array([tree.trunk_radius for tree in found.trees])),
        "crown radii": (("crown_radius",), np.array([tree.canopy_radius for tree in found.trees])),
        "heights": (("height",), np.array([tree.canopy_top for tree in found.trees])),
    }


def _doubt(found: StemMap, rows: Sequence[TableRow], name: str) -> Iterator[str]:
    """What is far from any forest."""
    if not found.trees:
        return
    for what, (columns, values) in _list_sizes(found).items():
        low, high, most, hint = _USUAL[what]
        usual = float(np.median(values))
        if not any(column in rows[0].values for column in columns):
            continue
        if not low <= usual <= high:
            forests = f"forests have {low:g} to {high:g} m"
            yield f"{name}: {what} are {spell(usual, 3)} m in the median, but {forests}; {hint}"
        elif values.max() > most:
            yield f"{name}: {what} reach {spell(values.max(), 3)} m, but no tree has more than {most:g} m; {hint}"
        elif columns[-1] == "dbh" and _compute_wood(values, found.places) > _MOST_WOOD:
            wood = spell(_compute_wood(values, found.places), 3)
            yield f"{name}: trunks have {wood} m² in a hectare, but no forest has {_MOST_WOOD:g}; {hint}"
    extent = float(np.ptp(found.places, axis=0).max())
    if len(found.trees) > 2 and extent < _SMALLEST:
        yield f"{name}: all stems are within {spell(extent, 2)} m; {_DEGREES}"
    if len(found.trees) >= _MANY:
        gap = float(np.median(cKDTree(found.places).query(found.places, 2)[0][:, 1]))
        if gap > _SPARSE:
            yield f"{name}: the next stem is {spell(gap, 3)} m away in the median; x_cm and y_cm give units"


def _read_map(trees: Trees, geo: Geo) -> StemMap:
    """The scenario's stem map, which has trees."""
    assert trees.stem_map is not None
    found = read_stem_map(trees.stem_map, "trees.file", trees, geo=geo)
    if not found.trees:
        none = "has no rows below the names of its columns; trees.density = 0 in its place means no trees"
        raise InputError(f"trees.file: {trees.stem_map}: {none}")
    return found


def describe_stem_map(trees: Trees, geo: Geo) -> tuple[str, list[str]]:
    """What the scenario's stem map holds, in one line, and remarks on what is assumed, odd or not used.

    Both are empty without a stem map, and for packaged ones. InputError as from `read_stem_map`, or without trees.
    """
    if trees.stem_map is None or trees.file in STANDS:
        return "", []
    found = _read_map(trees, geo)
    return found.summary, list(found.remarks)


def plant(scenario: Scenario, recorded: Trajectories | None) -> Forest:
    """The forest of the scenario's stem map.

    recorded: people's trajectories from a file, through which no trunk may stand. InputError names the row of a stem
    outside the area, a crown that is not far enough below every UAV, or a trunk on somebody's path.
    """
    found = _read_map(scenario.trees, scenario.geo)
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
    if not there.any():
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
