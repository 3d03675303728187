"""The files of a study's report: `report.html`, `table.csv` and figures."""

import base64
import hashlib
import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from html import escape
from pathlib import Path

from sim.mission.atomic_files import write_whole
from sim.study.analysis.answers import find_answers
from sim.study.analysis.groups import Group, find_constant_factors, find_varying_factors
from sim.study.analysis.labels import SYMBOLS, append_cell, cell_text, format_entrant
from sim.study.analysis.metric_choice import RUNTIME, find_shown_metric, list_available
from sim.study.report.comparison import About, Comparison, compare_rows
from sim.study.report.figures.pictures import (
    Picture,
    draw_pictures,
    draw_response_pictures,
    draw_score_picture,
)
from sim.study.report.html_parts import (
    make_bullet_list,
    make_command_line,
    make_html_table,
    make_page,
    make_paragraph,
    make_titled_tables,
)
from sim.study.report.levels import make_level_tables, write_level_sentences
from sim.study.report.sentences import format_ranges, list_shortfalls, write_notes, write_verdict
from sim.study.report.single_trials import list_failures, show_extreme_maps
from sim.study.report.tables import format_csv, make_answer_tables, make_runtime_tables, make_score_table
from sim.study.trials import TrialRow
from tracking.errors import InputError

_FIGURES = r"(ecdf|time|maps|runtime|score|levels)(-[a-z0-9-]+)?\.(svg|png|pdf)"  # file names of a report's figures
_HOW_TO_READ = (
    "A map is the forest and the people of one seed. Every planner flies the same maps. Seeds that share forest and "
    "people, as from files, are flights of one world: what follows then holds for its noise alone. A cell is one "
    "combination of the settings that the study varies.",
    "Brackets show 95 % intervals over the maps of a cell. Those of means and mean differences are Student's t "
    "intervals, extended for skewness; those of medians end at two values of the sample. They are not corrected for "
    "their number: of twenty intervals, expect one to miss the true value.",
    "With ten maps or more, intervals of shares contain the true mean in 95 % of cases (median over planners and "
    "worlds of bench-1), those of differences at worst in 86 %. This was counted by drawing maps from trials that were "
    "flown (docs/how-to/reports.md). If fewer than six maps differ from the most common value there is no interval, "
    "because such a sample tells little of what rare maps add.",
    "Intervals of mean OSPA in metres hold less often, with any number of maps up to 50. On about one map in fifty a "
    "planner loses people for good, and such a map outweighs all others; samples without one miss the mean. Shares of "
    "scans tell more, and so do medians over the maps, whose intervals are reliable with six maps or more.",
    "Intervals of mean GOSPA contain the true mean in 95 % of cases (median), at worst in 75 %. For other "
    "metrics, such as run times, this was not counted.",
    "Two planners can be told apart if the interval of their difference excludes zero and they share at least six "
    "maps; fewer are too few, wherever the interval ends. If several differences are shown, a star marks those that "
    "survive Holm's correction for all of them.",
    "Maps needed is the number of maps with which a paired t test at 5 % finds a difference of the observed size in "
    "four of five comparisons. It is as uncertain as the difference itself.",
    "If maps are repeated, a map's value is the mean of its repeats.",
    "A difference is the planner's value minus the baseline's on the same map. The last lines of a table compare means "
    "over all cells, seed by seed.",
    "Failed trials and undefined values do not count. They are listed wherever they are left out.",
)
_ON_LEVELS = (
    "Levels of a factor are compared on the same seeds: with the level before and with the best, which was found on "
    "these maps and so looks better than it is. What a user can choose is therefore chosen on the first half of the "
    "seeds and judged on the others. A star marks what survives Holm's correction for all differences of the factor."
)
_HOW_TO_FLY = (
    "Click a command to select it, and run it in a shell. It writes film and recording into a folder under runs/."
)


def write(rows: Sequence[TrialRow], folder: Path, about: About) -> None:
    """Write report.html, table.csv and figures/*.svg, *.png into `folder`: all of them, or none.

    Figures of an earlier report that this one lacks are removed. InputError if a metric or the baseline is unknown,
    there are no rows, or the folder cannot be written.
    """
    files = make_files(rows, about)
    try:
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:  # files get their names when all are written
            for name, data in files.items():
                stack.enter_context(write_whole(folder / name)).write_bytes(data)
        for path in (folder / "figures").iterdir():
            if re.fullmatch(_FIGURES, path.name) and f"figures/{path.name}" not in files:
                path.unlink()
    except OSError as error:
        raise InputError(f"report: {folder} cannot be written: {error.strerror or error}") from error


