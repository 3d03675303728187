"""Each honest mistake of a plug-in's author is one line, which names file and line where there is one."""

import json
import sys

import pytest

import understory
from tracking.errors import InputError

HEAD = """
import time

from planning.planner import Plan


"""
IDEAL = "--set sensing.mode=ideal"
PLANNER = f"--planner mine:Mine {IDEAL}"
DETECTOR = "--planner hover --set sensing.detector=mine:Mine"
WALK = f'--planner hover {IDEAL} --set people.walks=["mine:Mine"]'


def plan(line):
    """A planner whose method ends with a line; the mark is the line that an error names."""
    return f"class Mine:\n    def plan(self, team, rng):\n        {line}\n"


def result(line):
    """As `plan`, for a wrong result, whose error names the method."""
    return f"class Mine:\n    def plan(self, team, rng):  # here\n        {line}\n"


# By mistake: the code, the arguments of `run`, and what the line says. "# here" marks the line that it names.
REFUSED = {
    "no such module": ("", "--planner mind:Mine", "No module named 'mind'; did you mean mine?"),
    "a missing dependency": ("import torchh", PLANNER, "mine needs 'torchh', which is not installed"),
    "a syntax error": ("def plan(", PLANNER, "cannot be imported: SyntaxError: '(' was never closed (mine.py, line "),
    "an exception in the module": ("1 / 0  # here", PLANNER, "imported: ZeroDivisionError: division by zero"),
    "a misspelt method": ("class Mine:\n    def plann(self, team, rng): pass", PLANNER, "; did you mean plann?"),
    "a wrong signature": ("class Mine:\n    def plan(self, team): pass", PLANNER, "(team); it must take (team, rng)"),
    "a way out of the area": (
        "class Mine:\n    def itineraries(self, people, half, paces, rng):  # here\n"
        "        return [([[0, 0], [999, 0]], pace, 0.0) for pace in paces.T]",
        WALK,
        "cannot walk: waypoints are not n x 2 finite numbers within",
    ),
}
FAULTS = {
    "an exception": (plan("raise KeyError('gone')  # here"), PLANNER, "KeyError: 'gone'"),
    "controls in words": (result("return [Plan([['0', '1']]) for _ in team]"), PLANNER, "controls are not numbers"),
    "too fast": (plan("return [Plan([[50, 0]]) for _ in team]"), PLANNER, "speed 50 m/s exceeds 5 m/s; clipped"),
    "a detector raises": (
        "class Mine:\n    def detect(self, frame):\n        frame.picture  # here",
        DETECTOR,
        "detector: AttributeError: 'Frame' object has no attribute 'picture'",
    ),
}


@pytest.fixture
def wrong(tmp_path, monkeypatch):
    """Writes the module of an author; returns the place that an error should name, "mine.py:LINE", or ""."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(code):
        monkeypatch.delitem(sys.modules, "mine", raising=False)
        (tmp_path / "mine.py").write_text(HEAD + code)
        lines = [k for k, line in enumerate((HEAD + code).splitlines(), 1) if line.endswith("# here")]
        return f"mine.py:{lines[0]}, in " if lines else ""

    return write


def words(arguments):
    return ["run", *"--duration 0.4 --no-video --out out".split(), *arguments.split()]


@pytest.mark.parametrize("mistake", REFUSED)
def test_a_mistake_that_leaves_no_result_is_one_line(refused, wrong, mistake):
    code, arguments, text = REFUSED[mistake]
    place = wrong(code)
    told = refused(*words(arguments))
    assert text in told and place in told


@pytest.mark.parametrize("mistake", FAULTS)
def test_a_mistake_in_one_call_is_a_fault_of_the_mission(call, wrong, tmp_path, mistake):
    code, arguments, text = FAULTS[mistake]
    place = wrong(code)
    ended, out, err = call(*words(arguments))
    assert (ended, err) == (0, "") and text in " ".join(out.split()) and place.removesuffix(", in ") in out
    fault = json.loads((tmp_path / "out" / "summary.json").read_text())["faults"][0]
    assert text in fault["message"] and place in "".join(fault.get("trace", [])[-1:])


def test_a_class_in_place_of_an_object_is_one_line():
    with pytest.raises(InputError, match=r"^planner: Mine is a class; give an object of it$"):
        understory.run("forest", type("Mine", (), {}), settings={"duration": 0.4})


def test_a_planner_that_hangs_ends_a_timed_run_in_one_line(refused, wrong):
    place = wrong(plan("time.sleep(600)  # here"))
    told = refused(*words(PLANNER), "--timeout", "3", code=1)
    assert "before its first scan was complete: took longer than the timeout of" in told and place in told
