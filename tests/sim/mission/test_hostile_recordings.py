"""A recording may come from any source: one clear line, soon, in little memory, and nothing runs."""

import errno
import json
import os
import struct
import sys
import zipfile
from functools import cache

import numpy as np
import pytest
from helpers import synthetic
from helpers.processes import python
from helpers.recordings import assert_same, npy, record, rewritten
from helpers.summaries import summary
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim.exchange.export import export
from sim.facts.people import PeopleFacts
from sim.mission.archive import find_recording, load_recording, save
from sim.mission.npz import MOST_BYTES
from sim.mission.recording import LONGEST_FAULT, MOST_FAULTS
from sim.scenario.scenario import encode_scenario
from sim.views.frames.frame_panels import write_frames
from tracking.errors import InputError

FLEET = json.loads(encode_scenario(synthetic.scenario()))


def header(descr, shape):
    """Times of which there is nothing but the header, with this text for the data type and for the shape."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text) + 1) + text.encode() + b"\n"
    return lambda recording: {"times": array}


def changed(name, *index, to):
    """A field of the recording with one entry changed, as the content of its member."""

    def content(recording):
        array = np.array(getattr(recording, name))
        array[index] = to
        return {name: npy(array)}

    return content


def text(name, value):
    return lambda recording: {name: npy(np.array(value))}


def setting(**changes):
    return text("scenario", json.dumps(FLEET | changes))


def faults(*rows):
    return text("faults", json.dumps([dict(zip(("time", "uav", "message"), row, strict=True)) for row in rows]))


HUGE = 10**17
DAMAGED = {
    "a lying header": (header("'<f8'", "(11,)"), "'times': cannot be read: EOF: reading array data, expected 88"),
    "a great number of scans": (header("'<f8'", f"({2**31},)"), "'times': cannot be read: "),
    "an absurd number of scans": (header("'<f8'", f"({HUGE},)"), "'times': cannot be read: "),
    "a negative dimension": (header("'<f8'", "(-1,)"), "'times': cannot be read: negative dimensions"),
    "code for a header": (header("print(1)", "(11,)"), "'times': cannot be read: malformed"),
    "code for a shape": (header("'<f8'", "(exit(),)"), "'times': cannot be read: malformed"),
    "a nest of brackets": (header("(" * 9000, "(11,)"), "'times': cannot be read: "),
    "a nest of signs": (header("'<f8'", "-" * 9000 + "1"), "'times': cannot be read: "),
    "a structured array": (header("[('a', '<f8')]", "()"), "'times': cannot be read: EOF"),
    "more than its shape needs": (
        lambda r: {"times": npy(r.times) + bytes(8)},
        "'times': cannot be read: holds more bytes than its shape (11,) needs",
    ),
    "objects": (lambda r: {"times": npy(np.array([print] * 11))}, "'times': cannot be read: Object arrays"),
    "big-endian": (lambda r: {"times": npy(r.times.astype(">f8"))}, "'times': has dtype >f8, not <f8"),
    "another archive inside": (
        lambda r: {"times": b"PK\3\4" * 9},
        "'times': cannot be read: the magic string",
    ),
    "nothing of the people": (lambda r: {"people": None}, "another version of understory: it has no field 'people'"),
    "places in space": (lambda r: {"people": npy(np.zeros((11, 4, 3)))}, "'people': has shape (11, 4, 3)"),
    "people in a row": (lambda r: {"people": npy(np.zeros((11, 4)))}, "'people': has shape (11, 4)"),
    "headings of ten scans": (lambda r: {"headings": npy(np.zeros((10, 4)))}, "'headings': has shape (10, 4)"),
    "a planner that is a number": (lambda r: {"planner": npy(np.array(3))}, "'planner': has dtype"),
    "three offsets": (lambda r: {"measurement_offsets": npy(np.zeros(3, int))}, "'measurement_offsets': has shape"),
    "no scans at all": (lambda r: {"times": npy(np.zeros(0))}, "'people': has shape (11, 4, 2)"),
    "a newer version": (lambda r: {"version": npy(np.int64(7))}, "is 7, but this program reads 1: made by a newer"),
    "version zero": (lambda r: {"version": npy(np.int64(0))}, "'version': is 0"),
    "a seed of other digits": (text("seed", "٣"), "'seed': is '٣', not a number of digits 0 to 9"),
    "an endless seed": (text("seed", "9" * 100_000), "'seed': "),
    "a negative seed": (text("seed", "-3"), "'seed': is '-3'"),
    "a planner that clears the screen": (text("planner", "a\x1b[2Jb"), "'planner': is no printable text"),
    "a planner that reads backwards": (text("planner", "a\u202eb"), "'planner': is no printable text"),
    "half a character": (lambda r: {"planner": npy(np.array("x")).replace(b"x\0\0\0", b"\0\xd8\0\0")}, "'planner': "),
    "no character": (lambda r: {"planner": npy(np.array("x")).replace(b"x\0\0\0", b"\xff" * 4)}, "'planner': "),
    "an endless text": (text("planner", "x" * 2**21), "'planner': has dtype <U2097152; at most"),
    "times that stand": (changed("times", 3, to=0.4), "'times': do not rise"),
    "times before the start": (changed("times", 0, to=-1.0), "'times': do not rise"),
    "times without end": (changed("times", 10, to=np.inf), "'times': do not rise"),
    "times of another rate": (changed("times", 9, to=1.9), "recording: its scans are not 0.2 s apart"),
    "half a person": (changed("people", 3, 1, 0, to=np.nan), "'people': have places that are partly NaN"),
    "a person at infinity": (changed("people", 3, 1, to=np.inf), "'people': have places"),
    "a person beyond drawing": (changed("people", 3, 1, to=1e300), "'people': have places"),
    "a pose that is nowhere": (changed("poses", 2, 0, 1, to=np.nan), "'poses': are not finite"),
    "a quaternion of zeros": (changed("cameras", 2, 0, slice(3, 7), to=0.0), "'cameras': have quaternions"),
    "a quaternion too long": (changed("cameras", 2, 0, slice(3, 7), to=1.0), "'cameras': have quaternions"),
    "a tree upside down": (changed("trees", 4, 3, to=1e3), "'trees': have a canopy that ends below its base"),
    "a tree inside out": (changed("trees", 4, 2, to=-1.0), "'trees': have a radius below 0"),
    "a command to infinity": (changed("commands", 1, 1, 1, to=-np.inf), "'commands': are not finite"),
    "offsets that lie": (changed("track_offsets", -1, to=HUGE), "'track_offsets': does not rise from 0 to"),
    "offsets that turn": (changed("measurement_offsets", 5, to=HUGE), "'measurement_offsets': does not rise from 0"),
    "offsets that wrap": (changed("track_offsets", 5, to=-(2**63)), "'track_offsets': does not rise from 0"),
    "half a pixel": (changed("pixels", 0, 0, to=np.nan), "'pixels': are partly NaN"),
    "a covariance of nothing": (changed("track_covariances", 2, to=0.0), "'track_covariances': are no covariances"),
    "a lopsided covariance": (changed("track_covariances", 2, 0, 1, to=9.0), "'track_covariances': are no covariances"),
    "no ellipse": (changed("measurement_covariances", 1, to=[[1, 2], [2, 1]]), "'measurement_covariances': are no"),
    "a track nowhere": (changed("track_means", 2, to=np.nan), "'track_means': are not finite"),
    "a track of no number": (changed("track_ids", 2, to=-5), "'track_ids': are below 0"),
    "a certain maybe": (changed("track_existence", 2, to=1.5), "'track_existence': is no probability"),
    "half an error": (changed("ospa", 2, 0, 1, to=np.nan), "'ospa': is partly NaN"),
    "a plan with a gap": (changed("plans", 0, 0, 1, to=np.nan), "'plans': go on after their end"),
    "half a control": (changed("plans", 0, 0, 1, 0, to=np.nan), "'plans': are partly NaN"),
    "a plan between scans": (changed("plan_times", 0, to=0.1), "'plan_times': do not rise from scan to scan"),
    "fewer than no pixels": (changed("visible", 2, 0, 1, to=-4), "'visible': holds numbers below 0"),
    "fewer than no bytes": (changed("bytes_sent", 2, 0, to=-4), "'bytes_sent': holds numbers below 0"),
    "a truth of 255": (lambda r: {"matched": npy(r.matched)[:-1] + b"\xff"}, "'matched': holds bytes"),
    "a touch of no person": (changed("contacts", 0, 3, to=HUGE), "'contacts': names what is not there"),
    "a touch after the end": (changed("contacts", 0, 0, to=11), "'contacts': names a scan, UAV or kind"),
    "a touch of no UAV": (changed("contacts", 0, 1, to=3), "'contacts': names a scan, UAV or kind"),
    "a touch of no kind": (changed("contacts", 0, 2, to=77), "'contacts': names a scan, UAV or kind"),
    "a fault of no UAV": (faults((0.0, 3, "x")), "'faults': name a time or a UAV that is not there"),
    "a fault after the end": (faults((9e9, 0, "x")), "'faults': name a time or a UAV that is not there"),
    "a fault that clears the screen": (faults((0.0, 0, "\x1b[2J")), "'faults': have a message that is not one line"),
    "a long fault": (faults((0.0, 0, "x" * (LONGEST_FAULT + 1))), "'faults': have a message that is not one line"),
    "too many faults": (faults(*[(0.0, 0, "x")] * (MOST_FAULTS + 1)), "'faults': are more than 1000"),
    "faults that are none": (text("faults", "[1]"), "'faults': is no list of faults"),
    "a nest of faults": (text("faults", "[" * 100_000), "'faults': is no list of faults"),
    "no scenario": (text("scenario", "[]"), "'scenario': is no JSON object"),
    "a nest for a scenario": (text("scenario", '{"a":' * 100_000), "'scenario': is no JSON object"),
    "a scenario of one UAV": (setting(uavs=FLEET["uavs"][:1]), "recording: 3 UAVs flew, but its scenario has 1"),
    "a scenario of others": (setting(people={"count": 999}), "4 people walked, but its scenario has 999"),
    "an endless scenario": (setting(duration=1e300), "its scenario: duration: 1e+300 is not allowed; expected"),
    "UAVs that are a number": (setting(uavs=3), "recording: its scenario: uavs"),
    "a scenario too short": (setting(duration=1.0), "recording: has 11 scans, but its scenario allows at most 6"),
    "a huge number": (setting(duration=10**4000), "recording: its scenario: "),
    "a huge float": (text("scenario", json.dumps(FLEET).replace("40.0", "1e999")), "'scenario': is no JSON object"),
    "a future key": (setting(submarines=3), "submarines: unknown key; allowed are"),
    "a key of two lines": (setting(**{"a\nb\x1b[2J": 3}), "recording: its scenario: a b [2J: unknown key"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_what_no_mission_leaves_is_one_clear_line(saved, tmp_path, case):
    change, reason = DAMAGED[case]
    path = rewritten(saved, tmp_path / "mission.npz", **change(load_recording(saved)))
    with pytest.raises(InputError) as caught:
        find_recording(path)
    message = str(caught.value)
    assert reason in message and message.startswith((f"DIR: {path}: ", "DIR: recording: "))
    assert message.isprintable() and len(message) < 600


def archive(path, members, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as out:
        for name, content in members:
            out.writestr(name, content)


@cache
def zeros():
    """A member of 10 MB that takes 10 kB."""
    return npy(np.zeros((11, 125_000)))


def bomb(path, saved):
    """Nine fair arrays of 100 MB together in a file of under 100 kB."""
    archive(path, [("version.npy", npy(np.int64(1))), *((f"{i}.npy", zeros()) for i in range(9))])


def understated(path, saved):
    """A member that goes on for 10 MB behind the array that its table of contents tells of."""
    content = members(saved)
    size = len(content["people"])
    content["people"] += zeros()
    archive(path, [(f"{name}.npy", data) for name, data in content.items()])
    archived = bytearray(path.read_bytes())
    entry = archived.rindex(b"people.npy") - 46
    assert archived[entry : entry + 4] == b"PK\x01\x02"
    archived[entry + 24 : entry + 28] = struct.pack("<I", size)
    path.write_bytes(archived)


def members(saved):
    with zipfile.ZipFile(saved) as old:
        return {name.removesuffix(".npy"): old.read(name) for name in old.namelist()}


def listing(path, saved):
    """A table of contents of 200 000 members."""
    name = b"x" * 8
    entry = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", 20, 0, 20, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0) + name
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 65535, 65535, 200_000 * len(entry), 0, 0)
    path.write_bytes(entry * 200_000 + end)


def twice(path, saved):
    with pytest.warns(UserWarning, match="Duplicate"):
        archive(path, [(f"{name}.npy", content) for name, content in members(saved).items()] + [("people.npy", b"")])


def other_tool(path, saved):
    np.savez(path, arr_0=np.zeros(3), weights=np.zeros((2, 2)))


def huge(path, saved):
    """A sparse file of 40 GB with a sound end."""
    content = saved.read_bytes()
    with path.open("wb") as file:
        file.seek(40 * 2**30)
        file.write(content)


HOSTILE = {
    "a zip bomb": (bomb, "would inflate to 99"),
    "a bomb that understates itself": (understated, "'people': cannot be read: Bad CRC-32"),
    "a bomb of members": (listing, "too many members"),
    "a bomb of another compression": (
        lambda path, saved: archive(path, [("version.npy", npy(np.int64(1)))], zipfile.ZIP_LZMA),
        "compressed otherwise than by deflate",
    ),
    "two members of one name": (twice, "two members of one name"),
    "another tool's": (other_tool, "not a recording: its arrays are 'arr_0', 'weights'"),
    "nothing": (lambda path, saved: path.write_bytes(b""), "not a recording: is not an npz archive"),
    "the beginning of an archive": (lambda path, saved: path.write_bytes(b"PK\3\4"), "not a recording"),
    "an array alone": (lambda path, saved: path.write_bytes(b"\x93NUMPY" + bytes(100)), "not a recording"),
    "an archive of nothing": (lambda path, saved: archive(path, []), "not a recording: holds nothing"),
    "half a recording": (
        lambda path, saved: path.write_bytes(saved.read_bytes()[: saved.stat().st_size // 2]),
        "only the beginning of one",
    ),
    "a pickle": (lambda path, saved: path.write_bytes(b"\x80\x04cos\nsystem\n"), "not a recording"),
    "a pipe": (lambda path, saved: os.mkfifo(path), "is not a file"),
    "a folder": (lambda path, saved: path.mkdir(), "is not a file"),
    "a link to nowhere": (lambda path, saved: path.symlink_to("gone"), "holds no mission.npz"),
    "a link to itself": (lambda path, saved: path.symlink_to(path), "holds no mission.npz"),
}
COMMANDS = {
    "frames": ("--uav", "0", "--time", "1"),
    "export": ("--to", "csv"),
    "replay": ("--video",),
    "replay page": ("--page",),
    "explain": ("--time", "1", "--target", "0"),
}


@pytest.mark.parametrize(
    ("command", "case"), [*(("frames", case) for case in HOSTILE), *((name, "a zip bomb") for name in COMMANDS)]
)
def test_commands_refuse_a_hostile_file_and_leave_nothing(saved, tmp_path, refused, case, command):
    make, reason = HOSTILE[case]
    make(tmp_path / "mission.npz", saved)
    told = refused(command.split()[0], str(tmp_path), *COMMANDS[command])
    assert told.startswith("understory: DIR: ") and reason in told


MEASURE = """
import resource, sys, time
from sim.mission.archive import find_recording
from pathlib import Path
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for name in sys.argv[1:]:
    start = time.perf_counter()
    try:
        find_recording(Path(name))
    except ValueError as error:
        took = time.perf_counter() - start
        print(took, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, len(str(error)))
