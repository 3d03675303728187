"""Trials of a study and their rows of results, as values that can be sent to other processes."""

import functools
import hashlib
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Struct, field
from numpy.typing import NDArray

from planning.planner_loading import find_planner_target, load_planner, make_canonical_text
from sim.installation import ROOT
from sim.scenario.csv_tables import MOST_BYTES
from sim.scenario.loading import load_scenario
from sim.scenario.quantities import parse_integers
from sim.scenario.scenario import Scenario, encode_scenario
from sim.scenario.text_files import read_bytes
from sim.study.cells import Cell, Levels, list_cells
from sim.study.definition import Study
from tracking.errors import InputError
from tracking.numerics.arrays import Array
from tracking.plugins.registry import import_plugin

_MOST_TRIALS = 1_000_000
_OURS = ("planning", "sim", "tracking")
# Files that decide a flight beside its settings: code, the quadrotor's body, and the meshes that cameras see.
_RELEASED = (
    *(f"{name}/**/*.py" for name in _OURS),
    "assets/*.urdf",
    *(f"assets/meshes/*.{e}" for e in ("obj", "mtl", "png")),
)


class TrialPlace(Struct, frozen=True, kw_only=True):
    """The place of a trial in its study, and everything that reproduces it."""

    study: str = ""
    scenario: str = ""  # name or .toml file
    factors: Levels = ()  # those displayed: (("lambda", "45"), ("R", "5"))
    settings: dict[str, str] = {}  # overrides: `understory run SCENARIO --set key=value ... --planner ... --seed ...`
    planner: str  # in the form of --planner
    seed: int
    repeat: int = 0  # decides, with the seed, the noise on the seed's map
    version: str  # version of the package


class StudyTrial(TrialPlace, frozen=True, kw_only=True):
    """One trial to fly."""

    key: str
    setting: Scenario
    metrics: tuple[str, ...] = ()  # import strings of plug-in metrics

    @property
    def place(self) -> dict[str, Any]:
        """The fields of `TrialPlace`, which the trial's row has, too."""
        return {name: getattr(self, name) for name in TrialPlace.__struct_fields__}


class TrialRow(TrialPlace, frozen=True, kw_only=True, eq=False):
    """One trial with its results."""

    status: Literal["done", "failed"]
    error: str = ""
    metrics: dict[str, float] = {}  # by dotted name, as in docs/how-to/studies.md; NaN if undefined
    # (T,) m at each scan, mean over the working UAVs; NaN if there are none
    ospa: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, dtype=np.float32))
    times: Array = field(default_factory=lambda: np.zeros(0))  # (T,) s
    recording: str = ""  # SHA-256 of the recording's file, equal on all machines; empty if the trial failed
    machine: str = ""  # processor of the machine that flew the trial


def list_trials(study: Study, metrics: Sequence[str] = ()) -> list[StudyTrial]:
    """All trials of a study, seed by seed and repeat by repeat, so that an interrupted study has complete pairs.

    metrics: import strings of plug-in metrics to compute. InputError if a trial cannot be flown.
    """
    listed = list_cells(study)
    seeds = parse_integers(study.seeds, "seeds")
    if (count := len(listed) * len(seeds) * study.repeats) > _MOST_TRIALS:
        text = f"{len(listed)} cells by {len(seeds)} seeds by {study.repeats} repeats are {count} trials"
        raise InputError(f"{study.at('study')}: {study.name}: {text}; at most {_MOST_TRIALS} are allowed")
    loaded = []
    for cell in listed:
        try:
            loaded.append(_load_cell(cell))
        except InputError as error:
            raise InputError(_locate_error(study, cell, error)) from error
    made = [
        StudyTrial(
            key=hashlib.sha256(f"{one.digest} {seed} {repeat}".encode()).hexdigest()[:32],
            study=study.name,
            scenario=one.cell.scenario,
            factors=one.cell.factors,
            settings=one.settings,
            setting=one.setting,
            planner=one.planner,
            seed=seed,
            repeat=repeat,
            version=get_release(),
            metrics=tuple(metrics),
        )
        for repeat in range(study.repeats)
        for seed in seeds
        for one in loaded
    ]
    _check_distinct(study, made[: len(loaded)])
    return made


@functools.lru_cache(maxsize=1)
def get_release() -> str:
    """Release of the installed package, read once in a process."""
    return compute_release(ROOT)


