"""Stem maps: trees at given places, as forest inventories list them in CSV files or GeoJSON."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from sim.scenario.csv_tables import MOST_BYTES, RowErrors, TableRow, read_csv, translate_names
from sim.scenario.environment import MOST_LEAVES, STANDS, Trees
from sim.scenario.geo import NOWHERE_ON_THE_MAP, Geo
from sim.scenario.map_features import SUFFIXES
from sim.scenario.scenario import Scenario
from sim.scenario.text_files import read_text
from sim.world.crown_polygons import OUTLINES, read_features
from sim.world.forest import CROWN_SHARE, crown_radius
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
    **{f"{of}{name}": axis for name, axis in {"easting": "x", "northing": "y"}.items() for of in ("", "adj", "utm_")},
    **{f"{axis}_{of}": axis for axis in "xy" for of in ("coord", "utm", "tree")},
    **{f"{of}_{axis}": axis for axis in "xy" for of in ("coord", "utm")},
    **dict.fromkeys(("tree_height", "treeheight", "total_height", "height_total", "ht", "h"), "height"),
    **dict.fromkeys(("crown_base_height", "height_to_crown_base", "hcb", "hbase", "basecrownheight"), "crown_base"),
    **dict.fromkeys(("crowndiameter", "maxcrowndiameter"), "crown_radius"),
    **dict.fromkeys(("diameter", "stem_diameter", "stemdiameter", "diameter_at_breast_height", "bhd", "d130"), "dbh"),
    **dict.fromkeys(("dfstatus", "tree_status", "treestatus", "stem_status", "plantstatus", "plant_status"), "status"),
    **{name: name for name in ("status", "alive", "dead", "fallen")},
    **{f"is_{name}": name for name in ("alive", "dead", "fallen")},
}
# Names that stand for a column if no other one does; they may end with a unit.
_SPARES = _NAMES | {f"{name}_{unit}": column for name, column in _NAMES.items() for unit in _PER_METRE}
# Columns that name a tree, and a census.
_TREES = ("treeid", "tree_id", "id_tree", "tree_tag", "treetag", "tag", "tree_no", "tree_number", "individualid")
_CENSUSES = ("censusid", "census")
_ONE_TREE = 2.0  # m, farthest place of a stem from the first one of the same tree
_FALLEN = "fall|fell|down|lying|uproot|windthr|stump|cut|harvest|remov|missing|lost|gone"
_STATUS = {_FALLEN: "fallen", "dead|died|snag|mort": "dead", "aliv|live|living|health|stand|broken": "alive"}
_CODES = {"a": "alive", "l": "alive", "d": "dead", "m": "fallen", "g": "fallen", "p": "fallen"}  # of ForestGEO
_YES, _NO = ("1", "1.0", "true", "yes", "y", "t"), ("", "na", "0", "0.0", "false", "no", "n", "f")
_FORESTGEO = {"hom", "gx", "px", "stemtag", "censusid"}  # columns of its tables, whose diameters are in mm from 10 mm
_TALLEST = 116.0  # m, of trees
# Medians [m] and largest values [m] beyond which sizes are far from any forest, and what may have happened.
_USUAL = {
    "trunk radii": (0.005, 0.5, 2.0, "names such as dbh_mm and trunk_diameter_cm give units"),
    "crown radii": (0.2, 12.0, 30.0, "names such as crown_diameter and crown_radius_cm tell diameters and units"),
    "heights": (1.0, 60.0, _TALLEST, "names such as height_ft and height_cm give units"),
}
_HIGH, _SLENDER = 10.0, 150  # m, height from which trees are at most so many times as high as thick
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

    A crown of which nothing is told has the radius and the base of random trees of its own height and diameter, unless
    `missing` has others than by default. A GeoJSON file has points, or crowns, which become circles of equal area.
    Sizes are crown_radius, crown_base, height and trunk_radius, of at least `least` m; or dbh, the diameter at breast
    height, in place of trunk_radius; leaf_area_density [m²/m³] makes a crown porous. Names may end with a unit. Without
    one, dbh is in cm unless no forest could have such trunks. `missing.origin` is subtracted from positions; `geo` says
    where the map is, if they are on it. InputError begins with `field` and names file, line and column of a wrong
    entry, also of stems at the same place.
    """
    name = f"{field}: {path}"
    rows, doubts = _read_rows(path, field, geo)
    rows, left_out = _leave_out(rows, missing, name)
    units = {column: _find_unit(rows, column) for column in _LENGTHS}
    doubts += left_out
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
        row.check_origin("trees.origin", missing.origin)
        with errors.collect():
            stems.append(_make_tree(row, missing, least, units))
    errors.raise_all()
    known = _find_column(rows, _TREES)
    groups = _group_stems(np.array([(tree.x, tree.y) for tree in stems]).reshape(-1, 2), rows, known, missing, name)
    trees = tuple(_join([stems[k] for k in group]) for group in groups)
    joined = len(groups) < len(rows)
    read = (*_COLUMNS, "status", "alive", "dead", "fallen", *[known] * joined)
    if unused := [own for own in rows[0].values if own and own not in read] if rows else []:
        doubts.append(f"{field}: not used: column{'s' * (len(unused) > 1)} {', '.join(unused)}")
    found = StemMap(trees, tuple(rows[group[0]] for group in groups), "", ())
    return replace(
        found, summary=_describe(found, rows, units, missing, name), remarks=(*_doubt(found, rows, name), *doubts)
    )