"""


def test_a_hostile_file_is_refused_soon_and_in_little_memory(saved, tmp_path):
    folders = []
    for case, (make, _) in HOSTILE.items():
        folders.append(tmp_path / case.replace(" ", "-"))
        folders[-1].mkdir()
        make(folders[-1] / "mission.npz", saved)
    for case in ("a nest for a scenario", "a nest of faults", "a great number of scans", "an endless scenario"):
        folders.append(
            rewritten(saved, tmp_path / f"{case}.npz".replace(" ", "-"), **DAMAGED[case][0](load_recording(saved)))
        )
    folders.append(tmp_path / "sparse.npz")
    huge(folders[-1], saved)
    done = python("-c", MEASURE, *folders)
    assert done.returncode == 0, done.stderr
    rows = [list(map(float, row.split())) for row in done.stdout.splitlines()]
    assert len(rows) == len(folders) - 1  # the sparse file's end is a sound recording, and nothing before it is read
    assert max(seconds for seconds, _, _ in rows) < 30.0 and max(kib for _, kib, _ in rows) < 100 * 1024
    assert MOST_BYTES == 2**30


def altered(saved, folder, data):
    """A copy in which a few bytes inside one array are others, with checksums that say so."""
    content = members(saved)
    name = data.draw(st.sampled_from(sorted(content)))
    changed = bytearray(content[name])
    for _ in range(data.draw(st.integers(1, 3))):
        start = 0 if data.draw(st.integers(0, 3)) == 0 else 128  # in the header, or behind it
        at = data.draw(st.integers(start, len(changed) - 1)) if start < len(changed) else 0
        changed[at] = data.draw(st.sampled_from((0, 1, 32, 34, 44, 45, 48, 57, 91, 123, 127, 128, 240, 255)))
    return rewritten(saved, folder / "mission.npz", **{name: bytes(changed)})


def sound_or_one_line(path):
    try:
        recording = find_recording(path)
    except InputError as error:
        assert str(error).isprintable() and len(str(error)) < 800
        return
    save(recording, path.with_name("again.npz"))
    assert_same(load_recording(path.with_name("again.npz")), recording)
    summary(recording, seconds={}, wall_s=0.0)
    PeopleFacts(recording)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("small") / "mission.npz"
    save(record(scans=2), path)
    return path


@settings(max_examples=50, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_bytes_that_pass_the_checksum_make_a_sound_recording_or_one_line(small, tmp_path, data):
    """Whatever is changed inside the arrays: refused, or a recording that every reader of recordings can take."""
    sound_or_one_line(altered(small, tmp_path, data))


@pytest.mark.slow
@settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_many_changed_bytes_make_a_sound_recording_or_one_line(small, tmp_path, data):
    sound_or_one_line(altered(small, tmp_path, data))


def test_names_are_never_imported_and_unreadable_files_said_to_be_so(tmp_path, monkeypatch, saved):
    """Planner, detector and trajectories of its scenario are text to a replay."""
    (tmp_path / "evil.py").write_text("open('ran', 'w').close()\nclass Evil: pass\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    named = json.loads(encode_scenario(synthetic.scenario()))
    named["sensing"]["detector"] = "evil:Evil"
    named["people"]["trajectories"] = "/nowhere/people.csv"
    evil = {"planner": npy(np.array("evil:Evil")), "scenario": npy(np.array(json.dumps(named)))}
    recording = find_recording(rewritten(saved, tmp_path / "mission.npz", **evil))
    write_frames(recording, [0], 0, tmp_path / "frames", size=256, progress=lambda k: None)
    for target in ("csv", "stonesoup", "mot"):
        export(recording, target, tmp_path / target)
    assert recording.planner == "evil:Evil" and "evil" not in sys.modules and not (tmp_path / "ran").exists()

    def refused(path, mode):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr("sim.mission.npz.open", refused, raising=False)  # root may read everything
    with pytest.raises(InputError, match=r"^DIR: .*mission\.npz cannot be read: Permission denied$"):
        find_recording(saved)
