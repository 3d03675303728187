"""The key of a trial follows from all that decides it, files of plug-ins and of this package among them."""

import shutil
import sys

import pytest

from sim.installation import ROOT
from sim.study.definition import Study
from sim.study.trials import compute_release, list_trials

FILES = ("sim/__main__.py", "assets/quadrotor.urdf", "assets/meshes/person.obj", "assets/meshes/leaves.png")
PLANNERS = {
    "a class": "class Made:\n    def plan(self, team, rng): ...\n",
    "a function that makes a built-in one": "from planning.baselines import Hover\ndef Made():\n    return Hover()\n",
    "a class of another module": "from plugged_parts import Part as Made\n",
    "a function of another module that makes a built-in one": "from plugged_parts import part as Made\n",
    "a partial": """
from functools import partial
from planning.composed import Composed
Made = partial(Composed, horizon=2)
""",
}
PARTS = """
from planning.baselines import Hover

class Part:
    def plan(self, team, rng): ...

def part():
    return Hover()
"""


@pytest.fixture
def keyed(tmp_path, monkeypatch):
    """Makes two modules, and tells the key of a trial of one planner, as it is and after a change of each file."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def keys(text, planner="plugged:Made", **settings):
        files = {tmp_path / "plugged.py": text, tmp_path / "plugged_parts.py": PARTS}
        for file, content in files.items():
            file.write_text(content)
        study = Study(name="x", planners=(planner,), seeds="0", settings=settings)
        found = [list_trials(study)[0].key]
        for file, content in files.items():
            file.write_text(content + "# another\n")
            found.append(list_trials(study)[0].key)
        return found

    yield keys
    for name in ("plugged", "plugged_parts"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("text", PLANNERS.values(), ids=PLANNERS)
def test_a_planner_whose_file_changed_is_another_trial_however_it_is_made(keyed, text):
    first, changed, also = keyed(text)
    assert first != changed and (changed != also) == ("plugged_parts" in text)


def test_a_detector_by_a_partial_whose_file_changed_is_another_trial(keyed):
    text = "from functools import partial\nfrom plugged_parts import Part\nMade = partial(Part)\n"
    first, changed, _ = keyed(text, "hover", **{"sensing.detector": '"plugged:Made"'})
    assert first != changed


def copy(root):
    """Copy some files of this package into a folder."""
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)


def test_the_release_changes_with_code_body_and_meshes_but_not_with_its_place(tmp_path):
    one, other = tmp_path / "one", tmp_path / "of" / "another"
    for root in (one, other):
        copy(root)
    seen = [compute_release(one)]
    assert compute_release(other) == seen[0]
    for name in FILES:
        with (one / name).open("ab") as file:
            file.write(b"\n")
        seen.append(compute_release(one))
    (one / FILES[0]).rename(one / "sim" / "other.py")
    seen.append(compute_release(one))
    assert len(set(seen)) == len(seen)
    (one / "assets" / "meshes" / "mine.txt").write_text("a note, which is not installed")
    assert compute_release(one) == seen[-1]
