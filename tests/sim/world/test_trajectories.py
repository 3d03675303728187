import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import PchipInterpolator

from sim.mission.archive import load_recording
from sim.scenario.environment import Area, People
from sim.scenario.loading import load_scenario
from sim.scenario.remarks import find_remarks
from sim.world.recorded_people import describe_trajectories, read_trajectories
from sim.world.trajectories import Trajectories
from tracking.errors import InputError

AREA = Area()
GOOD = [(0, 1, 0, 0), (1, 1, 1, 0)]


@pytest.fixture
def csv_file(tmp_path):
    def write(text):
        path = tmp_path / "people.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def table(rows, header="time,id,x,y"):
    return "\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n"


def walk_of(x, y):
    """One person at these places, one second apart."""
    return Trajectories(np.arange(len(x), dtype=float), np.stack([x, y], axis=-1)[:, None, :].astype(float))


def test_positions_are_straight_between_samples_and_headings_along_the_step():
    walk = walk_of([0, 3, 3], [0, 4, 8])
    for time, position, heading in [
        (0.0, (0, 0), math.atan2(4, 3)),
        (0.5, (1.5, 2), math.atan2(4, 3)),
        (1.0, (3, 4), math.pi / 2),
        (1.25, (3, 5), math.pi / 2),
        (2.0, (3, 8), math.pi / 2),
    ]:
        positions, headings = walk.at(time)
        assert_allclose(positions, [position], atol=1e-15)
        assert_allclose(headings, [heading], atol=1e-15)


@pytest.mark.parametrize("time", [-0.1, 2.1, 100.0])
def test_people_are_absent_before_the_first_and_after_the_last_sample(time):
    positions, headings = walk_of([0, 3, 3], [0, 4, 8]).at(time)
    assert np.all(np.isnan(positions)) and np.all(np.isnan(headings))


def test_samples_are_met_exactly_and_asking_changes_nothing():
    rng = np.random.default_rng(1)
    walk = Trajectories(np.arange(2401) / 60, rng.normal(size=(2401, 3, 2)))
    for k in range(2401):
        assert np.array_equal(walk.at(4 * k * (1 / 240))[0], walk.positions[k])
    walk = walk_of([0, 0, 0, 0], [0, -2, -2, -2])
    assert walk.at(2.5)[1] == pytest.approx(-math.pi / 2)
    walk = walk_of([0, 3], [0, 4])
    walk.at(0.0)[0][:] = 99
    assert np.array_equal(walk.at(0.0)[0], [[0, 0]])


def test_a_recorded_walk_is_a_monotone_cubic_that_overshoots_no_stop(csv_file):
    t = np.arange(0, 11, 0.5)
    x, y = 20 * np.sin(0.3 * t), 3 * t - 20
    walk = read_trajectories(csv_file(table(zip(t, [7] * len(t), x, y, strict=True))), AREA, duration=10)
    for k, time in enumerate(t[t <= 10]):
        assert_allclose(walk.at(time)[0], [[x[k], y[k]]], atol=1e-12)
    curve = PchipInterpolator(t, np.column_stack([x, y]))
    assert_allclose(walk.positions[:, 0], curve(walk.times), atol=1e-12)
    assert walk.times[-1] == 10
    rows = [(0, 1, 0, 0), (1, 1, 2, 0), (2, 1, 2, 0), (3, 1, 4, 0)]
    x = read_trajectories(csv_file(table(rows)), AREA, duration=3).positions[:, 0, 0]
    assert np.all(np.diff(x) >= 0)
    assert_allclose(x[60:121], 2.0)


