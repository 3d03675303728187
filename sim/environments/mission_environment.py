"""What the environments of Gymnasium and PettingZoo share: settings, spaces, observations, rewards and episodes."""

import math
from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
from gymnasium import error, logger, spaces
from numpy.typing import NDArray

from sim.environments.episode import Episode
from sim.environments.observations import NEIGHBOUR, OWN, TRACK, TREE, Observations, Observed
from sim.environments.rewards import ON_BELIEF, Reward, find_reward
from sim.mission.trial import prefix_errors
from sim.replay.flight import Flight
from sim.scenario.loading import place_of, resolve_scenario
from sim.scenario.quantities import REPEATS
from sim.scenario.scenario import Scenario
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Array
from tracking.undetected import raster_shape

RENDER_MODES = ["rgb_array"]
_OBSERVE = {"tracks": 10, "trees": 10, "image": False}
_MOST_ROWS = 10_000
_REPORTED = 2**32  # seeds below this are reserved for reports


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
        """Check the arguments, which are those of `understory.parallel_env`; InputError says what is wrong."""
        self._scenario = resolve_scenario(scenario, settings)
        self._place = place_of(scenario, settings)
        if len(self._scenario.decision_times) < 2:
            raise InputError(f"duration: {self._scenario.duration:g} s is too short; an episode needs two decisions")
        rows = _complete(observe)
        self._image: bool = rows["image"]
        if self._image and not self._scenario.sensing.renders:
            raise InputError(f"observe: there is no image with sensing.mode {self._scenario.sensing.mode!r}")
        self._uavs = range(len(self._scenario.uavs))
        self._observations = Observations(len(self._uavs) - 1, rows["tracks"], rows["trees"])
        self._spaces = [self._space(uav) for uav in self._uavs]  # observation spaces
        self._reward = find_reward(reward)
        self.metadata = {
            **self.metadata,
            "render_fps": self._scenario.rates.planning,
            "reward_sees_truth": reward not in ON_BELIEF,
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
        episode = self._episode()
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
        """Recording since the last reset, with tables and figures; ValueError before the first step."""
        return self._episode().flight()

    def _episode(self) -> Episode:
        """The episode since the last reset; `ResetNeeded` if there was no reset."""
        if self._present is None:
            raise error.ResetNeeded("call reset first")
        return self._present

    def _start(self, seed: int | None, options: Mapping[str, Any] | None, rng: np.random.Generator) -> Episode:
        """Start the mission of a seed, by default one drawn from `rng`; the option `repeat` gives different noise.

        Drawn seeds are 2**32 or more, so that policies are not trained on the maps of reports.
        """
        repeat = 0
        for name, value in (options or {}).items():
            if name != "repeat":
                logger.warn(f"options: {name!r} is unknown and has no effect; allowed is 'repeat'")
            elif not (_is_integer(value) and 0 <= value < REPEATS):
                raise InputError(f"options: repeat {value!r} is not allowed; expected an integer, 0 to {REPEATS - 1}")
            else:
                repeat = int(value)
        self.close()
        drawn = int(rng.integers(_REPORTED, 2**63))
        with prefix_errors(self._place):
            self._present = Episode(self._scenario, drawn if seed is None else seed, repeat)
        return self._present

    def _fly(self, actions: Mapping[int, object]) -> None:
        """Fly to the next decision; `InvalidAction` names a wrong action, `ResetNeeded` means the mission is over."""
        episode = self._episode()
        if episode.over:
            raise error.ResetNeeded("the episode is over; call reset")
        episode.step({uav: self._velocity(uav, action) for uav, action in actions.items()})

    def _observe(self, uav: int) -> Observed:
        """Observation of a UAV; zeros if it has broken down."""
        episode = self._episode()
        situation = episode.team.get(uav)
        if situation is None:
            return {name: _zeros(space) for name, space in self._spaces[uav].items()}
        found = self._observations.of(situation)
        if self._image:
            found["image"] = episode.images.get(uav, self._blank(uav)).copy()
        return found

    def _reward_of(self, uav: int) -> float:
        """Present reward of a UAV, 0 if it has broken down; InputError if a function returns no finite number."""
        episode = self._episode()
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

    def _space(self, uav: int) -> spaces.Dict:
        """Observation space of one UAV."""
        o, area = self._observations, (self._scenario.area.width, self._scenario.area.height)
        tables = {"tracks": (o.tracks, TRACK), "neighbours": (o.neighbours, NEIGHBOUR), "trees": (o.trees, TREE)}
        found: dict[str, spaces.Space[Any]] = {"own": _reals(len(OWN))}
        if not o.neighbours:
            del tables["neighbours"]
        for name, (rows, columns) in tables.items():
            found[name], found[f"{name}_mask"] = _reals(rows, len(columns)), spaces.MultiBinary(rows)
        found["undetected"] = spaces.Box(0.0, np.inf, raster_shape(area))
        if self._image:
            found["image"] = spaces.Box(0, 255, self._blank(uav).shape, np.uint8)
        return spaces.Dict(found)

    def _blank(self, uav: int) -> NDArray[np.uint8]:
        edge = self._scenario.uavs[uav].pixels
        return np.zeros((edge, edge, 3), dtype=np.uint8)

    def _velocity(self, uav: int, action: object) -> Array:
        """Velocity (2,) m/s of an action, shortened to the UAV's speed limit."""
        try:
            given = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            raise error.InvalidAction(f"action of UAV {uav}: {action!r} is not two numbers in [-1, 1]") from None
        if given.shape != (2,) or not np.all(np.isfinite(given)):
            what = f"of shape {given.shape}" if given.shape != (2,) else f"{given.tolist()}"
            raise error.InvalidAction(f"action of UAV {uav}: {what} is not allowed; expected two numbers in [-1, 1]")
        east, north = np.clip(given, -1.0, 1.0).tolist()
        return np.array([east, north]) * (self._scenario.uavs[uav].max_speed / max(1.0, math.hypot(east, north)))


def _complete(given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Settings of observations, completed with defaults; InputError says what is wrong."""
    if given is not None and not isinstance(given, Mapping):
        raise InputError(f"observe: {given!r} is not allowed; expected a dict with keys of {', '.join(_OBSERVE)}")
    observed = {**_OBSERVE, **(given or {})}
    for name, value in observed.items():
        check_known("observe", name, _OBSERVE)
        if name == "image":
            usable, expected = isinstance(value, bool), "True or False"
        else:
            usable, expected = _is_integer(value) and 1 <= value <= _MOST_ROWS, f"an integer, 1 to {_MOST_ROWS}"
        if not usable:
            raise InputError(f"observe: {name} {value!r} is not allowed; expected {expected}")
    return {name: value if name == "image" else int(value) for name, value in observed.items()}


def _is_integer(value: object) -> bool:
    """True for integers of Python and NumPy, but not for True and False."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def _zeros(space: spaces.Space[Any]) -> NDArray[Any]:
    """Zeros with the shape and type of a space of arrays."""
    assert space.shape is not None
    return np.zeros(space.shape, space.dtype)


def _reals(*shape: int) -> spaces.Box:
    return spaces.Box(-np.inf, np.inf, shape, np.float32)
