"""docs/how-to/replay.md: its commands work in the order given, and its Python runs."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from sim import __main__ as cli

TEXT = (Path(__file__).parents[2] / "docs" / "how-to" / "replay.md").read_text(encoding="utf-8")


def test_its_commands_and_its_python_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delenv("DISPLAY", raising=False)
    blocks = re.findall(r"^```(sh|python)\n(.*?)^```$", TEXT, flags=re.M | re.S)
    assert [kind for kind, _ in blocks] == ["sh"] * 5 + ["python"]
    for kind, text in blocks:
        if kind == "python":
            exec(compile(text, "replay.md", "exec"), {})
            continue
        if "--rerun" in text:
            pytest.importorskip("rerun")
        (line,) = text.splitlines()
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        if "--gui" in line:  # as the page says of a machine without a display
            with pytest.raises(SystemExit) as end:
                cli.main()
            assert end.value.code == 2
        else:
            cli.main()
    run = tmp_path / "runs" / "short"
    assert (run / "replay.mp4").stat().st_size == (run / "mission.mp4").stat().st_size
    assert (tmp_path / "uav1.mp4").is_file() and (tmp_path / "short.rrd").is_file()
