"""Understory in Python: fly missions, compare planners, look into recordings, write planners and detectors.

Example:
    ```python
    import understory

    flight = understory.run("forest", "greedy", seed=3, settings={"duration": 10, "trees.density": 75})
    print(flight)
    print(flight.columns("losses"))
    ```

All names but `run` and `compare` stand for classes and functions of the packages, imported at their first use.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planning.conformance.checks import check as check_planner
    from planning.planner import Exchange, Plan, Planner, Situation, Vehicle
    from sim.conformance.detector import check as check_detector
    from sim.mission.mission import Mission
    from sim.recording.recording import Recording
    from sim.replay.notebook import Flight, load
    from sim.scenario.errors import InputError
    from sim.scenario.scenario import Scenario
    from tracking.detection.detector import Detections, Detector, Frame
    from tracking.geometry.camera import Camera, Pose
    from tracking.tracker import Track

__all__ = [
    "Camera",
    "Detections",
    "Detector",
    "Exchange",
    "Flight",
    "Frame",
    "InputError",
    "Mission",
    "Plan",
    "Planner",
    "Pose",
    "Recording",
    "Scenario",
    "Situation",
    "Track",
    "Vehicle",
    "check_detector",
    "check_planner",
    "compare",
    "load",
    "run",
]

_HOMES = {
    "planning.planner": ("Exchange", "Plan", "Planner", "Situation", "Vehicle"),
    "sim.mission.mission": ("Mission",),
    "sim.recording.recording": ("Recording",),
    "sim.replay.notebook": ("Flight", "load"),
    "sim.scenario.errors": ("InputError",),
    "sim.scenario.scenario": ("Scenario",),
    "tracking.detection.detector": ("Detections", "Detector", "Frame"),
    "tracking.geometry.camera": ("Camera", "Pose"),
    "tracking.tracker": ("Track",),
}
_CHECKS = {"check_detector": "sim.conformance.detector", "check_planner": "planning.conformance.checks"}


def run(
    scenario: str | Scenario = "forest",
    planner: str | Planner = "sma-nbo-mwtp",
    *,
    seed: int = 0,
    repeat: int = 0,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
) -> Flight:
    """Fly one mission in this process, and return it to look into.

    Args:
        scenario: Name of a packaged scenario, a .toml file, or a `Scenario`.
        planner: Name with or without options, "module:Class", or an object with a method `plan(team, rng)`.
        seed: Gives the forest and the people.
        repeat: Gives, with the seed, all other chance: noise, network, wind and planner.
        settings: Keys of the scenario that differ, as {"trees.density": 75}.
        out: New folder for the files that `understory run` leaves, film and page among them; the planner has to be
            text then. Nothing is written without it.

    Raises:
        InputError: Where scenario, settings or folder cannot be used.
        PlannerError: Where there is no such planner.
    """
    from planning.loading import load_planner
    from sim.mission.mission import Mission, Trial
    from sim.recording.recording import Recorder
    from sim.replay.notebook import Flight, load
    from sim.scenario.errors import InputError
    from sim.scenario.loading import load as load_scenario
    from sim.scenario.scenario import resolved

    setting = load_scenario(scenario, _overrides(settings)) if isinstance(scenario, str) else scenario
    if setting is scenario and settings:
        raise InputError("settings: not allowed with a Scenario; set its fields")
    if out is not None:
        from sim.running.run import run as fly

        if not isinstance(planner, str):
            raise InputError(f"out: not allowed with a planner that is an object, {planner!r}; name it as module:Class")
        fly(Trial(setting, planner, seed, repeat), Path(out))
        return load(out)
    made = load_planner(planner) if isinstance(planner, str) else planner
    name = planner if isinstance(planner, str) else type(planner).__qualname__
    mission, recorder = Mission(setting, made, seed, repeat), Recorder(repeat)
    for snapshot in mission.fly():
        recorder.add(snapshot)
    recording = recorder.recording(
        scenario=resolved(setting),
        planner=name,
        seed=seed,
        forest=mission.forest,
        sees_truth=mission.sees_truth,
    )
    return Flight(recording)


def compare(
    planners: Sequence[str],
    scenarios: str | Sequence[str] = "forest",
    *,
    seeds: Iterable[int] = range(10),
    repeats: int = 1,
    settings: Mapping[str, Any] | None = None,
    workers: int | None = None,
) -> Any:  # noqa: ANN401 - pandas' or polars' frame, of which neither is needed otherwise
    """Fly every planner in every scenario on the same maps, and return a data frame with a row for each mission.

    Missions fly in processes of this machine. A script has to call this under `if __name__ == "__main__":`, since
    new processes import it. Nothing is kept on disk: for studies of hours there is the command `understory compare`.

    Args:
        planners: Planners as text, since other processes make them: names with or without options, or "module:Class".
        scenarios: One or several names of packaged scenarios or .toml files.
        seeds: Maps to fly: each gives one forest and its people, the same for all planners.
        repeats: Flights on each map, with other noise each.
        settings: Keys of the scenarios that differ, as {"trees.density": 75}.
        workers: Number of processes; one for each core if not given.

    Returns:
        A pandas frame, or a polars one where there is no pandas: planner, scenario, seed, repeat, status, and a column
        for each metric, such as `ospa.mean_m`. A mission that failed has its status, its error and no metrics.

    Raises:
        InputError: Where something cannot be used, or neither pandas nor polars is installed.
        PlannerError: Where there is no such planner.
    """
    from sim.recording.dataframes import dataframe
    from sim.study.engine import fly_all
    from sim.study.pool import Pool
    from sim.study.row import Row
    from sim.study.store import frame_of
    from sim.study.study import Study
    from sim.study.tasks import tasks

    dataframe({})  # complains now rather than after the flights
    study = Study(
        name="compare",
        planners=tuple(dict.fromkeys(planners)),
        scenarios=(scenarios,) if isinstance(scenarios, str) else tuple(scenarios),
        seeds=",".join(map(str, seeds)),
        repeats=repeats,
        settings=dict(item.split("=", 1) for item in _overrides(settings)),
    )
    rows: dict[str, Row] = {}
    listed = tasks(study)
    with Pool(workers or os.cpu_count() or 1) as pool:
        fly_all(listed, pool, lambda task, flown: rows.update({task.key: flown.row}))
    return frame_of([rows[task.key] for task in listed])


def _overrides(settings: Mapping[str, Any] | None) -> list[str]:
    """Settings as `--set` takes them."""
    from sim.study.settings_text import flat, toml

    return [f"{key}={toml(value)}" for key, value in flat(settings or {}).items()]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - what the name stands for
    """A class or function of the packages; importing them all takes a second or two."""
    if name in _CHECKS:
        return import_module(_CHECKS[name]).check
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'understory' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