def _read_rows(path: Path, field: str, geo: Geo) -> tuple[list[TableRow], list[str]]:
    """The rows of a stem map, and a remark on crowns that are polygons."""
    name, doubts = f"{field}: {path}", []
    if path.suffix.lower() in SUFFIXES:
        text = read_text(path, field, MOST_BYTES)
        rows, differences = read_features(text, name, lambda own: translate_names(own, _ALIASES, _SPARES), geo)
        if differences:
            usual, most = (f"{100 * share:.0f} %" for share in (np.median(differences), max(differences)))
            circles = "crowns are circles with the areas of their polygons"
            doubts.append(f"{name}: {circles}, from which {usual} of the area differ in the median, {most} at most")
    else:
        rows = []
        for row in read_csv(path, field, ("x", "y"), _ALIASES, spares=_SPARES, geo=geo):
            rows.append(row)
            if len(rows) > MAX_STEMS:
                break
    if len(rows) > MAX_STEMS:
        raise InputError(f"{rows[MAX_STEMS].where}: has more than the {MAX_STEMS} trees that are allowed")
    return rows, doubts


def _leave_out(rows: Sequence[TableRow], missing: Trees, name: str) -> tuple[list[TableRow], list[str]]:
    """The rows of trees that `missing.status` asks for, and a remark on dead and fallen ones."""
    errors = RowErrors(name)
    found = []
    for row in rows:
        with errors.collect():
            found.append(_read_status(row, strict=missing.status != "any"))
    errors.raise_all()
    left = {"any": (), "standing": ("fallen",), "alive": ("dead", "fallen")}[missing.status]
    counts = [f"{found.count(what)} {what}" for what in ("dead", "fallen") if what in found]
    if not counts:
        return list(rows), []
    kept = [row for row, status in zip(rows, found, strict=True) if status not in left]
    told = (
        f"{len(rows) - len(kept)} left out"
        if left
        else 'all stay; trees.status = "standing" or "alive" leaves them out'
    )
    return kept, [f"{name}: {' and '.join(counts)} of {len(rows)} stems; {told}"]


