"""Cells of a study: all combinations of its scenarios, levels of factors and planners."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from planning.planner_loading import add_options, split_options
from sim.scenario.overrides import parse_value
from sim.scenario.quantities import parse_integers
from sim.scenario.settings_text import flatten, format_settings, format_value
from sim.study.definition import Study, overlap
from tracking.errors import InputError, spell

TRACKER = "tracker"
VIEW = "view"  # factor that only trials of the bound have
_UNLIMITED = {"sensing.mode": "ideal", "sensing.field_of_view": "unlimited"}  # their settings
COMPARED_FACTORS = (TRACKER, VIEW)  # factors whose levels are compared as planners are
_MOST_CELLS = 10_000
# Keys, or their tables, of what a fleet meets and nobody chooses.
_GIVEN = (
    *("area", "trees", "people", "wind", "appearance", "sensing.mode", "sensing.occlusion", "sensing.noise"),
    *("sensing.false_alarms", "sensing.miss_probability", "uavs.*.fails_at", "uavs.*.navigation"),
    *(f"network.{key}" for key in ("loss", "links", "cuts", "range", "rate", "delay", "jitter")),
)


class StudyTable(NamedTuple):
    """Settings that one table of a study makes."""

    name: str  # name of the table; empty for settings from outside of the study's file
    settings: dict[str, str]  # overrides of the scenario
    options: dict[str, str]  # options of planners


Levels = tuple[tuple[str, str], ...]  # factors, each with one of its levels


class Cell(Struct, frozen=True):
    """One scenario with one level of each factor, and one planner."""

    scenario: str
    factors: Levels
    tables: tuple[StudyTable, ...]  # later ones take precedence
    planner: str  # as in `Study.planners`

    @property
    def settings(self) -> dict[str, str]:
        """Overrides of the scenario by all tables; of factors, whole lists come before entries in them."""
        found = {key: value for table in self.tables for key, value in table.settings.items()}
        varied = {key for table in self.tables if table.name.startswith("factors.") for key in table.settings}
        return dict(sorted(found.items(), key=lambda item: item[0].count(".") if item[0] in varied else -1))

    @property
    def spec(self) -> str:
        """The planner with the options of all tables."""
        return add_options(self.planner, {key: text for table in self.tables for key, text in table.options.items()})


def list_cells(study: Study) -> list[Cell]:
    """All cells of a study, in order; InputError if there are none."""
    _check_levels(study)
    planners = dict.fromkeys([*study.planners, *([study.score.floor] if study.score else [])])
    count = math.prod([len(study.scenarios), len(planners) + bool(study.score), *map(len, study.factors.values())])
    if count > _MOST_CELLS:  # checked before they are listed, because factors multiply
        raise InputError(
            f"{study.at('study')}: {study.name} has {spell(count)} cells; at most {_MOST_CELLS} are allowed"
        )
    stems = [Path(scenario).stem for scenario in study.scenarios]
    shown_as = dict(zip(study.scenarios, stems if len(set(stems)) == len(stems) else study.scenarios, strict=True))
    found = []
    for scenario, *chosen in product(study.scenarios, *study.factors.values()):
        levels = tuple(zip(study.factors, chosen, strict=True))
        shown = (("scenario", shown_as[scenario]), *levels) if len(stems) > 1 else levels
        tables = (
            StudyTable("study", {}, {}),
            StudyTable("set", study.settings, {}),
            StudyTable("", study.given, {}),
            *_list_tables(study, levels),
        )
        made = [Cell(scenario, shown, tables, planner) for planner in planners]
        if study.score:
            seen = (*shown, (VIEW, "unlimited"))
            unlimited = (*tables, StudyTable("score", _UNLIMITED, {}))
            made.append(Cell(scenario, seen, unlimited, study.score.bound))
        for cell in made:
            place = {"planner": cell.planner, "scenario": scenario, **dict(levels)}
            if not any(all(place[key] in values for key, values in rule.items()) for rule in study.exclude):
                found.append(cell)
    if not found:
        raise InputError(
            f"{study.at('study')}: {study.name} has no trial: {_name_empty_lists(study) or 'all is excluded'}"
        )
    return found


def parse_factor(text: str) -> tuple[str, list[Any]]:
    """Key and levels of a factor given as key=level,level, where 1-6 is six levels; InputError for any other text."""
    key, equals, given = (part.strip() for part in text.partition("="))
    _, parts = split_options(f"levels({given})")
    if not key or not equals or not parts:
        raise InputError(f"--vary: {text!r} is not of the form key=level,level, for instance network.loss=0,0.5")
    levels: list[Any] = []
    for part in parts:
        levels += parse_integers(part, "--vary") if re.fullmatch(r"\d+\s*-\s*\d+", part) else [parse_value(part)]
    return key, levels


def list_choices(study: Study) -> list[str]:
    """The factors of which a user chooses the level: those that set options of planners, UAVs, trackers or rates."""
    return [
        factor
        for factor, levels in study.factors.items()
        if not any(overlap(key, given) for level in levels.values() for key in flatten(level) for given in _GIVEN)
    ]


def list_lone_keys(study: Study) -> list[str]:
    """Remarks on factors that set a key of UAV 0 alone, one line each."""
    found = []
    for factor, levels in study.factors.items():
        keys = {key for level in levels.values() for key in flatten(level)}
        for own in sorted(key.removeprefix("uavs.0.") for key in keys if key.startswith("uavs.0.")):
            if f"uavs.1.{own}" not in keys:
                found.append(f"factors.{factor}: uavs.0.{own} is of UAV 0 alone; uavs.*.{own} is of all UAVs")
    return found


def _name_empty_lists(study: Study) -> str:
    """Names of the empty lists of a study, for an error message."""
    lists = {"planner": study.planners, "scenario": study.scenarios}
    lists |= {f"level of factor {factor!r}": tuple(levels) for factor, levels in study.factors.items()}
    return ", ".join(f"no {name}" for name, entries in lists.items() if not entries)


def _list_tables(study: Study, levels: Levels) -> Iterator[StudyTable]:
    """The tables of the given levels of factors."""
    for factor, level in levels:
        values = dict(study.factors[factor][level])
        given = values.pop("planner", {})
        options = {key: format_value(value) if isinstance(value, str) else str(value) for key, value in given.items()}
        yield StudyTable(f"factors.{factor}.{level}", format_settings(values), options)


def add_trackers(study: Study, trackers: Sequence[str]) -> Study:
    """The study with the given trackers, if any, as a factor; InputError if another factor varies the tracker."""
    if not trackers:
        return study
    others = {name: levels for name, levels in study.factors.items() if name != TRACKER}
    for factor, levels in others.items():
        if any("tracking.tracker" in flatten(level) for level in levels.values()):
            raise InputError(f"--tracker: tracking.tracker is what factor {factor!r} of study {study.name} varies")
    own = {name: {"tracking": {"tracker": name}} for name in trackers}
    return msgspec.structs.replace(study, factors={**others, TRACKER: own})


def _check_levels(study: Study) -> None:
    set_by: dict[str, str] = {}  # the factor that sets a key or option
    for factor, levels in study.factors.items():
        where = study.at(f"factors.{factor}")
        if factor in ("planner", "scenario"):  # keys with another meaning in `exclude`
            raise InputError(f"{where}: cannot be the name of a factor; list them as {factor}s of [study]")
        for level, values in levels.items():
            options = values.get("planner", {})
            if not isinstance(options, Mapping):
                raise InputError(f"{where}.{level}.planner: {options!r} is not allowed; expected {{option = value}}")
        for key in sorted({key for values in levels.values() for key in flatten(values)}):
            for other, first in set_by.items():
                if first != factor and other.count(".") == key.count(".") and overlap(key, other):
                    raise InputError(f"{where}: {key} is what factor {first!r} sets; allowed is one factor")
            set_by[key] = factor
    if study.score and VIEW in study.factors:
        where = study.at(f"factors.{VIEW}")
        raise InputError(f"{where}: cannot be the name of a factor beside [score], whose bound has an unlimited view")