def test_rows_come_in_any_order_and_people_in_that_of_appearance(csv_file):
    rows = [(0, "ann", 0, 0), (9, "ann", 9, 0), (3.01, "bob", 1, 1), (5, "bob", 2, 1)]
    walk = read_trajectories(csv_file(table(rows)), AREA, duration=12)
    for time, ann, bob in [(0, 1, 0), (3.005, 1, 0), (3.05, 1, 1), (5.0, 1, 1), (5.1, 1, 0), (9, 1, 0), (9.1, 0, 0)]:
        positions, headings = walk.at(time)
        assert list(~np.isnan(positions[:, 0])) == [ann, bob] and list(~np.isnan(headings)) == [ann, bob]
    rows = [(0, 1, 0, 0), (9, 1, 9, 0), (50, 2, 0, 0), (60, 2, 1, 0)]
    assert read_trajectories(csv_file(table(rows)), AREA, duration=40).positions.shape == (2401, 1, 2)
    rows = [(4, 2, 5, 5), (0, 1, 0, 1), (4, 1, 8, 1), (0, 2, 5, -5), (2, 1, 4, 1)]
    walk = read_trajectories(csv_file(table([(x, t, y, i) for t, i, x, y in rows], "x,t,y,id")), AREA, duration=4)
    assert_allclose(walk.at(0)[0], [(5, -5), (0, 1)])
    assert_allclose(walk.at(4)[0], [(5, 5), (8, 1)])
    more = [(0, "left", 1, 3, 4), (1, "right", 1, 3, 5)]  # other columns are ignored
    walk = read_trajectories(csv_file(table(more, "t,side,id,x,y")), AREA, duration=1)
    assert_allclose(walk.at(1)[0], [(3, 5)])


def described(path):
    return describe_trajectories(
        load_scenario("forest", [f"people.trajectories={path}", "area.width=9000", "area.height=9000"])
    )


def walks(speeds, seconds=20, rate=5, start=0.0, noise=0.0):
    """Rows of people with these speeds [m/s], so many in a second."""
    rng = np.random.default_rng(0)
    for person, speed in enumerate(speeds):
        for k in range(seconds * rate + 1):
            x, y = rng.normal((speed * k / rate, 2.0 * person), noise)
            yield start + k / rate, person, float(x), float(y)


def test_a_file_of_people_is_told_of_in_one_line(csv_file):
    path = csv_file(table(walks([0.8, 1.3, 2.1], start=3.0)))
    span = "3 people, from 3 to 23 s, at 0.80 to 2.10 m/s, 1.30 m/s in the median"
    assert described(path) == (f"people.trajectories: {path}: {span}", [])


UNITS = "are times in seconds and places in metres?"


@pytest.mark.parametrize(
    ("rows", "doubt"),
    [
        # Frames at 25 Hz whose numbers are taken for seconds; places in centimetres.
        (
            [(25 * t, i, x, y) for t, i, x, y in walks([1.0, 1.4])],
            f"half of the people move at 0.05 m/s or less; {UNITS}",
        ),
        (
            [(t, i, 100 * x, 100 * y) for t, i, x, y in walks([1.0, 1.4])],
            f"id 1 moves at 140 m/s, but no one has run faster than 12.14 m/s; {UNITS}",
        ),
    ],
)
def test_speeds_that_are_not_those_of_people_are_doubted(csv_file, rows, doubt):
    path = csv_file(table(rows))
    assert described(path)[1] == [f"people.trajectories: {path}: {doubt}"]


@pytest.mark.parametrize("separator", [",", " ", "\t"])
def test_a_nameless_file_with_more_ids_than_times_is_doubted(csv_file, separator):
    rows = [(i, k, 1.0 * k, 2.0 * i) for i in range(3) for k in range(9)]
    lines = [separator.join(map(str, row)) for row in rows]
    told = "has 9 ids, but 3 times; if the first column is the id, name the columns in a first line"
    path = csv_file("\n".join(lines))
    assert f"people.trajectories: {path}: {told}" in described(path)[1]
    for names in (["id", "time", "x", "y"], ["# id", "timestamp", "x", "y"]):
        text = "\n".join([separator.join(names), *lines])
        assert described(csv_file(text)) == (
            f"people.trajectories: {path}: 3 people, from 0 to 8 s, at 1.00 to 1.00 m/s, 1.00 m/s in the median",
            [],
        )


def test_whole_times_of_a_nameless_file_may_be_frames(csv_file):
    lines = [f"{5 * t:.0f} {i} {x} {y}" for t, i, x, y in walks([1.2, 1.6])]
    path = csv_file("\n".join(lines))
    told = "all times are whole numbers; if frames are counted, people.fps says how many there are in a second"
    assert described(path)[1] == [f"people.trajectories: {path}: {told}"]


