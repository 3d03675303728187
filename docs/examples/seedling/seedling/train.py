"""Training by evolution strategies: `python -m seedling.train --workers 16 --out weights.npz`.

Each generation tries weights about the present ones, in pairs on either side of them, all on the same maps. The
present weights then move towards those that lost fewer people. The same arguments give the same bytes, whatever the
number of workers, unless `--seconds` ends the training.
Source: evolution strategies with mirrored sampling and ranks, T. Salimans et al., arXiv:1703.03864, 2017.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import understory
from seedling.planner import Seedling
from seedling.weights import SIZE, hand_set, load, packed, unpacked
from sim.evaluation.score import FAR
from tracking.metrics.gospa import gospa
from tracking.numerics.arrays import Array
from tracking.track import beliefs_of

TRAINED, VALIDATED = 100_000, 200_000  # first seeds of maps for training and for validation; reports use lower ones
FOREST = "forest"  # flown in each generation; of the others each takes its turn
OTHERS = ("scatter", "search", "crowd", "dense", "patchwork", "recorded", "paper")
_FAST = {"sensing.mode": "ideal", "dynamics": "kinematic"}
_MOMENTUM = 0.8


class Flight(NamedTuple):
    """A mission to fly with some weights."""

    weights: Array
    scenario: str
    seed: int
    duration: float  # s


@dataclass(frozen=True)
class Training:
    """Settings of a training."""

    generations: int = 50
    population: int = 40  # weights tried in a generation, an even number
    missions: int = 4  # that each of them flies
    duration: float = 40.0  # s, of a mission
    sigma: float = 0.12  # standard deviation of what is tried
    rate: float = 0.8  # of learning
    seed: int = 0
    every: int = 10  # generations between two validations; 0: none

    def __post_init__(self) -> None:
        if self.population < 2 or self.population % 2:
            raise ValueError(f"population must be even and at least 2, is {self.population}")
        if not (self.generations >= 1 and self.missions >= 1 and self.duration > 0 and self.sigma > 0):
            raise ValueError("generations and missions must be at least 1, duration and sigma above 0")

    def maps(self, generation: int) -> list[tuple[str, int]]:
        """Scenarios and seeds of a generation: others by turns, and the forest, each on new maps."""
        turn, first = generation * (self.missions - 1), TRAINED + generation * self.missions
        # The forest, whose missions take the shortest time, is last, so that no process waits long for the others.
        names = [*(OTHERS[(turn + k) % len(OTHERS)] for k in range(self.missions - 1)), FOREST]
        return [(name, first + k) for k, name in enumerate(names)]


def cost(flight: Flight) -> float:
    """Root of a mission's mean GOSPA [m]: else worlds in which nobody can hold all people would outweigh the others."""
    planner = Seedling()
    planner.weights = unpacked(flight.weights)
    settings = {**_FAST, "duration": flight.duration}
    distances: list[float] = []
    with understory.mission(flight.scenario, planner, seed=flight.seed, settings=settings) as mission:
        for snapshot in mission.fly():
            people = snapshot.people[~np.isnan(snapshot.people[:, 0])]
            for uav in snapshot.working:
                means, _ = beliefs_of(snapshot.tracks[uav])
                distances.append(gospa(means[:, :2], people, FAR).distance)
    return math.sqrt(sum(distances) / len(distances))


Map = Callable[[Callable[[Flight], float], Iterable[Flight]], Iterable[float]]


def costs(settings: Training, fly: Map, tried: Sequence[Array], maps: Sequence[tuple[str, int]]) -> Array:
    """Mean cost of each of some weights over maps."""
    flights = [Flight(weights, *where, settings.duration) for where in maps for weights in tried]
    return np.asarray(np.reshape(list(fly(cost, flights)), (len(maps), len(tried))).mean(axis=0))


def validation(settings: Training, fly: Map, weights: Array) -> float:
    """Mean cost on two maps of each scenario that no generation flies."""
    maps = [(name, VALIDATED + 2 * k + j) for k, name in enumerate((*OTHERS, FOREST)) for j in (0, 1)]
    return float(costs(settings, fly, [weights], maps)[0])


