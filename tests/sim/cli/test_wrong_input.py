"""Wrong input to a command is one line and exit code 2, and leaves nothing."""

import pytest
from helpers.recordings import record
from helpers.studies import sql

from sim.mission.archive import save
from sim.study.store import SCHEMA

FILES = {
    "broken.toml": b"duration = = 3",
    "nocsv.toml": b'[people]\ntrajectories = "nope.csv"',
    "badcsv.toml": b'[people]\ntrajectories = "bad.csv"',
    "bad.csv": b"t,id,x,y\n0,1,0,zero\n1,1,1,1\n",
    "blank.csv": b"\n \n",
    "binary.toml": b"\xff\xfe\x00",
    "dense.toml": b"study.planners = ['hover']\nfactors.L.160.trees.density = 160",
    "bare.toml": b"planners = ['hover']",
    "grove.toml": b"trees.densty = 3",
    "late.toml": b"duration = -4",
    "far.toml": b"uavs = [{start = [900, 0]}]",
    "odd.toml": b"rates.physics = 241",
    "wood.toml": b"trees.density = 160",
    "crowd.toml": b"trees.density = 0\npeople = {count = 200, paths = []}\narea = {width = 10, height = 10}\n"
    b"uavs = [{start = [0, 0]}]",
    "woods.toml": b"study = {planners = ['hover'], scenarios = ['forest', 'wood.toml']}",
    "crowds.toml": b"study = {planners = ['hover'], scenarios = ['crowd.toml']}",
    "full/summary.json": b"{}",
    "full/grove.toml": b"",
    "h.toml": b"",
    "f.toml": b"",
    "other/file": b"",
    "there.mp4": b"mine",
    "there.png": b"mine",
}
COMMANDS = {
    "unknown command": (
        ["flyy"],
        ["'flyy'", "run, compare, track, frames, replay, explain, export, planners"],
    ),
    "misspelt command": (["rum"], ["'rum'", "did you mean run?"]),
    "unknown option": (["run", "--sead", "3"], ["--sead", "--seed"]),
    "extra argument": (["run", "forest", "grove"], ["grove"]),
    "option without value": (["run", "--out"], ["--out"]),
    "unknown scenario": (["run", "forrest"], ["scenario", "'forrest'", "did you mean forest?"]),
    "missing file": (["run", "missing.toml"], ["scenario", "missing.toml"]),
    "broken TOML": (["run", "broken.toml"], ["broken.toml", "line 1"]),
    "no text": (["run", "binary.toml"], ["binary.toml"]),
    "near file": (["run", "groves.toml"], ["scenario: there is no file groves.toml; did you mean grove.toml?"]),
    "file of the name of a packaged one": (
        ["run", "forest.toml"],
        ["no file forest.toml; did you mean forest, which is packaged?"],
    ),
    "no near file": (["run", "nothere.toml"], ["scenario: there is no file nothere.toml\n"]),
    "near file elsewhere": (["run", "full/groves.toml"], ["no file full/groves.toml; did you mean full/grove.toml?"]),
    "misspelt key": (["run", "grove.toml"], ["grove.toml: trees.densty: unknown key", "did you mean density?"]),
    "misspelt key beside another": (
        ["run", "grove.toml", "--set", "trees.density=3"],
        ["understory: grove.toml: trees.densty: unknown key"],
    ),
    "value out of range": (["run", "late.toml"], ["understory: late.toml: duration: -4 is not", "`float` > 0.0"]),
    "UAV outside": (["run", "far.toml"], ["far.toml: uavs.0.start: [900.0, 0.0]", "|x| <= 75 and |y| <= 50 m"]),
    "rates that do not divide": (["run", "odd.toml"], ["odd.toml: rates: physics 241 Hz", "as 240 or 245 would be"]),
    "trees that do not fit": (["run", "wood.toml"], ["understory: wood.toml: trees.density = 160: ", "lower the"]),
    "people that do not fit": (["run", "crowd.toml"], ["crowd.toml: people.count = 200: ", "allowed are"]),
    "trees that do not fit apart": (
        ["run", "wood.toml", "--timeout", "99"],
        ["understory: wood.toml: trees.density = 160: "],
    ),
    "folder as file": (["run", "full"], ["scenario", "'full'"]),
    "missing CSV": (["run", "nocsv.toml"], ["people.trajectories", "nope.csv", "No such file"]),
    "broken CSV": (["run", "badcsv.toml"], ["bad.csv, line 2, column y", "'zero'"]),
    "unknown unit": (["run", "--duration", "40 furlongs"], ["--duration", "'furlongs'", "s, ms, min, h"]),
    "near unit": (["run", "--duration", "1mins"], ["--duration", "'1mins'", "did you mean min?"]),
    "no duration": (["run", "--duration", "long"], ["--duration", "'long'", "1.5min"]),
    "negative duration": (["run", "--duration", "-5"], ["--duration", "'-5'", "more than 0 s"]),
    "two planners": (["run", "--planner", "hover", "--planner", "greedy"], ["--planner: given more than once"]),
    "a key twice": (["run", "--set", "duration=4", "--set", "duration=5"], ["--set: duration is given more than once"]),
    "two durations": (
        ["run", "--duration", "5", "--set", "duration=4"],
        ["--duration: not allowed together with --set duration"],
    ),
    "endless duration": (["run", "--duration", "inf"], ["--duration", "'inf'"]),
    "negative seed": (["run", "--seed", "-1"], ["--seed", "'-1'", "an integer, 0 to 3402823669"]),
    "no repeat": (["run", "--repeat", ""], ["--repeat: '' is not allowed; expected an integer, 0 to 9999\n"]),
    "unknown planner": (["run", "--planner", "hoover"], ["planner", "'hoover'", "did you mean hover?"]),
    "planner by no name": (["run", "--planner", "mine"], ["'mine'", "package.module:Class"]),
    "folder with a run": (["run", "--out", "full"], ["--out", "full", "already holds a run"]),
    "folder with something": (["run", "--out", "other"], ["--out", "other", "not an empty folder"]),
    "file for a folder": (["run", "--out", "bad.csv"], ["--out", "bad.csv", "not an empty folder"]),
    "folder in a file": (["run", "--out", "bad.csv/run"], ["--out", "bad.csv/run", "cannot be written"]),
    "folder that cannot be": (["run", "--out", "/proc/a/run"], ["--out", "/proc/a/run", "cannot be written"]),
    "name too long": (["run", "--out", f"new/{'a' * 300}"], ["--out", "cannot be written", "too long"]),
    "folder without a name": (["run", "--out", ""], ["--out", "the name of a new folder"]),
    "unknown format": (["export", "full", "--to", "cvs"], ["--to", "'cvs'", "did you mean csv?"]),
    "export of no run": (["export", "full", "--to", "csv"], ["DIR", "full", "holds no mission.npz"]),
}
SETTINGS = {
    "trees.density": ["--set", "'trees.density'", "key=value"],
    "trees.density=9000": ["trees.density", "9000", "no more than 203"],
    "trees.density=160": ["trees.density", "160", "fit into 150 x 100 m"],
    "people.trajectories=no.csv": ["people.trajectories", "no.csv"],
    "people.trajectories=plaz": ["people.trajectories: 'plaz' is unknown", "did you mean plaza? (or a .csv file)"],
    "people.trajectories=blank.csv": ["blank.csv: is empty", "time,id,x,y"],
    "area.width=60 uavs=[{start=[0,0]}]": ["people.paths[0]", "(-30, -18)", "|x| <= 29"],
    "area.height=9 uavs=[{start=[0,0]}] trees.density=0": ["area", "150 x 9 m", "10 m"],
    "sensing.detector=blop": ["sensing.detector: 'blop' is unknown; allowed are blob", "did you mean blob?"],
    "seed=3": ["seed: unknown key", "an option: --seed"],
    "sead=3": ["sead: unknown key", "allowed are version, duration"],
}
COMPARISONS = {
    "unknown study": (["paper-horizn"], ["study: 'paper-horizn'", "did you mean paper-horizon?"]),
    "missing file": (["no.toml"], ["no file no.toml"]),
    "planners of no study": (["bare.toml"], ["unknown key; it is not part of a scenario, but one of a study"]),
    "seeds out of order": (["--seeds", "9-0"], ["--seeds", "'9-0'", "0-9 or 0,3,7"]),
    "no repeat": (["--repeats", "0"], ["--repeats: '0' is not allowed; expected an integer, 1 to 10000\n"]),
    "no worker": (["--workers", "0"], ["--workers", "'0'", "an integer, 1 to 1024"]),
    "workers of a cluster": (
        ["--workers", "2", "--dask", "tcp://a:1"],
        ["--workers: not allowed together with --dask"],
    ),
    "unknown thing to keep": (["--keep", "recording"], ["--keep: 'recording'", "did you mean recordings?"]),
    "timeout of nothing": (["--timeout", "0"], ["--timeout", "more than 0 s"]),
    "one wrong planner": (["--planner", "hover", "--planner", "gredy"], ["'gredy'", "did you mean greedy?"]),
    "planner as a key": (["--set", "planner=hover"], ["planner: unknown key", "an option: --planner"]),
    "unknown detector": (["--set", "sensing.detector=blobs"], ["sensing.detector: 'blobs'", "did you mean blob?"]),
    "label without a planner": (["--label", "short"], ["--label: 'short'", "label=planner"]),
    "label of an unknown planner": (["--label", "a=hoover"], ["--label: 'hoover' is not one of"]),
    "one label for two": (["--label", "a=hover", "--label", "a=greedy"], ["'a' would stand for two"]),
    "world of another study": (["bench-1", "--scenario", "forrest"], ["--scenario: 'forrest'", "did you mean forest?"]),
    "varied key": (["faults", "--set", "network.loss=0.1"], ["network.loss is what factor 'fault'"]),
    "forest that cannot be": (["--set", "trees.density=160"], ["trees.density = 160"]),
    "the same with trackers": (
        ["--set", "trees.density=160", "--tracker", "jpda"],
        ["understory: trees.density = 160"],
    ),
    "level that cannot be": (["dense.toml"], ["dense.toml: factors.L.160: trees.density = 160"]),
    "key of a scenario": (["grove.toml"], ["understory: grove.toml: trees.densty: unknown key"]),
    "scenario that cannot be": (["wood.toml"], ["understory: wood.toml: trees.density = 160: "]),
    "one that cannot be": (["woods.toml"], ["understory: woods.toml: wood.toml: trees.density = 160: "]),
    "people that do not fit": (["crowds.toml"], ["understory: crowds.toml: crowd.toml: people.count = 200: "]),
    "newer store": (["--out", "newer"], [f"store of version {SCHEMA + 1}", f"reads {SCHEMA}"]),
    "folder of a mission": (["--out", "run"], ["--out: run holds a mission; allowed is a new folder"]),
    "file for a folder": (
        ["--out", "bad.csv"],
        ["--out: bad.csv is not a folder; allowed is a new folder, or that of a study\n"],
    ),
    "folder in a file": (["--out", "bad.csv/study"], ["--out: bad.csv/study", "cannot be used"]),
    "folder that cannot be": (["--out", "/proc/study"], ["--out: /proc/study", "cannot be used"]),
    "dask that does not answer": (["--dask", "nonsense://x"], ["--dask: 'nonsense://x' does not answer"]),
}
FRAMES = {
    "no such folder": (["nowhere", "--uav", "0", "--time", "1"], ["DIR", "nowhere does not exist"]),
    "no recording inside": ([".", "--uav", "0", "--time", "1"], ["DIR", "holds no mission.npz"]),
    "no such UAV": (["run", "--uav", "3", "--time", "1"], ["--uav", "'3'", "0 to 2"]),
    "no UAV": (["run", "--time", "1"], ["--uav"]),
    "no time": (["run", "--uav", "0"], ["--time"]),
    "beyond the end": (["run", "--uav", "0", "--time", "2.5"], ["--time", "2.5 s", "0 to 2 s"]),
    "end beyond the end": (["run", "--uav", "0", "--time", "1:50"], ["--time", "50 s", "0 to 2 s"]),
    "before the start": (["run", "--uav", "0", "--time", "-1"], ["--time", "'-1'", "0 s or more"]),
    "end before start": (["run", "--uav", "0", "--time", "2:1"], ["--time", "'2:1'", "no T2 before T"]),
    "no number": (["run", "--uav", "0", "--time", "noon"], ["--time", "'noon'", "1.5min"]),
    "open end": (["run", "--uav", "0", "--time", "1:"], ["--time", "''"]),
    "between scans": (["run", "--uav", "0", "--time", "1.05:1.1"], ["--time", "no scan", "1, 1.2 s"]),
    "too small": (["run", "--uav", "0", "--time", "1", "--size", "9"], ["--size", "'9'", "256 to 4096"]),
    "too large": (["run", "--uav", "0", "--time", "1", "--size", "9000"], ["--size", "'9000'", "256 to 4096"]),
    "folder in use": (["run", "--uav", "0", "--time", "1", "--out", "run"], ["--out", "run", "not an empty folder"]),
}
REPLAYS = {
    "two ways": (["--gui", "--video"], ["--gui", "--video", "one at a time"]),
    "film and viewer": (["--video", "--rerun", "a.rrd"], ["--rerun", "--video"]),
    "layout of a window": (["--gui", "--layout", "map"], ["--layout", "--gui"]),
    "speed of a file": (["--rerun", "a.rrd", "--speed", "2"], ["--speed", "--rerun"]),
    "file of a window": (["--gui", "--out", "a.mp4"], ["--out: not", "belongs to --video and --page\n"]),
    "speed of a page": (["--page", "--speed", "2"], ["--speed: not", "belongs to --video and --gui\n"]),
    "layout of a page": (["--page", "--layout", "map"], ["--layout: not", "belongs to --video\n"]),
    "unknown layout": (["--layout", "cameraz"], ["--layout", "'cameraz'", "cameras"]),
    "no such UAV": (["--layout", "uav3"], ["--layout", "'uav3'", "uav2"]),
    "no speed": (["--speed", "fast"], ["--speed", "'fast'", "0.05 to 20"]),
    "no speed at all": (["--speed", "0"], ["--speed", "'0'", "0.05 to 20"]),
    "one time": (["--time", "1"], ["--time", "'1'", "12:20"]),
    "beyond the end": (["--time", "1:9"], ["--time", "9 s", "0 to 2 s"]),
    "no film": (["--out", "a.gif"], ["--out", "'a.gif'", ".mp4"]),
    "film in use": (["--out", "there.mp4"], ["--out", "there.mp4 exists"]),
    "no folder": (["--out", "no/a.mp4"], ["--out", "no folder no"]),
    "no file of the viewer": (["--rerun", "a.mp4"], ["--rerun", "'a.mp4'", ".rrd", "spawn"]),
}
EXPLANATIONS = {
    "no such folder": (["nowhere"], ["DIR: nowhere does not exist\n"]),
    "beyond the end": (["run", "--time", "2.3", "--target", "0"], ["--time: 2.3 s is not in the recording; allowed"]),
    "no such person": (["run", "--time", "1", "--target", "4"], ["--target: '4' is not", "an integer, 0 to 3"]),
    "time of no person": (["run", "--time", "1"], ["--target: missing"]),
    "no time": (["run", "--time", "soon", "--target", "0"], ["--time: 'soon' is not a time"]),
    "two times": (["run", "--time", "0:1", "--target", "0"], ["--time: '0:1' is not allowed; expected one time"]),
    "picture in use": (["run", "--out", "there.png"], ["--out: there.png exists; name a new file"]),
    "no picture": (["run", "--out", "timeline.pdf"], ["--out: 'timeline.pdf' is not allowed", "a new file that ends"]),
    "no folder": (["run", "--out", "no/where.png"], ["--out: no/where.png cannot be written: there is no folder no"]),
    "no person": (["none", "--target", "0"], ["--target: '0' is not allowed; no person walked in this mission\n"]),
}
WRONG = {
    **COMMANDS,
    **{text: (["run", *(w for s in text.split() for w in ("--set", s))], words) for text, words in SETTINGS.items()},
    **{f"compare: {name}": (["compare", *arguments], words) for name, (arguments, words) in COMPARISONS.items()},
    **{f"frames: {name}": (["frames", *arguments], words) for name, (arguments, words) in FRAMES.items()},
    **{f"replay: {name}": (["replay", "run", *arguments], words) for name, (arguments, words) in REPLAYS.items()},
    **{f"explain: {name}": (["explain", *arguments], words) for name, (arguments, words) in EXPLANATIONS.items()},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with wrong files, a newer store, and a recording of 2 s; no command here may change it."""
    folder = tmp_path_factory.mktemp("refusals")
    for name in ("full", "other", "newer", "run", "none"):
        (folder / name).mkdir()
    for name, content in FILES.items():
        (folder / name).write_bytes(content)
    sql(folder / "newer", f"PRAGMA user_version = {SCHEMA + 1}")
    save(record(), folder / "run" / "mission.npz")
    save(record(people=0), folder / "none" / "mission.npz")
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    # The first takes a process, which test_timed_run tries, too.
    [pytest.param(*w, marks=[pytest.mark.slow] * ("--timeout" in w[0][:3])) for w in WRONG.values()],
    ids=WRONG,
)
def test_wrong_input_is_one_line_exit_code_2_and_leaves_nothing(refused, folder, monkeypatch, arguments, words):
    monkeypatch.chdir(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    told = refused(*arguments)
    for word in words:
        assert word in told
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before
