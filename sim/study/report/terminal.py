"""The results of a study in the terminal: tables, the place of the report, and failures."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import rich.table
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape

from sim.facts.metrics.summary import list_versions
from sim.scenario.random_streams import format_seed
from sim.study.analysis.groups import find_constant_factors
from sim.study.analysis.labels import cell_text, format_entrant, shorten_labels
from sim.study.report.comparison import About, compare_rows
from sim.study.report.levels import make_level_tables, write_level_sentences
from sim.study.report.report_files import write
from sim.study.report.sentences import list_shortfalls, write_notes
from sim.study.report.tables import Table, make_answer_tables, make_score_table
from sim.study.trials import TrialRow
from sim.terminal.console import console, fail
from tracking.errors import InputError

_NAMES = 12  # characters, least width of the column of names


def show_study(rows: Sequence[TrialRow], folder: Path, about: About) -> None:
    """Print tables and write the report; exit with code 1 if that fails or trials have failed."""
    command = shlex.join(["understory", *sys.argv[1:]])
    wall = sum(row.metrics.get("wall_s", 0.0) for row in rows)
    try:
        write(rows, folder, replace(about, command=command, versions=list_versions(), wall_s=wall))
        show(rows, about)  # last, because the reader of a pipe may close it
    except (KeyboardInterrupt, InputError) as error:  # names were checked before, so the disk may be full
        reason = str(error) or "interrupted"
        fail(f"{reason}; all {len(rows)} trials are kept in {folder}, the same command writes the report", code=1)
    failures = [row for row in rows if row.status == "failed"]
    missing = "; the same command flies again what failed" if failures else ""
    console.print(f"Results in [bold]{escape(str(folder))}[/bold] (report.html){missing}.", soft_wrap=True)
    if failures:
        first = failures[0]
        place = f"{format_entrant(first)}, {format_seed(first.seed, first.repeat)}"
        fail(f"{len(failures)} of {len(rows)} trials failed, {place}: {first.error}", code=1)


def show(rows: Sequence[TrialRow], about: About, *, on: Console = console) -> None:
    """Print the answers; InputError if a metric or the baseline is unknown.

    Options that all planners of one name share are not in the tables but listed below them.
    """
    compared = compare_rows(rows, about)
    shorts = shorten_labels(list(dict.fromkeys(answer.planner for answer in compared.answers)))
    found = [replace(answer, planner=shorts[answer.planner]) for answer in compared.answers]
    if everywhere := find_constant_factors(compared.every):
        on.print(f"Everywhere: {escape(cell_text(everywhere))}")
    levels = [answer._replace(planner=shorts[answer.planner]) for answer in compared.levels]
    choices = [choice._replace(planner=shorts[choice.planner]) for choice in compared.choices]
    metric = compared.metrics[0]
    for table in (
        *make_answer_tables(found, shorts[compared.baseline], width=on.width),
        *make_level_tables(levels, metric, about.threshold),
    ):
        on.print(_make_terminal_table(table, on.width))
    if compared.scored:
        table = make_score_table(compared.scored, compared.groups)
        on.print(_make_terminal_table(table._replace(heads=[shorts.get(head, head) for head in table.heads]), on.width))
        on.print(escape(table.note), style="dim")
    for label, short in {**about.labels, **shorts}.items():
        if short != label:
            on.print(f"{escape(short)} is {escape(label)}", style="dim", soft_wrap=True)
    for note in write_notes(found, width=on.width):
        on.print(escape(note), style="dim")
    for line in write_level_sentences(levels, choices, metric, about.threshold):
        on.print(f"- {escape(line)}")
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
