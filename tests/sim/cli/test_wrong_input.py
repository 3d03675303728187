"""Wrong input to a command is one line and exit code 2, and leaves nothing; one case of each kind."""

import shlex

import pytest
from helpers.recordings import record
from helpers.studies import sql

from sim.mission.archive import save
from sim.study.store import SCHEMA

FILES = {
    "broken.toml": b"duration = = 3",
    "nocsv.toml": b'[people]\ntrajectories = "nope.csv"',
    "bad.csv": b"t,id,x,y\n0,1,0,zero\n1,1,1,1\n",
    "dense.toml": b"study.planners = ['hover']\nfactors.L.160.trees.density = 160",
    "bare.toml": b"planners = ['hover']",
    "grove.toml": b"trees.densty = 3",
    "far.toml": b"uavs = [{start = [900, 0]}]",
    "wood.toml": b"trees.density = 160",
    "full/summary.json": b"{}",
    "there.mp4": b"mine",
}
WRONG = {
    # commands and options
    "rum": "'rum' is unknown; ... did you mean run?",
    "run --sead 3": "--seed",
    "run --out": "--out",
    "run --planner hover --planner greedy": "--planner: given more than once",
    # scenarios and their files
    "run forrest": "scenario: 'forrest' is unknown; ... did you mean forest?",
    "run full": "scenario: 'full'",
    "run broken.toml": "broken.toml: ...line 1",
    "run grove.toml --set trees.density=3": "understory: grove.toml: trees.densty: unknown key; ... mean density?",
    "run far.toml": "far.toml: uavs.0.start: [900.0, 0.0]...|x| <= 75 and |y| <= 50 m",
    "run wood.toml": "understory: wood.toml: trees.density = 160: ... lower the",
    "run nocsv.toml": "people.trajectories: ...nope.csv...No such file",
    # values
    "run --duration 1mins": "--duration: ...'1mins'... did you mean min?",
    "run --duration 5 --set duration=4": "--duration: not allowed together with --set duration",
    "run --set trees.density": "--set: 'trees.density' ...key=value",
    "run --set seed=3": "seed: unknown key; ...an option: --seed",
    "run --planner hoover": "planner: 'hoover' is unknown; ... did you mean hover?",
    "run --set sensing.detector=blop": "sensing.detector: 'blop' is unknown; ... did you mean blob?",
    # places
    "run --out full": "--out: full already holds a run",
    "run --out /proc/a/run": "--out: /proc/a/run cannot be written",
    "export full --to csv": "DIR: full holds no mission.npz",
    # comparisons
    "compare paper-horizn": "study: 'paper-horizn' is unknown; ... did you mean paper-horizon?",
    "compare bare.toml": "unknown key; it is not part of a scenario, but one of a study",
    "compare --workers 2 --dask tcp://a:1": "--workers: not allowed together with --dask",
    "compare --dask nonsense://x": "--dask: 'nonsense://x' does not answer",
    "compare faults --set network.loss=0.1": "network.loss is what factor 'fault'",
    "compare dense.toml": "dense.toml: factors.L.160: trees.density = 160",
    "compare --out newer": f"store of version {SCHEMA + 1}... reads {SCHEMA}",
    "compare --out run": "--out: run holds a mission; allowed is a new folder",
    "compare --out bad.csv": "--out: bad.csv is not a folder; allowed is a new folder, or that of a study\n",
    # recordings
    "frames nowhere --uav 0 --time 1": "DIR: nowhere does not exist",
    "frames run --uav 3 --time 1": "--uav: '3' ...0 to 2",
    "frames run --uav 0 --time 1:50": "--time: 50 s ...0 to 2 s",
    "frames run --uav 0 --time 1.05:1.1": "--time: ...no scan... 1, 1.2 s",
    "replay run --gui --video": "--gui: ...--video; ...one at a time",
    "replay run --page --speed 2": "--speed: not ...belongs to --video and --gui\n",
    "replay run --out a.gif": "--out: 'a.gif' ... ends in .mp4",
    "replay run --out there.mp4": "--out: there.mp4 exists; name a new file",
    "explain run --time 1": "--target: missing",
    "explain none --target 0": "--target: '0' is not allowed; no person walked in this mission\n",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with wrong files, a newer store, and a recording of 2 s; no command here may change it."""
    folder = tmp_path_factory.mktemp("refusals")
    for name in ("full", "newer", "run", "none"):
        (folder / name).mkdir()
    for name, content in FILES.items():
        (folder / name).write_bytes(content)
    sql(folder / "newer", f"PRAGMA user_version = {SCHEMA + 1}")
    save(record(), folder / "run" / "mission.npz")
    save(record(people=0), folder / "none" / "mission.npz")
    return folder


@pytest.mark.parametrize("line", WRONG)
def test_wrong_input_is_one_line_exit_code_2_and_leaves_nothing(refused, folder, monkeypatch, line):
    monkeypatch.chdir(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    told = refused(*shlex.split(line))
    at = 0
    for words in WRONG[line].split("..."):  # in this order
        assert words in told[at:], told
        at = told.index(words, at)
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before
