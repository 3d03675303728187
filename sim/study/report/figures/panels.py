"""Layout of a study's figures: the curves of each panel, and their colours and dashes."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, groupby, product
from typing import Generic, TypeVar

from sim.study.analysis.groups import Group, find_varying_factors
from sim.study.analysis.labels import cell_text
from sim.study.analysis.levels import LevelAnswer
from sim.study.cells import Levels
from sim.views.palette import BLUE, INK, ORANGE, PURPLE, SKY, VERMILLION, Colour

COLOURS: tuple[Colour, ...] = (BLUE, VERMILLION, (0, 158, 115), PURPLE, ORANGE, SKY, INK)  # Okabe-Ito
DASHES = ("-", "--", ":", "-.")
PANELS = 12  # largest number of panels in one figure, if factors allow
COLUMNS = 3
T = TypeVar("T")


@dataclass(frozen=True)
class Style:
    """Colour and dash of a curve."""

    colour: Colour
    dash: str = "-"


@dataclass(frozen=True, eq=False)
class Curve(Generic[T]):
    """What one curve of a panel shows, such as a group."""

    label: str
    style: Style
    shown: T


@dataclass(frozen=True, eq=False)
class FigureLayout(Generic[T]):
    """Panels of a figure: curves over the same axes, by their titles."""

    title: str  # text that all panels share
    panels: dict[str, list[Curve[T]]]
    columns: int

    @property
    def shown(self) -> list[T]:
        """What each curve shows."""
        return [curve.shown for curves in self.panels.values() for curve in curves]

    @property
    def legend(self) -> dict[str, Style]:
        """Every label with its style."""
        return {curve.label: curve.style for curves in self.panels.values() for curve in curves}


def lay_out_figures(groups: Sequence[Group]) -> list[FigureLayout[Group]]:
    """The figures of a study.

    Several planners: a panel per cell, a curve per planner, as in [Li22] Fig. 5. A single planner: a panel per value of
    the first factor, curves for the other factors, as in [Li22] Fig. 4.
    If there were too many panels, each value of the factor with the fewest values has its own figure.
    """
    styles = style_planners([group.planner for group in groups])  # the baseline first
    if len(styles) == 1:
        return [_lay_out_one_planner(groups)]
    return [_lay_out_planners(shared, part, styles) for shared, part in _split((), groups)]


def style_planners(planners: Sequence[str]) -> dict[str, Style]:
    """A style for each planner; colours vary first."""
    looks = zip(dict.fromkeys(planners), cycle(product(DASHES, COLOURS)), strict=False)
    return {planner: Style(colour, dash) for planner, (dash, colour) in looks}


def lay_out_levels(found: Sequence[LevelAnswer]) -> list[FigureLayout[list[LevelAnswer]]]:
    """Figures of the levels of one factor: a panel for each combination of the other factors, a curve per planner."""
    styles = style_planners([answer.planner for answer in found])
    panels: dict[str, list[Curve[list[LevelAnswer]]]] = {}
    for (others, planner), line in groupby(found, lambda answer: (answer.others, answer.planner)):
        panels.setdefault(cell_text(others), []).append(Curve(planner, styles[planner], list(line)))
    parts = [dict(list(panels.items())[k : k + PANELS]) for k in range(0, len(panels), PANELS)]
    return [FigureLayout("", part, min(COLUMNS, len(part))) for part in parts]


def _split(shared: Levels, groups: Sequence[Group]) -> Iterator[tuple[Levels, list[Group]]]:
    """The groups of each figure, with the factors that have the same value in it."""
    factors = find_varying_factors(groups)
    if len(factors) < 2 or (len(factors) == 2 and len({group.cell for group in groups}) <= PANELS):
        yield shared, list(groups)
        return
    fewest = min(factors, key=lambda name: len(factors[name]))
    for value in factors[fewest]:
        part = [group for group in groups if (fewest, value) in group.cell]
        yield from _split((*shared, (fewest, value)), part)


def _lay_out_planners(shared: Levels, groups: Sequence[Group], styles: dict[str, Style]) -> FigureLayout[Group]:
    factors = find_varying_factors(groups)
    panels = defaultdict[str, list[Curve[Group]]](list)
    for group in groups:
        title = cell_text(_select_factors(group.cell, factors))
        panels[title].append(Curve(group.planner, styles[group.planner], group))
    sizes = [len(values) for values in factors.values()]
    crossed = len(sizes) == 2 and sizes[0] * sizes[1] == len(panels) and sizes[1] <= COLUMNS + 1
    columns = sizes[1] if crossed else COLUMNS  # two factors form rows and columns
    return FigureLayout(cell_text(shared), panels, min(columns, len(panels)))


def _lay_out_one_planner(groups: Sequence[Group]) -> FigureLayout[Group]:
    """Panels by the first factor, colours by the last, and dashes by the factors in between."""
    factors = list(find_varying_factors(groups))
    outer = factors[:1] if len(factors) > 1 else []
    inner = factors[len(outer) :]
    last = list(dict.fromkeys(_select_factors(group.cell, inner[-1:]) for group in groups))
    between = list(dict.fromkeys(_select_factors(group.cell, inner[:-1]) for group in groups))
    panels = defaultdict[str, list[Curve[Group]]](list)
    for group in groups:
        colour = COLOURS[last.index(_select_factors(group.cell, inner[-1:])) % len(COLOURS)]
        dash = DASHES[between.index(_select_factors(group.cell, inner[:-1])) % len(DASHES)]
        label = cell_text(_select_factors(group.cell, inner)) or group.planner
        title = cell_text(_select_factors(group.cell, outer))
        panels[title].append(Curve(label, Style(colour, dash), group))
    return FigureLayout("", panels, min(COLUMNS, len(panels)))


def _select_factors(cell: Levels, names: Collection[str]) -> Levels:
    return tuple(factor for factor in cell if factor[0] in names)
