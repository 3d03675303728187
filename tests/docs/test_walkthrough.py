"""docs/tutorials/lost-person.md: each command runs, and says what stands below it."""

import re
import shlex
import shutil
import sys
from pathlib import Path

from sim import __main__ as cli
from sim.recording.archive import load
from sim.terminal import console

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "tutorials" / "lost-person.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", TEXT, flags=re.M | re.S)


def test_its_commands_say_what_it_shows(tmp_path, monkeypatch, capsys):
    shutil.copytree(DOCS / "examples" / "grove", tmp_path / "docs" / "examples" / "grove")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(console.console, "width", 200)
    told, quoted = [], 0
    for language, content in BLOCKS:
        if language == "text":
            for line in content.splitlines():
                assert line in told, line
                quoted += 1
            continue
        for command in content.splitlines():
            short = ["--duration", "3"] if " run " in command else []
            monkeypatch.setattr(sys, "argv", [*shlex.split(command), *short])
            cli.main()
            told += [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert quoted > 15
    made = {path.name for path in (tmp_path / "runs").iterdir()}
    pictures = {"timeline.png", "lost.png", "before.png", "frames", "plan.png", "regained.mp4"}
    assert made == {"grove", "grove-oracle", *pictures}
    assert len(list((tmp_path / "runs" / "frames").iterdir())) == 10


def test_the_recording_is_of_the_scenario(tmp_path):
    from sim.replay.frames.rerender import scenario_of
    from sim.scenario.loading import load as load_scenario

    recording = load(DOCS / "examples" / "grove" / "mission.npz")
    grove = str(DOCS / "examples" / "grove" / "grove.toml")
    assert scenario_of(recording) == load_scenario(grove, ("tracking.absence_weight=0.3",))  # as the page says
    assert recording.seed == 7 and len(recording.trees) == 12 and len(recording.times) == 151
