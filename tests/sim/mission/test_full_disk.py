"""On a full disk every command says so in one line, and leaves nothing unfinished."""

import resource
from contextlib import contextmanager

import pytest
from helpers.hostile_stores import recording

COMMANDS = {
    "frames": ["frames", "run", "--uav", "0", "--time", "0:0.4"],
    "export": ["export", "run", "--to", "csv"],
    "film": ["replay", "run", "--layout", "map"],
    "page": ["replay", "run", "--page"],
    "picture": ["explain", "run", "--time", "0.4", "--target", "1"],
    "timeline": ["explain", "run"],
    "mission": ["run", "--duration", "0.4", "--set", "sensing.mode=ideal", "--out", "new/out"],
}
SUFFIXES = {"film": ".mp4", "page": ".html", "picture": ".png"}
PLACES = [(c, place + s, "there is no folder") for c, s in SUFFIXES.items() for place in ("file/new", "no/new")]
PLACES += [(command, "file/new", "Not a directory") for command in ("frames", "export", "mission")]


@contextmanager
def small_files():
    """No file may grow beyond a kilobyte, as on a disk that is full: EFBIG instead of ENOSPC."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture(autouse=True)
def files(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mission.npz").write_bytes(recording())
    (tmp_path / "file").write_text("no folder")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_disk_is_told_in_one_line_and_nothing_is_kept(refused, tmp_path, command, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with small_files():
        err = refused(*COMMANDS[command], code=1)
    assert "File too large; nothing is kept" in err


@pytest.mark.parametrize(("command", "place", "reason"), PLACES)
def test_a_place_that_cannot_be_written_to_is_told_before_anything_is_drawn(refused, command, place, reason):
    words = [*COMMANDS[command], "--out"]
    assert f"--out: {place} cannot be written: {reason}" in refused(*words[: words.index("--out") + 1], place)
