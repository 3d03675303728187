"""Entries of planners in the ten worlds: their results from flights, flights that check these, and the page's table.

    python docs/board.py claim entries/NAME DIR...
    python docs/board.py check entries/NAME --seeds 3,17 --scenario forest

The first lists the trials of studies of bench-1 as the entry's results. The second flies the entry's planners again and
says which results differ. `python docs/generate.py` writes the table into docs/results/board.md.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import scores

from sim.study.analysis.groups import group_rows
from sim.study.analysis.normalised_score import SCORE, compute_scores, find_score_ends
from sim.study.cells import VIEW
from sim.study.store import read_rows
from sim.study.trials import TrialRow

ENTRIES = Path(__file__).parents[1] / "entries"
_EQUAL = 1e-9  # relative difference of a metric that the digits of a list allow


class _File(msgspec.Struct, forbid_unknown_fields=True):
    """An entry.toml."""

    authors: str
    machine: str
    planners: list[str]
    results: str = "results.csv"


@dataclass(frozen=True)
class Entry:
    """Planners in a folder, which may contain their package, and the results that their authors claim."""

    folder: Path
    authors: str
    machine: str
    planners: Sequence[str]
    results: Path

    def list_claims(self) -> list[TrialRow]:
        """The claimed trials of the entry's planners."""
        return [row for row in scores.trials(self.results) if row.planner in self.planners and not _has_view(row)]


def read_entry(folder: Path) -> Entry:
    """The entry in a folder; SystemExit with one line if its entry.toml cannot be used."""
    file = folder / "entry.toml"
    try:
        read = msgspec.toml.decode(file.read_bytes(), type=_File)
    except (OSError, msgspec.DecodeError) as error:  # an error of validation is one of decoding
        raise SystemExit(f"{file}: {error}") from error
    return Entry(folder, read.authors, read.machine, read.planners, (folder / read.results).resolve())


def find_departures(claimed: Sequence[TrialRow], flown: Sequence[TrialRow]) -> Iterator[str]:
    """A line for each flown trial that the claims lack, and for each metric that differs from its claim."""
    claims = {(row.scenario, row.planner, row.seed): row for row in claimed}
    for row in flown:
        where = f"{row.scenario}, {row.planner}, seed {row.seed}"
        claim = claims.get((row.scenario, row.planner, row.seed))
        if claim is None or row.status != "done":
            yield f"{where}: {'not claimed' if claim is None else 'the flight failed'}"
            continue
        for name in scores.METRICS:
            here, there = row.metrics.get(name, math.nan), claim.metrics[name]
            if not (math.isclose(here, there, rel_tol=_EQUAL) or (math.isnan(here) and math.isnan(there))):
                yield f"{where}: {name} is {here:.10g}, claimed {there:.10g}"


def check(entry: Entry, seeds: str, worlds: Sequence[str] = ()) -> list[str]:
    """Fly the planners of an entry in its folder, and return how its results depart from that."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sim", "compare", "bench-1", "--seeds", seeds, "--out", folder]
        command += [word for planner in entry.planners for word in ("--planner", planner)]
        command += [word for world in worlds for word in ("--scenario", world)]
        subprocess.run(command, check=True, cwd=entry.folder, stdout=subprocess.DEVNULL)
        rows = read_rows(Path(folder))
    flown = [row for row in rows if row.planner in entry.planners and not _has_view(row)]  # not the floor and the bound
    return list(find_departures(entry.list_claims(), flown))


def make_table(folders: Sequence[Path]) -> str:
    """A line for each planner of each entry, by mean score over the worlds, those that lack a world last."""
    ends = [row for row in scores.trials() if row.planner == scores.STUDY.score.floor or _has_view(row)]
    lines: list[tuple[float, list[str]]] = []
    for entry in map(read_entry, folders):
        claims = entry.list_claims()
        for planner in entry.planners:
            own = [row for row in claims if row.planner == planner]
            score, text, maps = _find_score([*own, *ends], planner)
            releases = ", ".join(sorted({row.version for row in own}))
            cells = [f"`{planner}`", text, str(maps), entry.folder.name, entry.authors, releases]
            lines.append((score, cells))
    lines.sort(key=lambda line: -line[0] if math.isfinite(line[0]) else math.inf)
    return scores.format_table(["planner", "score", "maps", "entry", "by", "flown by"], [cells for _, cells in lines])


def _find_score(rows: Sequence[TrialRow], planner: str) -> tuple[float, str, int]:
    """Mean normalised score over all worlds, also as text, and its maps, which all worlds have; NaN without any."""
    rows = [msgspec.structs.replace(row, version="") for row in rows]  # whatever flew them
    groups = group_rows(rows, planner)
    metric = scores.find_shown_metric(scores.STUDY.score.metric)
    found = compute_scores(groups, metric, find_score_ends(rows, scores.STUDY.score))
    for answer in found:
        if answer.planner == planner and answer.cell is None:
            return answer.mean.value, f"{answer.mean.text(SCORE)} %", answer.maps
    return math.nan, "not in all worlds", 0


def _has_view(row: TrialRow) -> bool:
    return any(name == VIEW for name, _ in row.factors)


def main(arguments: Sequence[str] | None = None) -> None:
    """Do what the command says; the exit code of a check that finds a departure is 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    claim, checked = commands.add_parser("claim"), commands.add_parser("check")
    for each in (claim, checked):
        each.add_argument("entry", type=Path)
    claim.add_argument("studies", type=Path, nargs="+")
    checked.add_argument("--seeds", required=True)
    checked.add_argument("--scenario", action="append", default=[], help="one of the worlds; several are possible")
    checked.add_argument("--planner", action="append", default=[], help="one of the entry's; several are possible")
    given = parser.parse_args(arguments)
    entry = read_entry(given.entry)
    if given.command == "claim":
        scores.add(given.studies, entry.results)
        print(f"{len(entry.list_claims())} trials are in {entry.results}")
        return
    departures = check(replace(entry, planners=given.planner or entry.planners), given.seeds, given.scenario)
    print("\n".join(departures) or "all that was flown again is as claimed")
    if departures:
        sys.exit(1)


if __name__ == "__main__":
    main()