def _read_status(row: TableRow, *, strict: bool) -> str:
    """alive, dead or fallen; empty if it is missing, or unknown unless `strict`."""
    for column in ("fallen", "dead", "alive"):
        given = row.values.get(column, "").lower()
        if given in _YES:
            return column
        if column == "alive" and column in row.values and given in _NO[2:]:
            return "dead"
        if given not in _NO and strict:
            raise row.error(column, f"{given!r} is not allowed; expected yes or no, or 1 or 0")
    text = row.values.get("status", "").lower()
    found = next((status for words, status in _STATUS.items() if re.search(words, text)), _CODES.get(text, ""))
    if strict and text.upper() not in ("", "NA") and not found:
        known = f"words such as alive, dead and fallen, or {', '.join(_CODES).upper()} of ForestGEO"
        raise row.error("status", f"{text!r} is unknown; expected {known}")
    return found


def _find_column(rows: Sequence[TableRow], names: Sequence[str]) -> str:
    """The first of some columns that a file has, in its own spelling; empty if it has none."""
    own = {re.sub(r"[\W_]+", "_", column.lower()): column for column in (rows[0].values if rows else ())}
    return next((own[name] for name in names if name in own), "")


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
    outlined = row.names.get("crown_radius") == OUTLINES
    usual = (*_grow(sizes, missing, outlined=outlined), missing.canopy_top, missing.trunk_radius)
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


def _grow(sizes: Mapping[str, float | None], missing: Trees, *, outlined: bool) -> tuple[float, float]:
    """Radius and base [m] of a crown as far as they are missing; outlined: whether its radius is that of a polygon."""
    radius, base, height = missing.canopy_radius, missing.canopy_base, sizes["height"]
    if height is None:
        return radius, base
    unknown = sizes["crown_radius"] is None
    if unknown and radius == Trees().canopy_radius and height > 0.0:  # no wider than high, as of a broken tree
        trunk = sizes["trunk_radius"] or None
        radius = max(trunk or 0.0, min(height, crown_radius(min(height, _TALLEST), trunk)))
    if ((unknown or outlined) and base == Trees().canopy_base) or base >= height:
        base = height * (1 - CROWN_SHARE)
    return radius, base


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


def _group_stems(places: Array, rows: Sequence[TableRow], known: str, missing: Trees, name: str) -> list[list[int]]:
    """Indices of the stems of each tree by their first row; InputError for stems at one place unless they merge.

    known: column with names of trees, whose stems merge; empty without one.
    """
    if not len(places):
        return []
    spots, spot = np.unique(places, axis=0, return_inverse=True)
    gaps, near = cKDTree(spots).query(spots, range(1, 9), distance_upper_bound=_SAME_PLACE)
    first = list(range(len(spots)))  # of the spots of a tree, which are joined one by one
    for one, nth in np.argwhere(np.isfinite(gaps)).tolist():
        ends = sorted(_find_first(first, k) for k in (one, int(near[one, nth])))
        first[ends[1]] = ends[0]
    trees: dict[str, int] = {}  # first stem of each tree by its name
    for k, row in enumerate(rows if known else ()):
        one = trees.setdefault(row.optional_text(known) or f"row {k}", k)
        east, north = (places[k] - places[one]).tolist()
        if k != one and east * east + north * north <= _ONE_TREE * _ONE_TREE:
            ends = sorted(_find_first(first, int(spot.ravel()[n])) for n in (one, k))
            first[ends[1]] = ends[0]
    groups: dict[int, list[int]] = {}
    for k, own in enumerate(spot.ravel().tolist()):
        groups.setdefault(_find_first(first, own), []).append(k)
    several = [group for group in groups.values() if len(group) > 1]
    extent = float(np.ptp(places, axis=0).max())
    if several and len(spots) > 2 and extent < _SMALLEST:
        raise InputError(f"{name}: all stems are within {spell(extent, 2)} m; {_DEGREES}")
    census = _find_column(rows, _CENSUSES)
    if wrong := next((g for g in several if census and len({rows[k].values[census] for k in g}) > 1), None):
        lines = ", ".join(str(rows[k].line) for k in wrong)
        raise InputError(f"{name}: lines {lines} are of one tree in several censuses; keep the rows of one {census}")
    several = [g for g in several if not known or len({rows[k].optional_text(known) or k for k in g}) > 1]
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


