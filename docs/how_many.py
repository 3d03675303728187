"""Table and figure of docs/results/how-many.md, from the study in runs/how-many: `python docs/how_many.py` writes both.

First `understory compare how-many --out runs/how-many`. Another folder is given as an argument.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from sim.facts.metrics.metric import Metric
from sim.study.analysis.levels import LevelAnswer, Threshold
from sim.study.cells import list_choices
from sim.study.definition import read_study
from sim.study.report.comparison import About, compare_rows
from sim.study.report.figures.pictures import draw_response_pictures
from sim.study.report.levels import write_level_sentences
from sim.study.store import read_rows

PAGE = Path(__file__).parent / "results" / "how-many.md"
PICTURE = Path(__file__).parent / "media" / "how-many.png"
STUDY = read_study("how-many")
THRESHOLD = Threshold("share_held", 0.9)
HEADING = "## Result\n"


def write_table(found: Sequence[LevelAnswer], metric: Metric) -> str:
    """A line an altitude, a column a size of the fleet: mean share held with its interval [%]; bold from 90 % on."""
    sizes, altitudes = map(list, STUDY.factors.values())
    texts = {}
    for answer in found:
        mark = "**" if answer.found.mean.value >= THRESHOLD.value else ""
        texts[dict(answer.others)["altitude"], answer.level] = f"{mark}{answer.found.mean.text(metric)}{mark}"
    lines = [["m", *sizes], ["---"] * (1 + len(sizes))]
    lines += [[altitude, *(texts[altitude, size] for size in sizes)] for altitude in altitudes]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(folder: str = "runs/how-many") -> None:
    """Write the figure, and the section of the page with the table and the verdict."""
    levels = {factor: list(own) for factor, own in STUDY.factors.items()}
    about = About("how-many", levels=levels, choices=tuple(list_choices(STUDY)), threshold=THRESHOLD)
    rows = read_rows(folder)
    found = compare_rows(rows, about)
    metric = found.metrics[0]
    over_size = [answer for answer in found.levels if answer.factor == "fleet"]
    PICTURE.write_bytes(draw_response_pictures(over_size, metric, THRESHOLD)[0].png)
    before = PAGE.read_text(encoding="utf-8").partition(HEADING)[0]
    (verdict, *_) = write_level_sentences([], found.choices, metric, THRESHOLD)
    maps = len({row.seed for row in rows})
    parts = [
        f"Share of five people held [%] on {maps} maps, by altitude [m] and number of UAVs:",
        write_table(over_size, metric),
        f"![Share held over the size of the fleet.](../media/{PICTURE.name})",
        verdict,
    ]
    PAGE.write_text(before + HEADING + "\n" + "\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
