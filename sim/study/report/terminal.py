"""The answers of a study as tables in the terminal."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import rich.table
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape

from sim.study.analysis.answers import find_answers
from sim.study.analysis.cell_text import cell_text
from sim.study.analysis.groups import drop_constant_factors, find_constant_factors, group_rows
from sim.study.analysis.metric_choice import choose_metrics
from sim.study.analysis.normalised_score import score_planners
from sim.study.analysis.planner_labels import find_baseline, shorten_labels
from sim.study.report.report import About
from sim.study.report.sentences import list_shortfalls, write_notes
from sim.study.report.tables import Table, make_answer_tables, make_score_table
from sim.study.tasks import Row
from sim.terminal.console import console

_WIDE = 100  # characters, least width of a terminal with room for all columns
_NAMES = 12  # characters, least width of the column of names


def show(rows: Sequence[Row], about: About, *, on: Console = console) -> None:
    """Print the answers; InputError if a metric or the baseline is unknown.

    Options that all planners of one name share are not in the tables but listed below them.
    """
    first = find_baseline(rows, about.baseline, about.labels)
    whole = group_rows(rows, first, about.labels)
    groups, everywhere = drop_constant_factors(whole), find_constant_factors(whole)
    full = find_answers(groups, choose_metrics(rows, about.metrics), first)
    shorts = shorten_labels(list(dict.fromkeys(answer.planner for answer in full)))
    found = [replace(answer, planner=shorts[answer.planner]) for answer in full]
    if everywhere:
        on.print(f"Everywhere: {escape(cell_text(everywhere))}")
    wide = on.width >= _WIDE
    for table in make_answer_tables(found, shorts[first], wide=wide):
        on.print(_make_terminal_table(table, on.width))
    if scores := score_planners(rows, groups, about.score, about.labels):
        table = make_score_table(scores, groups)
        on.print(_make_terminal_table(table._replace(heads=[shorts.get(head, head) for head in table.heads]), on.width))
        on.print(escape(table.note), style="dim")
    for label, short in {**about.labels, **shorts}.items():
        if short != label:
            on.print(f"{escape(short)} is {escape(label)}", style="dim", soft_wrap=True)
    for note in write_notes(found, wide=wide):
        on.print(escape(note), style="dim")
    for line in list_shortfalls(found):
        on.print(escape(line), style="bold red")


def _make_terminal_table(shown: Table, width: int) -> rich.table.Table:
    table = rich.table.Table(
        title=escape(shown.title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    # Names make room for numbers, if that shows these whole. Heads may be folded between words if they are planners.
    cut = "\n" if shown.metric else None
    columns = zip(shown.heads, *(row.texts for row in shown.rows), strict=True)
    widths = [max(map(len, (*head.split(cut), *texts))) for head, *texts in columns]
    room = width - sum(widths[1:]) - (2 * len(widths) + 1)  # less the gaps
    for i, head in enumerate(shown.heads):
        most = room if i == 0 and room >= _NAMES else None
        table.add_column(escape(head), justify="left" if i == 0 else "right", overflow="fold", max_width=most)
    for cell, rows in groupby(shown.rows, lambda row: row.cell):
        table.add_section()
        if cell != ():
            table.add_row(f"[bold]{escape(cell_text(cell))}[/bold]")
        for row in rows:
            table.add_row(*map(escape, row.texts))
    return table