def test_people_of_another_origin_are_refused_where_those_outside_are_clipped(csv_file):
    path = csv_file(table((t, i, x + 457100, y) for t, i, x, y in walks([1.0, 1.4])))
    told = r"columns x and y: all places are outside the area of 150 × 100 m; do they have its origin\?$"
    with pytest.raises(InputError, match=told):
        read_trajectories(path, AREA, duration=20, people=People(outside="clip"))


def test_commands_tell_of_the_file_and_doubt_it(call, compare, csv_file):
    path = csv_file(table([(25 * t, i, x, y) for t, i, x, y in walks([1.0, 1.4])]))
    words = ["--planner", "hover", "--set", "sensing.mode=ideal", "--set", f"people.trajectories={path}"]
    words += ["--duration", "0.4"]
    told = f"people.trajectories: {path}: 2 people, from 0 to 500 s, at 0.04 to 0.06 m/s, 0.05 m/s in the median\n"
    for line, ended in ((told, call("run", *words, "--no-video")), ("", compare(*words, "--seeds", "0"))):
        code, out, err = ended
        assert code == 0 and out.startswith(line)
        assert err == f"understory: people.trajectories: {path}: half of the people move at 0.05 m/s or less; {UNITS}\n"


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("", "is empty; its first line must name the columns time,id,x,y"),
        ("t,time,id,x,y\n", "line 1: column time is twice; columns are time,time,id,x,y"),
        (
            table([*GOOD, (2, 1, "east", 0), (3, 1, 99, 0), (4, 1, 0, "nan"), (5, "", 0, 0)]),
            "line 4, column x: 'east' is not a finite number; line 5, column x: 99 is outside the area, -75 to 75 m; "
            "line 6, column y: 'nan' is not a finite number; and 1 more",
        ),
        (table([*GOOD, (2, 1, 0)]), "line 4: has 3 entries, not 4 as line 1"),
        (table([*GOOD, (1.0, 1, 2, 0)]), "line 4, column time: id 1 has a second row at 1 s"),
        (
            table([(90, 1, 0, 0), (95, 1, 1, 0)]),
            "column time: nobody is there between 0 and 40 s; rows are from 90 to 95 s",
        ),
        (table([(t, i, 0, 0) for i in range(9001) for t in (0, 1)]), "9001 people for a duration of 40 s are too many"),
    ],
)
def test_what_is_wrong_is_named_by_field_line_column_and_value(csv_file, text, complaint):
    path = csv_file(text)
    with pytest.raises(ValueError, match=re.escape(complaint)) as error:
        read_trajectories(path, AREA, duration=40)
    assert str(error.value).startswith(f"people.trajectories: {path}")


WALK = [
    (0.0, "ann", -10.0, 2.5),
    (1.2, "ann", -8.5, 2.0),
    (2.0, "ann", -7.0, 3.0),
    (0.4, "bob", 4.0, 0.0),
    (2.0, "bob", 5.5, -1.0),
]
NUMBERED = [(t, {"ann": 1, "bob": 2}[i], x, y) for t, i, x, y in WALK]


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        (table(WALK), {}),
        (table(WALK).replace(",", ";").replace(".", ","), {}),
        (table(WALK).replace(",", "\t"), {}),
        (table(WALK).replace(",", "   "), {}),
        (table([(round(25 * t), *rest) for t, *rest in WALK], "frame,id,x,y"), {"fps": 25.0}),
        (table([(round(2.5 * t, 9), t, *rest) for t, *rest in WALK], "frame,time,id,x,y"), {}),
        (table([(100 + t, i, x + 500, y - 70) for t, i, x, y in WALK]), {"start": 100.0, "origin": (500.0, -70.0)}),
        ("".join(" ".join(map(str, row)) + "\n" for row in NUMBERED), {}),
        ("".join(f"{25 * t:g}\t{i}\t{x}\t{y}\n" for t, i, x, y in NUMBERED), {"fps": 25.0}),
    ],
    ids=[
        "as is",
        "semicolons",
        "tabs",
        "spaces",
        "frames",
        "frames and times",
        "elsewhere",
        "no names",
        "frames, no names",
    ],
)
def test_files_of_the_usual_forms_give_the_same_paths(csv_file, text, keys):
    expected = read_trajectories(csv_file(table(WALK)), AREA, duration=3).positions
    found = read_trajectories(csv_file(text), AREA, duration=3, people=People(**keys)).positions
    assert_allclose(found, expected, atol=1e-12)


