"""docs/how-to/studies.md says what is so: its study file, its SQL, its Python and its tables."""

import re
import sqlite3
from pathlib import Path

import pytest
from helpers.studies import invented, short

from sim.study.store import NAME, Store
from sim.study.study import STUDIES, adapted, read
from sim.study.tasks import tasks
from sim.study.trial import fly

TEXT = (Path(__file__).parents[2] / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")


def block(language):
    (content,) = re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.M | re.S)
    return content


def test_its_study_file_is_one(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(block("toml"))
    assert len(tasks(read(str(path)))) == 10 * 2 * (1 + 2)


def test_its_query_answers(tmp_path):
    made = short(["hover"], "0-1", factors={"lambda": {"15": {"trees": {"density": 15}}}})
    with Store.opened(tmp_path, "short") as store:
        for task in made:
            store.add(task, invented(task))
    sql = sqlite3.connect(tmp_path / NAME)
    (found,) = sql.execute(block("sql")).fetchall()
    sql.close()
    mean = sum(invented(task).metrics["ospa.share_under_1m"] for task in made) / 2
    assert found == ("15", "hover", pytest.approx(mean))


def test_its_python_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python"), "studies.md", "exec"), {})
    assert "breakdown" in capsys.readouterr().out


def test_its_table_counts_the_packaged_studies():
    rows = re.findall(r"^\| `([\w-]+)` \| .* \| (\d+) \|$", TEXT, flags=re.M)
    counts = {name: len(tasks(adapted(read(name), seeds="0-49"))) for name in STUDIES}
    assert {name: int(count) for name, count in rows} == counts


def test_it_names_every_metric():
    (task,) = short(["hover"], "0")
    for name in fly(task).row.metrics:
        assert f"`{name}`" in TEXT or name.startswith("seconds.")