def utilities(found: Array) -> Array:
    """Weights (N,) of what was tried, by rank, the highest for the least cost; absolute values add up to one."""
    ranks = np.empty(len(found))
    ranks[np.argsort(found, kind="stable")] = np.arange(len(found))
    centred = (len(found) - 1) / 2 - ranks
    return np.asarray(centred / np.abs(centred).sum())


def train(settings: Training, fly: Map, start: Array, say: Callable[[dict[str, float], Array], None]) -> Array:
    """Trained weights (SIZE,); after each generation `say` is told of it, with the weights so far.

    `say` ends the training by raising StopIteration.
    """
    rng, weights, step = np.random.default_rng(settings.seed), start.copy(), np.zeros(SIZE)
    for generation in range(settings.generations):
        half = rng.standard_normal((settings.population // 2, SIZE))
        noise = np.concatenate([half, -half])
        found = costs(settings, fly, list(weights + settings.sigma * noise), settings.maps(generation))
        uphill = (utilities(found)[:, None] * noise).sum(axis=0)
        step = _MOMENTUM * step + (1.0 - _MOMENTUM) * uphill
        weights = weights + settings.rate * settings.sigma * step
        told = {"generation": generation + 1, "cost": found.mean(), "least": found.min()}
        if settings.every and (generation % settings.every == 0 or generation + 1 == settings.generations):
            told["validation"] = validation(settings, fly, weights)
        try:
            say(told, weights)
        except StopIteration:
            break
    return weights


def save(weights: Array, path: Path) -> None:
    """Write weights as .npz, without a moment at which the file is not whole."""
    partial = path.with_name(f".{path.name}")
    with partial.open("wb") as file:
        np.savez(file, allow_pickle=False, **unpacked(weights)._asdict())
    partial.replace(path)


class _Log:
    """Writes a line for each generation, and the weights so far."""

    columns = ("generation", "seconds", "cost", "least", "validation")

    def __init__(self, out: Path, seconds: float) -> None:
        self.out, self.seconds, self.began = out, seconds, time.perf_counter()
        self.file = out.with_suffix(".csv")
        self.file.write_text(",".join(self.columns) + "\n")

    def __call__(self, told: dict[str, float], weights: Array) -> None:
        now = time.perf_counter() - self.began
        row = {**told, "seconds": now}
        line = ",".join(f"{row[name]:.6g}" if name in row else "" for name in self.columns)
        with self.file.open("a") as file:
            file.write(line + "\n")
        print(line, flush=True)
        save(weights, self.out)
        if now + now / max(told["generation"], 1) > self.seconds:
            raise StopIteration


def main(arguments: Sequence[str] | None = None) -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m seedling.train", description=__doc__.partition("\n")[0])
    for name, default in vars(Training()).items():
        parser.add_argument(f"--{name}", type=type(default), default=default)
    parser.add_argument("--workers", type=int, default=1, help="processes that fly missions")
    parser.add_argument("--seconds", type=float, default=math.inf, help="wall time after which no generation begins")
    parser.add_argument("--start", type=Path, help="weights to begin with instead of hand-set ones")
    parser.add_argument("--out", type=Path, default=Path("weights.npz"), help="weights; the log has the suffix .csv")
    given = parser.parse_args(arguments)
    settings = Training(**{name: getattr(given, name) for name in vars(Training())})
    start = packed(load(given.start)) if given.start else hand_set(settings.seed)
    flown = {name for generation in range(settings.generations) for name, _ in settings.maps(generation)}
    for name in sorted({*flown, *OTHERS} if settings.every else flown):
        cost(Flight(start, name, TRAINED, 2.0))  # compiles, so that the workers need not
    log = _Log(given.out, given.seconds)
    if given.workers == 1:
        train(settings, map, start, log)
        return
    with get_context("spawn").Pool(given.workers) as pool:
        train(settings, _in(pool), start, log)


def _in(pool: Any) -> Map:  # noqa: ANN401 - of multiprocessing, whose classes depend on the context
    """Map over the processes of a pool, one flight at a time."""
    return lambda function, flights: pool.map(function, flights, chunksize=1)


if __name__ == "__main__":
    main()
