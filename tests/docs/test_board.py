"""docs/board.py: what is claimed is what is flown, or it is said; and the table is that of the claims."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.pages import DOCS
from msgspec.structs import replace as changed

sys.path.append(str(DOCS))
import board
import scores

ENTRY = board.read_entry(board.ENTRIES / "built-in")


def claims(**wanted):
    return [r for r in ENTRY.list_claims() if all(getattr(r, name) == value for name, value in wanted.items())]


def test_all_digits_of_a_claim_count_and_a_missing_value_is_one():
    (row, other), place = claims(scenario="search", seed=3)[:2], "search, {}, seed 3"
    found = {**row.metrics, "gospa.mean_m": row.metrics["gospa.mean_m"] * (1 + 1e-8), "time_to_find_s": float("nan")}
    flown = [changed(row, metrics=found), other, changed(other, seed=77), changed(other, status="failed")]
    lines = list(board.find_departures([row, other], flown))
    assert [line.partition(" is ")[0] for line in lines[:2]] == [
        f"{place.format(row.planner)}: {name}" for name in ("gospa.mean_m", "time_to_find_s")
    ]
    assert lines[2:] == [
        f"search, {other.planner}, seed 77: not claimed",
        f"{place.format(other.planner)}: the flight failed",
    ]
    assert not list(board.find_departures([row, other], [row, other]))


def test_planners_are_ranked_and_one_that_lacks_a_world_comes_last(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "entry.toml").write_text('authors = "Me"\nmachine = "a laptop"\nplanners = ["greedy", "random"]\n')
    entry = board.read_entry(folder)
    lines = scores.TRIALS.read_text().splitlines()
    kept = [line for line in lines[1:] if ",greedy," in line or (",random,," in line and not line.startswith("wind,"))]
    entry.results.write_text("\n".join([lines[0], *kept]) + "\n")
    assert len(entry.list_claims()) == 500 + 450
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in board.make_table([folder, ENTRY.folder]).splitlines()
    ]
    names, shares = [row[0] for row in rows[2:]], [int(row[1].split()[0]) for row in rows[2:-1]]
    assert shares == sorted(shares, reverse=True) and names.count("`greedy`") == 2
    assert rows[-1] == ["`random`", "not in all worlds", "0", "mine", "Me", rows[-1][5]]
    pages = {row.planner for row in scores.trials()}
    assert set(ENTRY.planners) == pages - {"hover", "oracle", "oracle-found"}


@pytest.mark.parametrize("text", ["authors = 3", 'authors = "Me"\nmachine = "x"\nplanner = []', "x ="])
def test_an_entry_that_cannot_be_read_is_named_in_one_line(tmp_path, text):
    (tmp_path / "entry.toml").write_text(text)
    with pytest.raises(SystemExit, match=r"entry\.toml: ") as error:
        board.read_entry(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_missions_of_an_entry_are_flown_again_in_its_folder_with_its_own_planner(tmp_path):
    (tmp_path / "mine.py").write_text("from planning.baselines import Greedy\n\nclass Mine(Greedy):\n    pass\n")
    entry = replace(ENTRY, folder=tmp_path, planners=["mine:Mine", "greedy"], results=Path(tmp_path / "results.csv"))
    lines = scores.TRIALS.read_text().splitlines()
    entry.results.write_text("\n".join([lines[0], *(line for line in lines if line.startswith("paper,greedy,,7,"))]))
    assert board.check(entry, "7", ["paper"]) == ["paper, mine:Mine, seed 7: not claimed"]
