"""The same bytes of a recording, whatever the processor: a short form of `python tests/helpers/reproducibility.py`."""

import json
import re
import sys

import pytest
from helpers.reproducibility import ROOT, SHORT, VARIANTS, hashes, hashes_here
from helpers.studies import task_of

from planning.catalogue import DEFAULT_PLANNER
from sim.facts.metrics.summary import describe_machine
from sim.mission.archive import compute_digest, load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from sim.study.trial_flight import fly_trial

# Of the short mission and of images, on any machine: what `python tests/helpers/reproducibility.py --short` prints.
EXPECTED = [
    "a4eff8ded9ab167517c3ed4b8a1e3a49bedc7dcdb01a7a11a5fdf097ed4ced7d",
    "ed5608f19dd146b434a6a77d0b273d3ed3b08ee18ab4cfb8d958fc1d032af651",
    "cd05cd624a51c6c15887930fcaa851dbc5afae944b279ec56cde57c0bd071404",
]
# At once, as each alone flies the mission again.
EVERYTHING = {
    **VARIANTS["OpenBLAS for Prescott"],
    **VARIANTS["NumPy without AVX-512 and AVX2"],
    **VARIANTS["OpenCV without AVX-512 and AVX2"],
    **VARIANTS["C library without AVX2 and FMA"],
    **VARIANTS["8 threads"],
    **VARIANTS["other hash seed, locale and time zone"],
}


def test_recordings_and_images_have_the_same_bytes_on_every_processor_with_late_messages_and_all_that_errs():
    """In one process each, as importing and compiling take as long as a mission."""
    mission, duration = SHORT
    missions = [mission, "late messages", "all that errs"]
    here = hashes_here(missions, duration=duration)
    assert [here[0], *here[3:]] == EXPECTED
    assert hashes(sys.executable, missions, duration=duration, **EVERYTHING) == here


@pytest.mark.docs
def test_the_readme_has_the_figure_of_its_first_command():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (figure,) = re.findall(r"Seed 0,\s+which\s+the\s+first\s+command\s+flies,\s+has\s+([0-9.]+) %", readme)
    row = fly_trial(task_of(load_scenario("forest"), DEFAULT_PLANNER, 0)).row
    assert f"{100 * row.metrics['ospa.share_under_1m']:.1f}" == figure


def test_the_summary_names_the_machine_and_the_recordings_hash(tmp_path, without_pictures):
    scenario = load_scenario("forest", ["duration=1", "sensing.mode=ideal", "trees.density=5"])
    run_mission(Trial(scenario, "hover", 0), tmp_path / "out", video=False)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["recording_sha256"] == compute_digest(load_recording(tmp_path / "out" / "mission.npz"))
    assert summary["machine"] == describe_machine() and set(describe_machine()) == {"processor"}
    assert all(describe_machine().values())