def _describe(found: StemMap, rows: Sequence[TableRow], units: Mapping[str, str], missing: Trees, name: str) -> str:
    """Number of trees, the span of their sizes, and how many of them are in the file, in one line."""
    if not found.trees:
        return f"{name}: 0 trees"
    count = len(found.trees)
    width, height = np.ptp(found.places, axis=0)
    stems = f" of {len(rows)} stems" if len(rows) > count else ""
    parts = [f"{count} tree{'s' * (count != 1)}{stems} on {width:.0f} × {height:.0f} m"]
    absent = []
    grown = ~np.isnan(_read_numbers(rows, "height")) & np.isnan(_read_numbers(rows, "crown_radius"))
    grown &= missing.canopy_radius == Trees().canopy_radius
    for what, (columns, values) in _list_sizes(found).items():
        sources = []
        left = np.ones(len(rows), dtype=np.bool_)
        for column in columns:
            given = left & ~np.isnan(_read_numbers(rows, column))
            left &= ~given
            if given.any():
                unit = "" if _find_unit(rows, column) else f" in {units[column] or 'm'}"
                sources.append(f"{given.sum()} from {rows[0].names.get(column, column)}{unit}")
        if what == "crown radii" and grown.any():
            left &= ~grown
            sources.append(f"{grown.sum()} from heights and diameters by allometry")
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
    bases = np.isnan(_read_numbers(found.rows, "crown_base")) & ~np.isnan(_read_numbers(found.rows, "height"))
    tops = np.array([tree.canopy_top for tree in found.trees])
    halves = int(np.sum(bases & (np.array([tree.canopy_base for tree in found.trees]) == tops * (1 - CROWN_SHARE))))
    parts += [f"{halves} crown{'s' * (halves > 1)} in the upper half of the height"] * bool(halves and grown.any())
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
    yield from _doubt_slender_trees(found, rows, name)
    extent = float(np.ptp(found.places, axis=0).max())
    if len(found.trees) > 2 and extent < _SMALLEST:
        yield f"{name}: all stems are within {spell(extent, 2)} m; {_DEGREES}"
    if len(found.trees) >= _MANY:
        gap = float(np.median(cKDTree(found.places).query(found.places, 2)[0][:, 1]))
        if gap > _SPARSE:
            yield f"{name}: the next stem is {spell(gap, 3)} m away in the median; x_cm and y_cm give units"


def _doubt_slender_trees(found: StemMap, rows: Sequence[TableRow], name: str) -> Iterator[str]:
    """That heights are far too large for the diameters, as in feet."""
    if "height" not in rows[0].values or not {"trunk_radius", "dbh"} & {*rows[0].values}:
        return
    ratios = [tree.canopy_top / tree.trunk_radius / 2 for tree in found.trees if tree.canopy_top > _HIGH]
    if ratios and np.median(ratios) > _SLENDER:
        usual = f"{spell(float(np.median(ratios)), 3)} times as high as thick in the median"
        yield f"{name}: trees are {usual}, but forests have 30 to {_SLENDER}; {_USUAL['heights'][-1]}"


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
    key, middle = "trees.origin", (low + high) / 2 + scenario.trees.origin
    if found.rows[k].on_map:
        key, middle = "geo.origin", scenario.geo.find_degrees(middle[None])[0].round(6)
    width, height = np.ceil(high - low)
    place = f"{spell(found.places[k, axis])} m from the centre is outside the area, {-half[axis]:g} to {half[axis]:g} m"
    centre = ", ".join(map(spell, middle.tolist()))
    fit = f"all stems fit into an area of {width:.0f} x {height:.0f} m with {key} = [{centre}]"
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
