"""docs/how-to/rerun.md says what is so: its commands and its Python run, and its entities are there."""

import re
import shlex
import sys
from pathlib import Path

import pytest

pytest.importorskip("rerun")

from rerun.chunk import RrdReader

from sim.__main__ import main

TEXT = (Path(__file__).parents[2] / "docs" / "how-to" / "rerun.md").read_text(encoding="utf-8")


def block(language):
    (content,) = re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.M | re.S)
    return content


def test_its_commands_and_its_python_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for line in block("sh").splitlines():
        words = shlex.split(line)
        monkeypatch.setattr(sys, "argv", [*words, *(["--duration", "1"] if words[1] == "run" else [])])
        main()
    exec(compile(block("python"), "rerun.md", "exec"), {})
    assert "0.0 s  track born: track 0 born and confirmed by UAVs 0, 1 and 2" in capsys.readouterr().out
    paths = {str(chunk.entity_path) for chunk in RrdReader(tmp_path / "found.rrd").stream().to_chunks()}
    named = re.findall(r"`((?:world/|association/|people/|plots|events)[\w/]*)`", TEXT)
    assert len(named) > 10
    for name in named:
        assert any(path == f"/{name}" or path.startswith(f"/{name}/") for path in paths), name
    assert "/plots/planning" in paths  # from summary.json
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2 and "found.rrd" in capsys.readouterr().err
