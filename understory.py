"""Understory in Python: fly missions, compare planners, examine recordings, write planners, detectors and trackers.

Example:
    ```python
    import understory

    flight = understory.run("forest", "greedy", seed=3, settings={"duration": 10, "trees.density": 75})
    print(flight)
    print(flight.columns("losses"))
    ```
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext, suppress
from importlib import import_module
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

# Check that no other module hides these packages, before anything is imported from them.
for _package in ("sim", "planning", "tracking"):
    _found = find_spec(_package)
    _places = [*(_found.submodule_search_locations or ()), _found.origin] if _found else []
    if _places and str(Path(__file__).with_name(_package)) not in _places:
        raise ImportError(f"understory: {_places[0]} hides Understory's package {_package!r}; rename it")

from planning.composed import Composed
from planning.coordination.decision import Coordination, decide_own_plan
from planning.objective.nbo import make_objective
from planning.objective.terms import Term
from planning.optimizers.cross_entropy import CrossEntropy
from planning.optimizers.optimizer import make_pursuits
from planning.planner import Exchange, Plan, Planner, Situation, Vehicle
from planning.planner_check import check_planner
from planning.planner_loading import PlannerError, load_planner, resolve_planner
from planning.prediction.field_of_view import aim_point, view_quadrangle
from planning.prediction.intent import expect_plans
from planning.prediction.propagation import Nominal, nominal_positions
from planning.prediction.quadrangle import inside, shortest_move
from planning.prediction.response import mean_velocities, response
from planning.testing.made_up_teams import make_random_team
from sim.environments.observations import Observations
from sim.exchange.export import EXPORTS, LABELS, check_options, write_labelled_images
from sim.exchange.export import export as write_export
from sim.exchange.mapped_trees import list_frames, map_frames, write_stem_map
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import name_flight, track_flight
from sim.facts.columns import make_dataframe
from sim.facts.flight import Flight, load
from sim.facts.metrics.metric import Metric, Outcome
from sim.mission.mission import Mission
from sim.mission.recording import Recording
from sim.mission.trial import Trial, prefix_errors
from sim.running.fly import fly_mission, record
from sim.running.results import run_mission
from sim.scenario.loading import place_of, resolve_scenario
from sim.scenario.quantities import WORKERS, parse_integer, parse_seed_and_repeat
from sim.scenario.scenario import Scenario
from sim.scenario.settings_text import format_overrides
from sim.sensing.detector_check import check_detector
from sim.sensing.mapper_check import check_mapper
from sim.sensing.sensor_mode import SensorMode, SensorOutput, SensorSetup, Shot
from sim.study.analysis.groups import find_varying_factors
from sim.study.analysis.levels import Threshold, find_levels
from sim.study.definition import adapt_study, make_study, read_study
from sim.study.executors import Pool
from sim.study.report.comparison import About, compare_rows
from sim.study.report.levels import list_level_fields
from sim.study.scheduler import complete, fly_trials
from sim.study.store import Store, read_rows, tabulate_rows
from sim.study.trials import list_trials
from sim.world.walks import Itinerary
from tracking.detection.detector import Detections, Detector, Frame
from tracking.errors import InputError, check_known
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.filter.motion import MotionModel
from tracking.fusion.consensus import step as step_fleet
from tracking.fusion.exchange import TrackExchange
from tracking.fusion.member import Member
from tracking.fusion.message import Message
from tracking.fusion.rule import Contribution, FusionRule, KullbackLeiblerAverage, LocalBeliefs
from tracking.fusion.tracker_check import check_tracker
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.leaf_gaps import detectability, detectable_share
from tracking.geometry.line_of_sight import Grid, free_share
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, visible_samples
from tracking.mapping.mapper import MappedTree, ParallaxMapper, SeenGround, TreeMapper
from tracking.metrics.ospa import gospa, ospa
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled
from tracking.numerics.distances import length
from tracking.numerics.exponential import exp
from tracking.numerics.matrices import apply
from tracking.numerics.trigonometry import cos_each, sin_each
from tracking.parameters import TrackerParameters
from tracking.track import Scan, Track, beliefs_of
from tracking.tracker import Tracker

__all__ = [  # noqa: RUF022 - grouped by who needs the names
    # Everybody: fly, look at what was flown, take it elsewhere.
    "Flight",
    "InputError",
    "Recording",
    "Scenario",
    "export",
    "load",
    "run",
    "track",
    # Who compares planners: missions on the same maps, as data frames.
    "compare",
    "compare_levels",
    "fly_study",
    # Who decides each step: missions in Python, and environments for learning.
    "Mission",
    "Observations",
    "mission",
    "parallel_env",
    "record",
    # Authors of planners.
    "Exchange",
    "Plan",
    "Planner",
    "Situation",
    "Vehicle",
    "check_planner",
    "load_planner",
    "make_random_team",
    # Authors of detectors, and whoever needs cameras and maps.
    "Camera",
    "Detections",
    "Detector",
    "Forest",
    "Frame",
    "Pose",
    "TARGET_HEIGHT",
    "check_detector",
    "check_mapper",
    "visible_samples",
    # Whoever maps trees, and authors of mappers.
    "MappedTree",
    "ParallaxMapper",
    "SeenGround",
    "TreeMapper",
    "map_trees",
    # Authors of trackers, and whoever tracks scans of their own.
    "Gaussian",
    "Member",
    "Message",
    "Scan",
    "Track",
    "TrackExchange",
    "Tracker",
    "TrackerParameters",
    "beliefs_of",
    "check_tracker",
    "read_flight",
    "step_fleet",
    # Authors of motion models and of fusion rules.
    "Contribution",
    "FusionRule",
    "KullbackLeiblerAverage",
    "LocalBeliefs",
    "MeanRevertingVelocity",
    "MotionModel",
    "NearlyConstantVelocity",
    # Authors of metrics.
    "Metric",
    "Outcome",
    "gospa",
    "ospa",
    # Authors of sensor modes and of ways of walking.
    "Itinerary",
    "SensorMode",
    "SensorOutput",
    "SensorSetup",
    "Shot",
    # Pieces of the built-in planners; they may change from one version to the next.
    "Composed",
    "Coordination",
    "CrossEntropy",
    "Grid",
    "Nominal",
    "Term",
    "aim_point",
    "decide_own_plan",
    "detectability",
    "detectable_share",
    "expect_plans",
    "free_share",
    "inside",
    "make_objective",
    "make_pursuits",
    "mean_velocities",
    "nominal_positions",
    "response",
    "shortest_move",
    "view_quadrangle",
    # Arithmetic that gives the same bits on every processor, for planners whose missions are to be repeated elsewhere.
    "Array",
    "apply",
    "compiled",
    "cos_each",
    "exp",
    "length",
    "sin_each",
]


def run(
    scenario: str | Scenario = "forest",
    planner: str | Planner = "sma-nbo-gospa",
    *,
    seed: int = 0,
    repeat: int = 0,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
) -> Flight:
    """Fly one mission in this process, and return its recording with tables and figures.

    Args:
        scenario: Name of a packaged scenario, a .toml file, or a `Scenario`.
        planner: Name with or without options, "module:Class", or an object with a method `plan(team, rng)`.
        seed: Decides the forest and the people.
        repeat: Decides, together with the seed, all other randomness: noise, network, wind and planner.
        settings: Keys of the scenario to change, as {"trees.density": 75}.
        out: New folder for the files of `understory run`; the planner must then be text. By default no file is written.

    Raises:
        InputError: If scenario, settings, planner or folder cannot be used.
    """
    setting = resolve_scenario(scenario, settings)
    numbers = parse_seed_and_repeat(seed, repeat)
    place = place_of(scenario, settings)
    if out is not None:
        if not isinstance(planner, str):
            raise InputError(f"out: not allowed with a planner that is an object, {planner!r}; name it as module:Class")
        run_mission(Trial(setting, planner, *numbers, place), Path(out))
        return load(out)
    trial = Trial(setting, planner if isinstance(planner, str) else type(planner).__qualname__, *numbers, place)
    return Flight(fly_mission(trial, resolve_planner(planner)).recording)


def track(
    folder: str | Path,
    *,
    settings: Mapping[str, Any] | None = None,
    origin: tuple[float, float] = (0.0, 0.0),
    sigma: float = 0.0,
    detector: str = "blob",
    classes: str = "",
    least_score: float | None = None,
) -> Flight:
    """Track people in a flight from elsewhere, and return its recording with tables and figures.

    Args:
        folder: The flight's files, see docs/how-to/flights.md.
        settings: Keys of `scenario.toml` to change, as {"tracking.sigma_a": 1.0}.
        origin: Place in the files [m] that becomes the area's centre.
        sigma: Standard deviation [m] that is added to detections without a covariance.
        detector: Name or "module:Class" of what finds people in images.
        classes: Names or numbers of the classes of detections that count, as "pedestrian,people"; by default of people.
        least_score: Of detections that count; by default more than 0.

    Raises:
        InputError: If the input is wrong.
    """
    flight = read_flight(
        folder,
        overrides=format_overrides(settings),
        origin=origin,
        sigma=sigma,
        detector=detector,
        classes=classes,
        least_score=least_score,
    )
    return Flight(track_flight(flight, name=name_flight(Path(folder))).recording)


def map_trees(
    frames: Flight | Iterable[Frame], *, uav: int = 0, mapper: str = "parallax", out: str | Path | None = None
) -> tuple[MappedTree, ...]:
    """Map the trees in the frames of one moving camera, without any knowledge of where trees are.

    Args:
        frames: Frames of one camera in order of time, or a flight whose frames are rendered again.
        uav: The UAV of the flight whose camera it is.
        mapper: Name or "module:Class" of what maps trees, see `TreeMapper`.
        out: File for the trees as a stem map, which `trees.file` reads.

    Raises:
        InputError: If an argument cannot be used.
    """
    given = list_frames(frames.recording, uav) if isinstance(frames, Flight) else frames
    found = map_frames(given, mapper)
    if out is not None:
        write_stem_map(found, Path(out))
    return found


def mission(
    scenario: str | Scenario = "forest",
    planner: str | Planner | None = None,
    *,
    seed: int = 0,
    repeat: int = 0,
    settings: Mapping[str, Any] | None = None,
) -> Mission:
    """A mission to fly scan by scan with `Mission.step`, with your own plans or with those of a planner.

    Args:
        scenario: Name of a packaged scenario, a .toml file, or a `Scenario`.
        planner: Plans each step for which you give no plans; the same values as for `run`.
        seed: Decides the forest and the people.
        repeat: Decides, together with the seed, all other randomness.
        settings: Keys of the scenario to change, as {"trees.density": 75}.

    Raises:
        InputError: If scenario, settings or planner cannot be used.
    """
    made = None if planner is None else resolve_planner(planner)
    setting = resolve_scenario(scenario, settings)
    numbers = parse_seed_and_repeat(seed, repeat)
    with prefix_errors(place_of(scenario, settings), PlannerError):
        return Mission(setting, made, *numbers)


def compare(
    planners: str | Sequence[str],
    scenarios: str | Sequence[str] = "forest",
    *,
    seeds: Iterable[int] = range(10),
    repeats: int = 1,
    settings: Mapping[str, Any] | None = None,
    vary: Mapping[str, Sequence[Any]] | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
) -> Any:  # noqa: ANN401 - pandas' or polars' frame, of which neither is needed otherwise
    """Fly every planner in every scenario on the same maps, and return a data frame with a row for each mission.

    A script has to call this under `if __name__ == "__main__":`, because other processes import it. No file is kept.

    Args:
        planners: One or several names, with or without options, or "module:Class". Objects cannot be given.
        scenarios: One or several names of packaged scenarios or .toml files.
        seeds: Maps to fly. Each seed gives one forest and its people, the same for all planners.
        repeats: Number of flights on each map, each with different noise.
        settings: Keys of the scenarios to change, as {"trees.density": 75}.
        vary: Levels by key of the scenarios or `planner.option`, as {"fleet.size": [1, 2], "planner.horizon": [3, 5]};
            all their combinations are flown.
        workers: Number of processes; by default one per core.
        executor: Flies the missions in place of such processes, for example dask's `client.get_executor(pure=False)`.

    Returns:
        A pandas data frame, or a polars one if pandas is not installed. Its columns are planner, scenario, seed,
        repeat, status, one per metric, such as `ospa.mean_m`, and one per varied key, as `factor.fleet.size`. A failed
        mission has an error in place of metrics.

    Raises:
        InputError: If an argument cannot be used, or neither pandas nor polars is installed.
    """
    tabulate_rows([])  # raises the error for a missing library now rather than after the flights
    processes = None if workers is None else parse_integer(workers, "workers", least=1, most=WORKERS)
    listed = list_trials(make_study(planners, scenarios, seeds=seeds, repeats=repeats, settings=settings, vary=vary))
    with nullcontext(executor) if executor else Pool(processes) as flying:
        return tabulate_rows(fly_trials(listed, flying))


def fly_study(
    study: str | Path,
    out: str | Path,
    *,
    planners: str | Sequence[str] = (),
    seeds: str | None = None,
    settings: Mapping[str, Any] | None = None,
    executor: Executor | None = None,
) -> Any:  # noqa: ANN401 - as `compare`
    """Fly the trials of a study that its folder lacks, and return a data frame with a row for each trial.

    A script has to call this under `if __name__ == "__main__":`, because other processes import it.

    Args:
        study: Name of a packaged study, or a .toml file.
        out: Folder of the study's results, such as that of `understory compare`; finished trials are not flown again.
        planners: Names of planners in place of the study's.
        seeds: Maps in place of the study's, as `--seeds` takes them: "0-9" or "0,3,5".
        settings: Keys of the scenarios to change in all trials.
        executor: Flies the trials, for example dask's `client.get_executor(pure=False)`; by default, processes of this
            machine, one per core.

    Returns:
        A data frame as that of `compare`, with a column for each factor, such as `factor.lambda`.

    Raises:
        InputError: If an argument cannot be used, or neither pandas nor polars is installed.
    """
    tabulate_rows([])  # as in `compare`
    names = (planners,) if isinstance(planners, str) else tuple(planners)
    made = adapt_study(read_study(str(study)), planners=names, seeds=seeds, overrides=format_overrides(settings))
    with Store.open(Path(out), made.name) as store, nullcontext(executor) if executor else Pool() as flying:
        return tabulate_rows(complete(list_trials(made), store, flying))


def compare_levels(folder: str | Path, metric: str | None = None, *, threshold: float | None = None) -> Any:  # noqa: ANN401
    """Compare the levels of each factor of a study that was flown, and return a data frame with a row for each level.

    Args:
        folder: Folder of the study's results, such as that of `understory compare`.
        metric: What is compared; by default the first metric of the report.
        threshold: Value that the metric is to reach, or not to exceed if lower values are better.

    Returns:
        A data frame as that of `compare`. It has the mean with its 95 % interval for each planner, level of a factor
        and combination of the other factors; paired differences from the level before (`minus_before`) and the best
        level (`minus_best`) with intervals, p-values and Holm's correction; and the confidence that the mean meets the
        threshold (`sure`), with the number of maps that do (`met`). Values are in SI units, levels in natural order.

    Raises:
        InputError: If there is no such study or metric, or neither pandas nor polars is installed.
    """
    rows = read_rows(folder)
    compared = compare_rows(rows, About("", metrics=(metric,) if metric else ()))
    first = compared.metrics[0]
    bound = None if threshold is None else Threshold(first.name, threshold, first.better != "lower")
    found = find_levels(compared.groups, first, find_varying_factors(compared.groups), bound)
    fields = list_level_fields(found, first)
    return make_dataframe({name: [row[name] for row in fields] for name in dict.fromkeys(chain(*fields))})


def export(
    flights: Flight | Sequence[Flight],
    to: str,
    out: str | Path,
    *,
    truth: bool = True,
    images: str | None = None,
    every: float = 0.0,
    splits: Mapping[int, str] | None = None,
) -> None:
    """Write a flight for other tools into a new folder, or labelled images of one or several missions.

    Args:
        flights: What to write; several only as labelled images.
        to: "csv", "stonesoup", "mot", "parquet" or "rosbag"; for labelled images "coco" or "yolo".
        out: New folder, written completely or not at all.
        truth: False to leave people, errors and events out of a bag.
        images: "png" for images in a bag without loss, in place of "jpeg".
        every: Least time [s] between two labelled images of one camera.
        splits: "val" or "test" for labelled images of missions of a seed; all others are for training.

    Raises:
        InputError: If an argument cannot be used, or a library that writes the format is not installed.
    """
    check_known("to", to, [*EXPORTS, *LABELS])
    check_options(to, truth=truth, images=images)
    given = [flights] if isinstance(flights, Flight) else list(flights)
    if to in LABELS:
        if any(flight.recording.frames is not None for flight in given):
            raise InputError("flights: one was not flown here, so its images cannot be rendered")
        write_labelled_images((f.recording for f in given), to, Path(out), splits=splits or {}, every=every)
    elif len(given) != 1:
        raise InputError(f"flights: {len(given)} are given; {to} takes one")
    else:
        write_export(given[0].recording, to, Path(out), truth=truth, images=images)


def parallel_env(
    scenario: str | Scenario = "forest",
    *,
    settings: Mapping[str, Any] | None = None,
    reward: str | Callable[[Situation, Any], float] = "gospa",
    observe: Mapping[str, Any] | None = None,
    render_mode: str | None = None,
) -> Any:  # noqa: ANN401 - PettingZoo's class, which is not needed otherwise
    """PettingZoo environment of a mission: each UAV is an agent, and each step flies from one decision to the next.

    With Gymnasium the team is one agent: `gymnasium.make("understory/Forest-v0")` takes the same arguments.
    Actions are velocities east and north as fractions of the UAV's speed limit; faster ones are shortened to the limit.
    Observations hold the knowledge of a UAV and no ground truth; see `understory.Observations`. An agent is terminated
    when its UAV breaks down, and truncated at the last decision. Infos hold the time and the true OSPA and GOSPA.
    The environment's `flight()` returns the recording so far; `flight().save("episode.npz")` writes it. `state()` is
    the true state as a vector, for training only.

    `reset(seed=3)` flies the map of `understory run --seed 3`. A reset without a seed draws a seed of 2**32 or more, so
    that a policy is not trained on the maps of reports. Options of `reset`: `{"repeat": 1}` gives different noise, and
    `{"settings": {"trees.density": 75}}` changes keys of the scenario for one episode.

    Args:
        scenario: Name of a packaged scenario, a .toml file, or a `Scenario`.
        settings: Keys of the scenario to change, as {"trees.density": 75}.
        reward: `"gospa"`: negative GOSPA expected under the UAV's own belief; `"trace"`: negative sum of its tracks'
            variances; `"true_gospa"`: negative true GOSPA; or a function of a `Situation` and of the true positions
            (M, 2) m. The last two use ground truth and are for training only.
        observe: Numbers of rows of `tracks` and `trees`, 10 each by default; True for `image` adds the frame, True for
            `undetected` the map of people not found yet, True for `flat` gives one vector, and True for `scaled`
            numbers from -1 to 1, as in `understory.Observations`.
        render_mode: With `"rgb_array"`, `render()` returns frames like those of films, which show the true people.

    Raises:
        InputError: If an argument cannot be used, or PettingZoo is not installed.
    """
    for name in ("gymnasium", "pettingzoo"):
        if find_spec(name) is None:
            raise InputError(f"{name} is not installed; environments need: pip install gymnasium pettingzoo")
    from sim.environments.parallel import TeamParallelEnv

    return TeamParallelEnv(scenario, settings=settings, reward=reward, observe=observe, render_mode=render_mode)


if find_spec("gymnasium"):  # costs 0.1 s, but gymnasium.make then finds the scenarios in any order of imports
    with suppress(ImportError):  # a broken Gymnasium matters to environments only
        import_module("sim.environments.registration")
