"""The first run says that code is compiled; later ones load it; and it works where nothing can be kept."""

import os
import re
import shutil
from pathlib import Path

import numba
import pytest
from helpers.processes import ROOT, python

from sim.mission.warmup import announce_compilation
from tracking.numerics import compiled as subject

LISTING = ("sim.mission.warmup", "sim.mission.compilation", "tracking.numerics.compiled")  # the compiled functions


def twice(x):
    return 2 * x


def thrice(x):
    return 3 * twice_compiled(x)


twice_compiled = numba.njit(twice)


def test_compiling_is_announced_and_timed_once_however_functions_call_each_other(monkeypatch, tmp_path):
    said, done = [], []
    named = {f"{__name__}.{name}": tmp_path for name in ("once", "twice", "thrice")}
    for module in LISTING:
        monkeypatch.setattr(f"{module}.functions", named)
    function = numba.njit(thrice)
    with announce_compilation(said.append, done.append):
        assert said == [] and function(7) == 42 and function(7.0) == 42.0
    assert len(said) == 2 and said[0] == "Compiling the numerical code, which takes a minute or two."
    assert re.fullmatch(r"Compiled in \d+ s; it is kept for later runs\.", said[1])
    assert done == [(1, 3), (2, 3)]
    with announce_compilation(said.append, done.append):
        function(8)
    assert (len(said), len(done)) == (2, 2)


@pytest.fixture
def places(monkeypatch):
    """Set the folders that compiled code may be kept in, and which of them can be written to."""

    def set_places(folders, writable):
        monkeypatch.setattr(subject, "_list_code_folders", lambda: iter(folders))
        monkeypatch.setattr(subject, "_can_write", lambda folder: folder in writable)
        monkeypatch.setattr(subject, "not_kept", kept := [])
        monkeypatch.setattr("sim.mission.warmup.not_kept", kept)
        named = {}  # not the product's, which may not be compiled yet
        for module in LISTING:
            monkeypatch.setattr(f"{module}.functions", named)
        subject.code_folder.cache_clear()
        subject._prepare_folder.cache_clear()
        subject.digest_of.cache_clear()

    yield set_places
    monkeypatch.undo()
    subject.code_folder.cache_clear()
    subject.digest_of.cache_clear()


def test_where_nothing_can_be_kept_code_works_and_that_is_said(places, tmp_path):
    places([tmp_path], [])
    said = []
    with announce_compilation(said.append):
        assert subject.compiled(twice)(21) == 42
    assert subject.not_kept == ["twice"]
    assert re.fullmatch(r"Compiled in \d+ s; no folder .* compiled anew each time; NUMBA_CACHE_DIR may .*", said[1])


def test_code_is_kept_in_the_first_folder_that_can_be_written(tmp_path, monkeypatch):
    """Named, of the installation, of the user, temporary. A file in a folder's place keeps even root from writing."""
    site, user, temporary = tmp_path / "site" / "tracking", tmp_path / "user", tmp_path / "temporary"
    for folder in site, temporary:
        folder.mkdir(parents=True)
    monkeypatch.setattr(subject, "__file__", str(site / "numerics" / "compiled.py"))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "named"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(user))
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    found = []
    for blocked in (None, tmp_path / "named", site / "__pycache__", user):
        if blocked:
            shutil.rmtree(blocked)
            blocked.touch()
        subject.code_folder.cache_clear()
        found.append(subject.code_folder().parent)
    subject.code_folder.cache_clear()
    assert found == [tmp_path / "named", site / "__pycache__", user, temporary]


