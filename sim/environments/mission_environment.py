"""What the environments of Gymnasium and PettingZoo share: settings, spaces, observations, rewards and episodes."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from gymnasium import error, logger, spaces
from numpy.typing import NDArray

from sim.environments.episode import Episode
from sim.environments.observations import NEIGHBOUR, OWN, TRACK, TREE, Observations, Observed, check_flag
from sim.environments.rewards import ON_BELIEF, Reward, find_reward
from sim.facts.flight import Flight
from sim.mission.trial import prefix_errors
from sim.mission.world_setup import count_people
from sim.scenario.loading import change_settings, place_of, resolve_scenario
from sim.scenario.quantities import parse_seed_and_repeat
from sim.scenario.scenario import Scenario
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Array
from tracking.undetected import raster_shape

RENDER_MODES = ["rgb_array"]
_OBSERVE = {"tracks": 10, "trees": 10, "image": False, "flat": False, "scaled": False, "undetected": False}
_REPORTED = 2**32  # seeds below this are reserved for reports
_OPTIONS = ("repeat", "settings")  # of `reset`
# Columns of UAVs and people in the true state.
_UAV = ("x", "y", "z", "vx", "vy", "works")
_PERSON = ("x", "y", "vx", "vy", "present")
Observation = Observed | NDArray[np.float32]


class Asked(NamedTuple):
    """An episode as `reset` was asked for it."""

    scenario: Scenario
    seed: int | None  # None: draw one
    repeat: int


class MissionEnvironment:
    """Episodes in the missions of a scenario: settings, spaces, observations and rewards of UAVs, and rendering."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 - as in Gymnasium and PettingZoo

    def __init__(
        self,
        scenario: str | Scenario = "forest",
        *,
        settings: Mapping[str, Any] | None = None,
        reward: str | Reward = "gospa",
        observe: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Check the arguments, as `understory.parallel_env` has them; InputError says what is wrong."""
        self._scenario = resolve_scenario(scenario, settings)
        self._place = place_of(scenario, settings)
        rows = _complete(observe)
        self._image: bool = rows["image"]
        self._flat: bool = rows["flat"]
        self._check(self._scenario)
        self._uavs = range(len(self._scenario.uavs))
        seen = {name: rows[name] for name in ("tracks", "trees", "scaled", "undetected")}
        self._observations = Observations(len(self._uavs) - 1, **seen)
        self._spaces = self._make_observation_spaces(self._scenario)  # one per UAV
        self._reward = find_reward(reward)
        self.metadata = {
            **self.metadata,
            "render_fps": self._scenario.rates.planning,
            "reward_sees_truth": reward not in ON_BELIEF,
            "state_sees_truth": True,
        }
        if render_mode not in (None, *RENDER_MODES):
            raise error.UnsupportedMode(f"render_mode: {render_mode!r} is not allowed; expected None or 'rgb_array'")
        self.render_mode = render_mode
        self._present: Episode | None = None
        self._set_up()

    def _set_up(self) -> None:
        """Set the spaces of observations and actions, and what else the library asks for."""
        raise NotImplementedError

    def render(self) -> NDArray[np.uint8] | None:
        """A frame (720, 1280, 3) RGB as in films, with the true people; None and a warning without `render_mode`."""
        episode = self._require_episode()
        if self.render_mode is None:
            logger.warn("render: made without a render_mode; 'rgb_array' gives frames")
            return None
        return episode.draw()

    def close(self) -> None:
        """End the mission; the next reset starts another one."""
        if self._present is not None:
            self._present.close()
            self._present = None

    def flight(self) -> Flight:
        """Recording since the last reset, with tables and figures; ValueError before the first step.

        `flight().save("episode.npz")` writes it for `understory explain`, `replay` and `export`.
        """
        return self._require_episode().flight()

    @cached_property
    def state_space(self) -> spaces.Box:
        """Space of `state`, with room for as many people as the scenario has."""
        return _make_real_space(1 + len(_UAV) * len(self._uavs) + len(_PERSON) * count_people(self._scenario))

    def state(self) -> NDArray[np.float32]:
        """The true state of the mission as a vector, for training only: a policy may not use it in flight.

        Time [s]; of each UAV x, y, z [m], velocity east and north [m/s], and 1 if it works; of each person x, y [m],
        velocity east and north [m/s], and 1 if present. What is absent is zero.
        """
        return _make_state(self._require_episode(), self.state_space.shape[0])

    def _require_episode(self) -> Episode:
        """The episode since the last reset; `ResetNeeded` if there was no reset."""
        if self._present is None:
            raise error.ResetNeeded("call reset first")
        return self._present

    def _check(self, scenario: Scenario) -> None:
        """InputError if an episode of a scenario would be too short, or has no images although they are asked for."""
        if len(scenario.decision_times) < 2:
            raise InputError(f"duration: {scenario.duration:g} s is too short; an episode needs two decisions")
        if self._image and not scenario.sensing.renders:
            raise InputError(f"observe: there is no image with sensing.mode {scenario.sensing.mode!r}")

    def _read_reset(self, seed: int | None, options: Mapping[str, Any] | None) -> Asked:
        """Read the arguments of `reset`; InputError says what is wrong, and the present episode can go on."""
        given = options or {}
        for name in given:
            if name not in _OPTIONS:
                logger.warn(f"options: {name!r} is unknown and has no effect; allowed are {', '.join(_OPTIONS)}")
        number, repeat = parse_seed_and_repeat(0 if seed is None else seed, given.get("repeat", 0))
        scenario = change_settings(self._scenario, given.get("settings"))
        self._check(scenario)
        if scenario is not self._scenario and not self._looks_alike(scenario):
            raise InputError("options: settings of other area, uavs or pixels need an environment of their own")
        return Asked(scenario, None if seed is None else number, repeat)

    def _looks_alike(self, scenario: Scenario) -> bool:
        """True if a scenario has this environment's observations, in the same area, by which numbers may be scaled."""
        return scenario.area == self._scenario.area and self._make_observation_spaces(scenario) == self._spaces

    def _start(self, asked: Asked, rng: np.random.Generator) -> Episode:
        """Start an episode; its seed is drawn from `rng` if none was asked for.

        Drawn seeds are 2**32 or more, so that policies are not trained on the maps of reports.
        """
        self.close()
        drawn = int(rng.integers(_REPORTED, 2**63))
        with prefix_errors(self._place):
            self._present = Episode(asked.scenario, drawn if asked.seed is None else asked.seed, asked.repeat)
        return self._present

    def _fly(self, actions: Mapping[int, object]) -> None:
        """Fly to the next decision; `InvalidAction` names a wrong action, `ResetNeeded` means the mission is over."""
        episode = self._require_episode()
        if episode.over:
            raise error.ResetNeeded("the episode is over; call reset")
        episode.step({uav: self._limit_velocity(uav, action) for uav, action in actions.items()})

    def _observe(self, uav: int) -> Observed:
        """Observation of a UAV; zeros if it has broken down."""
        episode = self._require_episode()
        situation = episode.team.get(uav)
        if situation is None:
            return {name: make_zeros(space) for name, space in self._spaces[uav].items()}
        found: Observed = self._observations.of(situation)
        if self._image:
            found["image"] = self._show(uav)
        return found

    def _show(self, uav: int) -> NDArray[np.uint8]:
        """The frame of a UAV; zeros if it has broken down."""
        image = self._require_episode().images.get(uav)
        return make_zeros(self._spaces[uav]["image"]) if image is None else image.copy()

    def _compute_reward(self, uav: int) -> float:
        """Present reward of a UAV, 0 if it has broken down; InputError if a function returns no finite number."""
        episode = self._require_episode()
        situation = episode.team.get(uav)
        if situation is None:
            return 0.0
        given = self._reward(situation, episode.people)
        try:
            reward = float(given)
        except (TypeError, ValueError, OverflowError):
            reward = math.nan
        if not math.isfinite(reward):
            raise InputError(f"reward: the function returned {given!r}; expected a finite number")
        return reward

    def _flatten_space(self, space: spaces.Dict) -> spaces.Space[Any]:
        """The space of observations that are given: one vector if they are asked for as `flat`."""
        return spaces.flatten_space(space) if self._flat else space

    def _flatten(self, space: spaces.Dict, observed: Observed) -> Observation:
        """An observation as it is given: one vector if they are asked for as `flat`."""
        return np.asarray(spaces.flatten(space, observed)) if self._flat else observed

    def _make_observation_spaces(self, scenario: Scenario) -> list[spaces.Dict]:
        """Observation spaces of the UAVs of a scenario."""
        area = scenario.area.width, scenario.area.height
        return [self._make_space(area, uav.true_camera.size) for uav in scenario.uavs]

    def _make_space(self, area: tuple[float, float], size: tuple[int, int]) -> spaces.Dict:
        """Observation space of one UAV, given width and height of the area [m] and of its image [pixels]."""
        o, most = self._observations, 1.0 if self._observations.scaled else np.inf
        tables = {"tracks": (o.tracks, TRACK), "neighbours": (o.neighbours, NEIGHBOUR), "trees": (o.trees, TREE)}
        found: dict[str, spaces.Space[Any]] = {"own": _make_real_space(len(OWN), most=most)}
        if not o.neighbours:
            del tables["neighbours"]
        for name, (rows, columns) in tables.items():
            found[name] = _make_real_space(rows, len(columns), most=most)
            found[f"{name}_mask"] = make_mask_space(rows)
        if o.undetected:
            found["undetected"] = spaces.Box(0.0, most, raster_shape(area))
        if self._image:
            found["image"] = spaces.Box(0, 255, (*size[::-1], 3), np.uint8)
        return spaces.Dict(found)

    def _limit_velocity(self, uav: int, action: object) -> Array:
        """Velocity (2,) m/s of an action, shortened to the UAV's speed limit."""
        try:
            given = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            raise error.InvalidAction(f"action of UAV {uav}: {action!r} is not two numbers in [-1, 1]") from None
        if given.shape != (2,) or not np.all(np.isfinite(given)):
            what = f"of shape {given.shape}" if given.shape != (2,) else f"{given.tolist()}"
            raise error.InvalidAction(f"action of UAV {uav}: {what} is not allowed; expected two numbers in [-1, 1]")
        east, north = np.clip(given, -1.0, 1.0).tolist()
        most = self._require_episode().mission.scenario.uavs[uav].max_speed
        return np.array([east, north]) * (most / max(1.0, math.hypot(east, north)))


def _complete(given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Settings of observations, completed with defaults; InputError says what is wrong."""
    if given is not None and not isinstance(given, Mapping):
        raise InputError(f"observe: {given!r} is not allowed; expected a dict with keys of {', '.join(_OBSERVE)}")
    observed = {**_OBSERVE, **(given or {})}
    for name in observed:
        check_known("observe", name, _OBSERVE)
    with prefix_errors("observe: "):
        check_flag("image", observed["image"])
        Observations(0, **{name: value for name, value in observed.items() if name != "image"})
    return observed


def make_zeros(space: spaces.Space[Any]) -> NDArray[Any]:
    """Zeros with the shape and type of a space of arrays."""
    assert space.shape is not None
    return np.zeros(space.shape, space.dtype)


def make_mask_space(*shape: int) -> spaces.Box:
    """Space of masks, in a form that all libraries know."""
    return spaces.Box(0, 1, shape, np.int8)


def _make_real_space(*shape: int, most: float = np.inf) -> spaces.Box:
    return spaces.Box(-most, most, shape, np.float32)


def _make_state(episode: Episode, size: int) -> NDArray[np.float32]:
    """Time, UAVs and people at the present decision, then zeros; InputError if there are more people than rows."""
    now, mission = episode.now, episode.mission
    uavs = np.zeros((len(now.poses), len(_UAV)))
    uavs[:, :3] = [pose.position for pose in now.poses]
    for uav, situation in episode.team.items():
        uavs[uav, 3:] = *situation.own.velocity, 1.0
    half, end = 0.5 / mission.scenario.rates.sensing, float(mission.people.times[-1])
    begun, ended = max(0.0, now.time - half), min(now.time + half, end)
    moved = mission.people.at(ended).positions - mission.people.at(begun).positions
    present = ~np.isnan(now.people[:, :1])
    people = np.nan_to_num(np.hstack([now.people, moved / (ended - begun), present]))
    found = np.concatenate([[now.time], uavs.ravel(), people.ravel()])
    if len(found) > size:
        raise InputError(f"state: has no room for {len(people)} people; make the environment with as many")
    return np.pad(found, (0, size - len(found))).astype(np.float32)
