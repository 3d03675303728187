"""Vector environment of Gymnasium: many teams, flown by a process for each core."""

import gc
import multiprocessing
import pickle
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from functools import partial
from itertools import pairwise
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

import numpy as np
from gymnasium import error
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import CloudpickleWrapper, batch_space, create_shared_memory, read_from_shared_memory
from numpy.typing import NDArray

from sim.environments.mission_environment import Observation
from sim.environments.team import TeamEnv
from sim.processes.cores import count_cores
from sim.processes.exits import describe_exit
from sim.processes.workers import end_with_parent
from tracking.errors import InputError

_PATIENCE = 5.0  # s, after which a process that does not end by itself is killed
_Seeds = int | Sequence[int | None] | None


class TeamVectorEnv(VectorEnv[Observation, NDArray[np.floating[Any]], NDArray[Any]]):
    """Environments `TeamEnv` with the same arguments; `gymnasium.make_vec("understory/Forest-v0", 16)` makes them.

    Each process steps its share of the environments one after another, as Gymnasium's `SyncVectorEnv` does, and writes
    observations into arrays that it shares with this process. Seeds give the episodes that they give to single
    environments. As elsewhere in Gymnasium, an environment whose episode is over is reset in the next step, which
    ignores its action; other modes are Gymnasium's, too.
    """

    closed = True  # until all processes have been started

    def __init__(
        self,
        num_envs: int = 1,
        *,
        processes: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        context: str | None = None,
        **kwargs: Any,  # noqa: ANN401 - of `TeamEnv`
    ) -> None:
        """Start the processes, which build an environment each time it is reset.

        Args:
            num_envs: Number of environments.
            processes: Number of processes; by default one for each core, and no more than environments.
            autoreset_mode: When an environment is reset whose episode is over.
            copy: False for observations in the shared arrays themselves, which the next step changes.
            context: Method of `multiprocessing` to start processes; by default the platform's.
            **kwargs: Arguments of each environment, as `gymnasium.make` takes them.
        """
        for name, value in (("num_envs", num_envs), ("processes", processes)):
            if value is not None and (not isinstance(value, int | np.integer) or value < 1):
                raise InputError(f"{name}: {value!r} is not allowed; expected a whole number of at least 1")
        mode = AutoresetMode(autoreset_mode)
        one = TeamEnv(**kwargs)
        self.num_envs = int(num_envs)
        self.metadata = {**one.metadata, "autoreset_mode": mode}
        self.render_mode = one.render_mode
        self.single_observation_space, self.single_action_space = one.observation_space, one.action_space
        self.observation_space = batch_space(one.observation_space, self.num_envs)
        self.action_space = batch_space(one.action_space, self.num_envs)
        made = multiprocessing.get_context(context)
        memory = create_shared_memory(one.observation_space, self.num_envs, made)  # type: ignore[arg-type]
        self._observations: Any = read_from_shared_memory(one.observation_space, memory, self.num_envs)
        self._copy = copy
        count = min(processes or count_cores(), self.num_envs)
        ends = [self.num_envs * k // count for k in range(count + 1)]
        self._shares = [slice(*pair) for pair in pairwise(ends)]  # environments of each process
        self._workers: list[_Worker] = []
        self.closed = False
        make = CloudpickleWrapper(partial(TeamEnv, **kwargs))
        try:
            for share in self._shares:
                self._workers.append(_Worker(made, _Work(make, share, mode, memory, self.num_envs)))
        except BaseException:
            self.close(terminate=True)
            raise

    def reset(
        self, *, seed: _Seeds = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in each environment; `options` are those of `TeamEnv.reset`.

        With `options["reset_mask"]` (n,) of bool only those environments begin anew. Seeds are a list, or the first of
        consecutive ones.
        """
        if seed is None or isinstance(seed, int | np.integer):
            seeds: list[int | None] = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        if len(seeds) != self.num_envs:
            raise InputError(
                f"seed: {len(seeds)} seeds are given; expected one for each of {self.num_envs} environments"
            )
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(f"options: reset_mask {mask.tolist()} is not allowed; expected {self.num_envs} flags")
        orders: dict[int, tuple[str, dict[str, Any]]] = {
            k: ("reset", {"seed": seeds[share], "options": {**given, "reset_mask": mask[share]}})
            for k, share in enumerate(self._shares)
            if mask[share].any()
        }
        answers = self._order(orders)
        infos = _join_infos([answers.get(k, {}) for k in range(len(self._shares))], self._shares)
        return self._take_observations(), infos

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Fly each environment to its next decision by actions (n, UAVs, 2)."""
        if np.shape(actions) != self.action_space.shape:
            raise error.InvalidAction(f"actions: of shape {np.shape(actions)}, not {self.action_space.shape}")
        rows = np.asarray(actions)
        answers = self._order({k: ("step", {"actions": rows[share]}) for k, share in enumerate(self._shares)})
        rewards, terminations, truncations, infos = zip(*answers.values(), strict=True)
        ended = np.concatenate(terminations), np.concatenate(truncations)
        return self._take_observations(), np.concatenate(rewards), *ended, _join_infos(infos, self._shares)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:  # noqa: ANN401 - of any method
        """Results of a method, or values of an attribute, of each environment, such as `envs.call("flight")`."""
        answers = self._order(
            dict.fromkeys(range(len(self._shares)), ("call", {"name": name, "given": (args, kwargs)}))
        )
        return tuple(result for results in answers.values() for result in results)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Values of an attribute of each environment."""
        return self.call(name)

    def render(self) -> tuple[Any, ...]:
        """A frame of each environment, as of `TeamEnv.render`."""
        return self.call("render")

    def close_extras(self, *, terminate: bool = False) -> None:
        """End the processes; one that does not end in a few seconds, or with `terminate` all of them, are killed."""
        for worker in self._workers:
            worker.begin_to_end(kill=terminate)
        for worker in self._workers:
            worker.end()

    def __del__(self) -> None:
        self.close(terminate=True)

    def _take_observations(self) -> Observation:
        found: Observation = deepcopy(self._observations) if self._copy else self._observations
        return found

    def _order(self, orders: Mapping[int, tuple[str, dict[str, Any]]]) -> dict[int, Any]:
        """Let processes do what is ordered, and return their answers; raise the first error in an environment.

        Without an answer from each process nothing can go on, so then all of them are ended.
        """
        if self.closed:
            raise error.ClosedEnvironmentError("the vector environment is closed")
        try:
            for k, order in orders.items():
                self._workers[k].send(order)
            answers = {k: self._workers[k].receive() for k in orders}
        except BaseException:
            self.close(terminate=True)
            raise
        for answer in answers.values():
            if isinstance(answer, _Failure):
                raise answer.error from RuntimeError(f"in a process of the vector environment:\n{answer.trace}")
        return answers


class _Failure:
    """An error in an environment, on its way to the parent process; as text if it cannot be sent."""

    def __init__(self, raised: Exception) -> None:
        self.trace = traceback.format_exc()
        self.error = raised
        try:
            pickle.loads(pickle.dumps(raised))
        except Exception:
            self.error = RuntimeError(repr(raised))


class _Work(NamedTuple):
    """What a process does."""

    make: Callable[[], TeamEnv]
    share: slice  # of the environments
    mode: AutoresetMode
    memory: Any  # of the observations of all environments
    total: int  # of all environments


class _Worker:
    """A process that steps a share of the environments, as its parent process has it."""

    def __init__(self, context: BaseContext, work: _Work) -> None:
        self._share = work.share
        self._pipe, other = context.Pipe()
        process: Any = context
        self._process: BaseProcess = process.Process(target=_work, args=(work, other), daemon=True)
        self._process.start()
        other.close()

    def send(self, order: tuple[str, dict[str, Any]]) -> None:
        """Send an order. If the process is dead, `receive` tells."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self._pipe.send(order)

    def receive(self) -> Any:  # noqa: ANN401 - as many types as orders
        """The answer to the last order; `error.Error` if the process has died."""
        try:
            return self._pipe.recv()
        except (EOFError, ConnectionResetError):
            self._process.join(_PATIENCE)
            first, last = self._share.start, self._share.stop - 1
            how = describe_exit(self._process.exitcode or 0)
            raise error.Error(f"the process of environments {first} to {last} {how}; all are closed") from None

    def begin_to_end(self, *, kill: bool) -> None:
        """Let the process end after its present order, or kill it."""
        if kill:
            self._process.kill()
        else:
            self.send(("close", {}))

    def end(self) -> None:
        """Wait for the end of the process."""
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()
        self._pipe.close()


def _work(work: _Work, pipe: Connection) -> None:
    """Step a share of the environments as ordered."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent process
    end_with_parent()
    count = work.share.stop - work.share.start
    envs = SyncVectorEnv([work.make] * count, copy=False, autoreset_mode=work.mode)
    shared = read_from_shared_memory(envs.single_observation_space, work.memory, work.total)
    gc.freeze()  # what is there now stays, and need not be searched for garbage again and again
    while True:
        name, given = pipe.recv()
        if name == "close":
            envs.close()
            return
        try:
            pipe.send(_obey(envs, name, given, shared, work.share))
        except Exception as raised:
            pipe.send(_Failure(raised))


def _obey(envs: SyncVectorEnv[Any, Any], name: str, given: dict[str, Any], shared: Any, share: slice) -> Any:  # noqa: ANN401
    if name == "call":
        args, kwargs = given["given"]
        return envs.call(given["name"], *args, **kwargs)
    observed, *answer = envs.reset(**given) if name == "reset" else envs.step(**given)
    for array, new in zip(_list_arrays(shared), _list_arrays(observed), strict=True):
        array[share] = new
    return answer[0] if name == "reset" else answer


def _list_arrays(observations: Any) -> list[NDArray[Any]]:  # noqa: ANN401 - a dict of arrays or an array
    return [observations[name] for name in sorted(observations)] if isinstance(observations, dict) else [observations]


def _join_infos(infos: Sequence[Mapping[str, Any]], shares: Sequence[slice]) -> dict[str, Any]:
    """Infos of all environments from those of the shares; what one has none of is zero, or None, as in Gymnasium."""
    joined: dict[str, Any] = {}
    for name in {name: None for info in infos for name in info}:
        parts = [info.get(name) for info in infos]
        some = next(part for part in parts if part is not None)
        if isinstance(some, dict):
            joined[name] = _join_infos([part or {} for part in parts], shares)
            continue
        joined[name] = np.zeros((shares[-1].stop, *some.shape[1:]), some.dtype)
        if some.dtype == object:
            joined[name][:] = None
        for part, share in zip(parts, shares, strict=True):
            if part is not None:
                joined[name][share] = part
    return joined