@pytest.mark.parametrize("holder", ["NUMBA_CACHE_DIR", "installation"])
@pytest.mark.parametrize("home", [None, "nowhere"])
def test_code_that_is_there_is_read_where_only_temporary_files_can_be_written(
    places, tmp_path, monkeypatch, home, holder
):
    """As a user of an image that was built by another one: without a home, or with one that is not there."""
    find_folders = subject._list_code_folders
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setattr(subject, "__file__", str(tmp_path / "tracking" / "numerics" / "compiled.py"))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "named") if holder == "NUMBA_CACHE_DIR" else "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / home)) if home else monkeypatch.delenv("HOME")
    folders = list(find_folders())
    assert [folder.parent for folder in folders[-2:]] == [Path("~/.cache").expanduser(), temporary]
    filled, written = folders[0], folders[-1]
    places(folders, [filled])
    assert subject.compiled(twice)(21) == 42 and list(filled.rglob("*.nbc"))
    places(folders, [written])
    said = []
    with announce_compilation(said.append):
        assert subject.compiled(twice)(21) == 42
    assert said == [] and list(written.rglob("*.nbc"))


def test_code_of_changed_sources_is_made_anew_and_only_the_last_before_it_stays(places, tmp_path, monkeypatch):
    home, module, below = tmp_path / "home", tmp_path / "tracking" / "above.py", tmp_path / "tracking" / "below.py"
    module.parent.mkdir()
    module.write_text("from tracking.below import SCALE\n")
    monkeypatch.setattr(subject, "_ROOT", tmp_path)
    made = []
    for scale in range(4):
        below.write_text(f"SCALE = {scale}\n")
        places([home], [home])
        made.append(subject._prepare_folder(module, home))
        made[-1].mkdir(parents=True)
        os.utime(made[-1], (scale, scale))
    assert sorted(home.iterdir()) == sorted(made[-2:])


def test_the_temporary_folder_holds_code_of_this_user_alone(tmp_path):
    mine = tmp_path / "mine"
    assert subject._is_private(mine) and subject._is_private(mine)
    mine.chmod(0o777)
    assert not subject._is_private(mine)
    (tmp_path / "link").symlink_to(tmp_path)
    assert not subject._is_private(tmp_path / "link") and not subject._is_private(tmp_path / "no" / "folder")


def flown(folder, name, **environment):
    words = ["-m", "sim", "run", "--duration", "1", "--no-video", "--out", name]
    done = python(*words, cwd=folder, **environment)
    assert (done.returncode, done.stderr) == (0, "")
    return [line for line in done.stdout.splitlines() if "ompil" in line], (folder / name / "mission.npz").read_bytes()


@pytest.mark.slow
def test_the_first_run_says_that_it_compiles_and_the_second_nothing(tmp_path):
    # Another installation: this one's compiled code would be copied into a new folder.
    for name in ("assets", "planning", "sim", "tracking"):
        shutil.copytree(ROOT / name, tmp_path / "copy" / name, ignore=shutil.ignore_patterns("__pycache__"))
    cache = {"PYTHONPATH": str(tmp_path / "copy"), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first, recording = flown(tmp_path, "first", **cache)
    assert first[0] == "Compiling the numerical code, which takes a minute or two."
    told = [re.match(r"compiling: (\d+) of (\d+) functions", line) for line in first[1:-1]]  # of a slow machine
    assert all(int(line[1]) <= int(line[2]) > 100 for line in told)
    assert re.fullmatch(r"Compiled in \d+ s; it is kept for later runs\.", first[-1])
    assert flown(tmp_path, "second", **cache) == ([], recording)


@pytest.mark.slow
def test_a_run_without_any_cache_flies_the_same(tmp_path):
    said, recording = flown(tmp_path, "uncached", NUMBA_CACHE_LOCATOR_CLASSES="IPythonCacheLocator")
    assert len(said) == 2 and "NUMBA_CACHE_DIR" in said[1]
    assert flown(tmp_path, "cached")[1] == recording


def test_code_runs_as_python_for_debugging():
    code = "from tracking.numerics.exponential import exp, exp_each; print(exp(0.0), exp_each([0.0])[0])"
    done = python("-c", code, NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stdout) == (0, "1.0 1.0\n")