def test_people_are_absent_outside_the_area_but_not_in_gaps(csv_file):
    """Each stay is the path of a person with the rows of the stay alone."""
    rows = [(t, "a", 60.0 + 5.0 * t if t < 5 else 100.0 - 5.0 * t, 0.1 * t * t) for t in range(9)]
    inside = [[row for row in rows if row[2] <= 75 and (row[0] < 4) == first] for first in (True, False)]
    stays = [read_trajectories(csv_file(table(part)), AREA, duration=9).positions for part in inside]
    expected = np.where(np.isnan(stays[0]), stays[1], stays[0])
    with pytest.raises(InputError, match=r"line 6, column x: 80 is outside the area, -75 to 75 m$"):
        read_trajectories(csv_file(table(rows)), AREA, duration=9)
    clipped = read_trajectories(csv_file(table(rows)), AREA, duration=9, people=People(outside="clip"))
    assert_allclose(clipped.positions, expected, atol=1e-12)
    assert np.isnan(clipped.at(4.0).positions).all() and not np.isnan(clipped.at(6.0).positions).any()
    path = csv_file(table([row for part in inside for row in part]))  # rows at 0 to 3 s and 5 to 8 s
    assert not np.isnan(read_trajectories(path, AREA, duration=8).positions).any()


def test_places_far_from_the_area_ask_for_their_origin(csv_file):
    path = csv_file(table([(t, 1, 691250 + t, 5334560) for t in (0, 1)]))
    with pytest.raises(InputError, match=r"691250 is outside the area, -75 to 75 m; people.origin is the place in the"):
        read_trajectories(path, AREA, duration=1)


def test_ids_with_one_row_are_left_out_and_named(csv_file):
    path = csv_file(table([*GOOD, (0, "x", 1, 1), (1, "y", 1, 1)]))
    assert read_trajectories(path, AREA, duration=1).positions.shape[1] == 1
    left = "left out: ids x, y, in a single row; a path needs two or more"
    assert described(path)[1] == [f"people.trajectories: {path}: {left}"]
    many = csv_file(table([*GOOD, *((0, f"p{k}", 1, 1) for k in range(5))]))
    assert "left out: 5 ids, such as p0, p1, p2, in a single row" in described(many)[1][0]


def test_a_file_of_frames_asks_for_their_rate_and_keys_without_a_file_are_told_of(csv_file):
    path = csv_file(table([*GOOD], "frame,id,x,y"))
    with pytest.raises(
        InputError, match=r"column time is missing; .*; if frames are counted, people.fps says how many"
    ):
        read_trajectories(path, AREA, duration=1)
    told = "people.fps, people.start: not used without people.trajectories"
    assert find_remarks(load_scenario("forest", ["people.fps=25", "people.start=2"])) == [told]


def test_a_mission_of_a_person_who_leaves_and_returns_is_flown_and_explained(tmp_path, call):
    rows = [(t, "a", -6.0 + t, 0.0 if t < 2 or t > 3 else 999.0) for t in range(7)]
    rows += [(t, "b", 0.5 * t, -5.0) for t in range(7)]
    (tmp_path / "walk.csv").write_text(table(rows), encoding="utf-8")
    words = ["--set", "people.trajectories=walk.csv", "--set", "people.outside=clip", "--planner", "hover"]
    code, _, err = call("run", "--duration", "6", "--no-video", "--out", "flown", "--set", "trees.density=0", *words)
    assert code == 0 and err == ""
    there = ~np.isnan(load_recording(tmp_path / "flown" / "mission.npz").people[:, 0, 0])
    assert np.flatnonzero(np.diff(there.astype(int))).tolist() == [5, 19]  # of 5 scans a second
    code, out, _ = call("explain", "flown", "--target", "0")
    assert code == 0 and "0" in out