def compute_release(root: Path) -> str:
    """Version of this package with a digest of the code in a folder, which changes between releases: 1.2.0+89abcdef.

    The digest includes the quadrotor's body and the meshes, and does not depend on the place of installation.
    """
    digest = hashlib.sha256()
    for name in sorted(file.relative_to(root).as_posix() for pattern in _RELEASED for file in root.glob(pattern)):
        data = (root / name).read_bytes()
        digest.update(f"{name} {len(data)}\n".encode() + data)
    return f"{version('understory')}+{digest.hexdigest()[:8]}"


class _LoadedCell(NamedTuple):
    """What the trials of a cell share."""

    cell: Cell
    settings: dict[str, str]  # overrides of its scenario
    setting: Scenario
    planner: str  # with its options
    digest: str  # of all that decides a trial besides seed and repeat


def _load_cell(cell: Cell) -> _LoadedCell:
    """Load the scenario and the plug-ins of a cell; InputError if something is wrong."""
    settings = cell.settings
    setting = load_scenario(cell.scenario, [f"{key}={value}" for key, value in settings.items()])
    planner = cell.spec
    user_files = _hash_user_files(setting, planner)
    parts = [encode_scenario(setting), make_canonical_text(planner), get_release(), *user_files]
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()
    return _LoadedCell(cell, settings, setting, planner, digest)


def _locate_error(study: Study, cell: Cell, error: InputError) -> str:
    """The error of a cell, with the study's file and the first of its tables that causes the error."""
    for count, table in enumerate(cell.tables, start=1):
        try:
            _load_cell(msgspec.structs.replace(cell, tables=cell.tables[:count]))
        except InputError as first:
            if not study.file or not table.name:
                return str(first)
            return study.at(f"{table.name}: {first}" if count > 1 else _locate_in_head(study, cell, first))
    return str(error)  # a plug-in failed only the first time


def _locate_in_head(study: Study, cell: Cell, error: InputError) -> str:
    """The error, with the key of the study file (`study.planners`, `score.floor`) that caused it."""
    try:
        load_scenario(cell.scenario)
    except InputError as wrong:
        return f"study.scenarios: {str(wrong).removeprefix('scenario: ')}"
    end = "floor" if study.score and cell.planner == study.score.floor else "bound"
    key = "study.planners" if cell.planner in study.planners else f"score.{end}"
    return f"{key}: {str(error).removeprefix('planner: ')}"


def _hash_user_files(setting: Scenario, planner: str) -> list[str]:
    """Digests of files outside of the package on which a trial depends: plug-ins, stem maps, people's trajectories."""
    target = find_planner_target(planner)
    plugins = [(target, type(load_planner(planner)))]
    if not target.startswith("planning."):
        plugins.append((target, import_plugin(target)))
    plugins += [(name, registry.find(name)) for registry, name in setting.plugins if name not in registry.built_in]
    files = dict.fromkeys(file for target, plugin in plugins for file in _find_user_files(target, plugin))
    data = (setting.trees.stem_map, setting.people.trajectory_file)
    return [_hash_file(Path(file)) for file in (*files, *data) if file]


def _find_user_files(target: str, plugin: object) -> list[str]:
    """The user's own files among two modules: the one in an import string, and the one that defines the plug-in."""
    names = [target.partition(":")[0], str(getattr(plugin, "__module__", ""))]
    theirs = [name for name in names if name.partition(".")[0] not in (*_OURS, *sys.stdlib_module_names)]
    return [getattr(sys.modules.get(name), "__file__", None) or "" for name in theirs]


def _hash_file(path: Path) -> str:
    try:
        return hashlib.sha256(read_bytes(path, "study", MOST_BYTES)).hexdigest()
    except InputError:
        return ""  # the set-up of the world reports what is wrong with the file


def _check_distinct(study: Study, first: Sequence[StudyTrial]) -> None:
    """InputError if two cells have the same trials, which would count twice."""
    known: dict[str, StudyTrial] = {}
    for trial in first:
        other = known.setdefault(trial.key, trial)
        if other is not trial:
            both = f"{_name_place(other)} and {_name_place(trial)}"
            raise InputError(f"{study.at('study')}: {study.name}: {both} are the same trials; each counts once")


def _name_place(trial: StudyTrial) -> str:
    return ", ".join([*(f"{name} {level}" for name, level in trial.factors), trial.planner])