def make_files(rows: Sequence[TrialRow], about: About) -> dict[str, bytes]:
    """The files of a report by name."""
    found = compare_rows(rows, about)
    baseline = found.baseline
    groups = found.groups
    metric = found.metrics[0]
    runtimes = [find_shown_metric(name) for name in RUNTIME if name in list_available(rows)]
    times = find_answers(groups, runtimes, baseline)
    pictures = [
        *draw_response_pictures(found.levels, metric, about.threshold),
        *draw_pictures(groups, baseline, found.metrics),
    ]
    scoring: list[Picture] = []
    scored = ""
    if found.scored:
        scoring.append(draw_score_picture(found.scored.scores, found.scored.ends))
        score_table = make_score_table(found.scored, groups)
        scored = make_paragraph(score_table.note) + make_html_table(score_table) + _embed_figures(scoring)
    full = {group.cell: other.cell for group, other in zip(groups, found.every, strict=True)}
    shown = [*found.answers, *(answer for answer in times if answer.metric not in found.metrics)]
    full_answers = [replace(a, cell=None if a.cell is None else full[a.cell]) for a in shown]
    extremes = show_extreme_maps(groups, metric)
    best_and_worst = "Least and greatest maps" if metric.better == "neither" else "Best and worst maps"
    of_each = make_paragraph(f"For each planner separately, by {metric.title}.")
    tables = make_answer_tables(found.answers, baseline)
    sections = {
        "In short": _write_verdicts(found, about),
        "What was run": _describe_study(rows, found.every, about, baseline),
        "Scores": scored,
        "Results": f"{make_bullet_list(write_notes(found.answers))}\n{make_titled_tables(tables)}",
        "Levels": make_titled_tables(make_level_tables(found.levels, metric, about.threshold)),
        "Figures": _embed_figures(pictures),
        "Run time": make_titled_tables(make_runtime_tables(times)),
        best_and_worst: of_each + extremes.tables if extremes.commands else "",
        f"Failures: {sum(len(group.failed) for group in found.every)}": list_failures(found.every),
        "Fly them again": make_paragraph(_HOW_TO_FLY) + extremes.commands if extremes.commands else "",
        "How to read this": make_bullet_list((*_HOW_TO_READ, *([_ON_LEVELS] if found.levels else []))),
    }
    opening = f"<h1>{escape(about.study)}</h1>\n{make_paragraph(about.description, 'soft')}"
    files = {
        "report.html": make_page(f"{about.study}: understory", opening, sections).encode(),
        "table.csv": format_csv(full_answers, baseline).encode(),
    }
    for picture in (*pictures, *scoring):
        kinds = {"svg": picture.svg, "png": picture.png} | ({"pdf": picture.pdf} if picture.pdf else {})
        files |= {f"figures/{picture.name}.{kind}": content for kind, content in kinds.items()}
    return files


def _embed_figures(pictures: Sequence[Picture]) -> str:
    """Pictures within the page, as SVG unless PNG is much smaller."""
    parts = []
    for picture in pictures:
        small = len(picture.svg) < 3 * len(picture.png)
        kind, data = ("svg+xml", picture.svg) if small else ("png", picture.png)
        source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
        image = f'<img src="{source}" alt="{escape(picture.alt)}">'
        caption = f"<figcaption>{escape(picture.caption)}</figcaption>"
        parts.append(f"<h3>{escape(picture.title)}</h3>\n<figure>\n{image}\n{caption}\n</figure>")
    return "\n".join(parts)


def _write_verdicts(compared: Comparison, about: About) -> str:
    """Verdicts by the first metric: on levels, then one for each planner; and remarks on omitted trials and faults."""
    found, baseline, metric = compared.answers, compared.baseline, compared.metrics[0]
    shown = sum(answer.difference is not None and answer.difference.pairs > 0 for answer in found)
    of_metric = [answer for answer in found if answer.metric == metric]
    summed = {answer.planner for answer in of_metric if answer.cell is None}
    sentences = [
        write_verdict(
            append_cell(answer.planner, answer.cell or ()),
            baseline,
            metric,
            answer.difference,
            shown=shown,
            sample=answer.sample,
        )
        for answer in of_metric
        if answer.difference and (answer.cell is None or answer.planner not in summed)
    ]
    left_out = list_shortfalls(of_metric)
    lines = sentences + write_level_sentences(compared.levels, compared.choices, metric, about.threshold)
    lines = lines or [f"{baseline} alone; there is nothing to compare it with."]
    flown = max(answer.flown for answer in of_metric)
    counted = f"Seeds flown: {flown}; a comparison counts those on which both planners have a value."
    return make_bullet_list(lines) + (
        (make_paragraph(counted) if sentences else "") + make_bullet_list(left_out) if left_out else ""
    )


def _describe_study(rows: Sequence[TrialRow], every: Sequence[Group], about: About, baseline: str) -> str:
    seeds = sorted({row.seed for row in rows})
    repeats = len({row.repeat for row in rows})
    failed = sum(row.status == "failed" for row in rows)
    changing = find_varying_factors(every)
    versions = {**about.versions, "understory": ", ".join(sorted({row.version for row in rows}))}
    settings = set.intersection(*({f"{key} = {value}" for key, value in row.settings.items()} for row in rows))
    hashes = sorted(row.recording for row in rows if row.recording)  # equal in any order if all missions are
    planners = dict.fromkeys(format_entrant(row) for group in every for row in (*group.done, *group.failed))
    facts = [
        ("scenario", ", ".join(sorted({row.scenario for row in rows}))),
        ("everywhere", cell_text(find_constant_factors(every))),
        ("set for all trials", ", ".join(sorted(settings))),
        *((f"{SYMBOLS.get(name, name)} varies", ", ".join(values)) for name, values in changing.items()),
        ("planners", "; ".join(planners)),
        ("labels", "; ".join(f"{label} is {planner}" for planner, label in about.labels.items())),
        ("baseline", baseline),
        ("seeds (maps)", f"{len(seeds)}: {format_ranges(seeds)}"),
        ("repeats of each map", str(repeats) if repeats > 1 else ""),
        ("trials", f"{len(rows) - failed} done, {failed} failed"),
        ("time of all trials, added up", "" if about.wall_s is None else format_duration(about.wall_s)),
        ("trials flown on", "; ".join(sorted({row.machine for row in rows} - {""}))),
        ("hash of all recordings", hashlib.sha256("".join(hashes).encode()).hexdigest() if hashes else ""),
        ("report made on", about.machine),
        ("versions", ", ".join(f"{name} {number}" for name, number in versions.items())),
    ]
    lines = [f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts if value]
    text = "<dl>\n" + "\n".join(lines) + "\n</dl>"
    return text + (
        make_paragraph("The command that runs it again:") + make_command_line(about.command) if about.command else ""
    )


def format_duration(seconds: float) -> str:
    """A duration in words."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"
