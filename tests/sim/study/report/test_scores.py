"""Scores as table and figure in the report, and as table in the terminal."""

import io
import re

from helpers.trials import row
from rich.console import Console

from sim.study.definition import ScoreScale
from sim.study.report.comparison import About
from sim.study.report.report_files import make_files
from sim.study.report.tables import SCORES
from sim.study.report.terminal import show

SCORE = ScoreScale(floor="hover", bound="sma-nbo")


def rows():
    found = []
    for world, bound in (("forest", 2.0), ("dense", 4.0)):
        for seed in range(3):
            for planner, value, view in (("sma-nbo", 6.0, ()), ("hover", 10.0, ()), ("sma-nbo", bound, "unlimited")):
                factors = (("scenario", world), *((("view", view),) if view else ()))
                metrics = {"gospa.mean_m": value + 0.1 * seed, "ospa.share_under_1m": 0.5}
                found.append(row(planner, seed, factors, metrics, scenario=world))
    return found


def test_report_and_terminal_have_scores_where_the_study_has_a_score(without_pictures):
    files = make_files(rows(), About("tried", score=SCORE))
    page = files["report.html"].decode()
    assert ">Scores</h2>" in page and "0 is that of hover, 100 that of sma-nbo(view=unlimited)" in page
    table = page[page.index(">Scores</h2>") :].partition("</table>")[0]
    cells = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", line) for line in table.splitlines() if "<t" in line]
    assert [line for line in cells if line] == [
        ["cell", "hover [m]", "sma-nbo(view=unlimited), upper bound [m]", "sma-nbo"],
        ["scenario = dense", "10.10", "4.10", "67"],
        ["scenario = forest", "10.10", "2.10", "50"],
        ["mean over cells", "", "", "58"],
    ]
    assert {"figures/score.png", "figures/score.svg"} <= set(files)
    out = io.StringIO()
    show(rows(), About("tried", score=SCORE), on=Console(file=out, width=80))
    assert SCORES in out.getvalue() and " 67 " in out.getvalue() and "mean over cells" in out.getvalue()
    without = make_files([r for r in rows() if len(r.factors) == 1], About("tried"))
    assert "figures/score.png" not in without and b"Scores" not in without["report.html"]
