"""Places that commands make up themselves, when several run at the same time."""

import threading
from pathlib import Path

import pytest
from helpers.hostile_stores import recording

from sim.mission.atomic_files import claim_place, make_new_folder

SHORT = "--duration 0.2 --planner hover --set sensing.mode=ideal"
COMMANDS = {  # words, default place, suffix
    "run": (f"run {SHORT} --no-video", "runs/forest-hover-seed0", ""),
    "frames": ("frames run --uav 0 --time 0", "run/frames-uav0-0s", ""),
    "export": ("export run --to csv", "run/export-csv", ""),
    "film": ("replay run --layout map --time 0:0.2", "run/replay", ".mp4"),
    "page": ("replay run --page", "run/mission", ".html"),
    "picture": ("explain run --target 1 --time 0.4", "run/explain-target1-0.4s", ".png"),
}
TIMED = (f"run {SHORT} --no-video --timeout 99", "runs/forest-hover-seed0", "")


@pytest.mark.parametrize("suffix", ["", ".png"])
def test_of_eight_at_a_time_each_gets_a_place_of_its_own_and_leaves_nothing_else(tmp_path, suffix):
    together = threading.Barrier(8)
    places = []

    def write(number):
        together.wait()
        with claim_place(None, tmp_path / "runs" / "out", suffix) as place:
            together.wait()  # all have asked before the first has results
            if suffix:
                place.write_text(str(number))
            else:
                with make_new_folder(place) as folder:
                    (folder / str(number)).touch()
            places.append(place)

    threads = [threading.Thread(target=write, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    names = [f"out{suffix}", *(f"out-{k}{suffix}" for k in range(2, 9))]
    assert sorted(path.name for path in places) == sorted(names)
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == sorted(names)
    found = [path.read_text() if suffix else next(path.iterdir()).name for path in places]
    assert sorted(found) == [str(k) for k in range(8)]


@pytest.mark.parametrize(
    ("words", "stem", "suffix"),
    [
        *(pytest.param(*values, id=name) for name, values in COMMANDS.items()),
        pytest.param(*TIMED, id="run with a limit of time", marks=pytest.mark.slow),  # starts a process
    ],
)
def test_a_command_takes_the_next_place_if_another_writes_to_the_first(call, tmp_path, words, stem, suffix):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mission.npz").write_bytes(recording())
    with claim_place(None, tmp_path / stem, suffix) as first:
        code, out, err = call(*words.split())
        assert (code, err, first.exists()) == (0, "", False)
        assert f"{stem}-2{suffix}" in out and (tmp_path / f"{stem}-2{suffix}").exists()


def test_what_a_failure_made_is_removed(tmp_path):
    with pytest.raises(RuntimeError), claim_place(None, tmp_path / "runs" / "deep" / "out"):
        assert (tmp_path / "runs" / "deep").is_dir()
        raise RuntimeError
    assert not list(tmp_path.iterdir())


def test_a_place_that_was_asked_for_is_not_claimed(tmp_path):
    asked = tmp_path / "runs" / "mine"
    with claim_place(asked, Path("unused")) as place:
        assert place is asked and not list(tmp_path.iterdir())
