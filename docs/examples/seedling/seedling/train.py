"""Training by imitation: `python -m seedling.train --rounds 3 --missions 40 --workers 1 --out weights.npz`.

Missions are flown by a mixture of an expert and the policy learned so far, and at each decision the expert says what
it would do. The policy is fitted to that, on the decisions of all rounds, and the next round is flown with more of its
own decisions, so that it learns what to do where it comes to by itself. The same arguments give the same weights on
one machine, whatever the number of workers.
Source: dataset aggregation (DAgger), [Ross11].
"""

import argparse
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import understory
from seedling.fitting import Example, example, fitted, loss
from seedling.planner import Seedling, choices
from seedling.weights import Weights, drawn, save
from understory import Exchange, Plan, Planner, Situation, beliefs_of, gospa, load_planner

TRAINED, VALIDATED = 100_000, 200_000  # first seeds of maps for training and for validation; reports use lower ones
WORLDS = ("forest", "scatter", "forest", "search", "forest", "crowd", "forest", "dense")
_FAST = {"sensing.mode": "ideal", "dynamics": "kinematic"}
_HELD_OUT = 8  # of so many missions one is not fitted to


class Lesson(NamedTuple):
    """A mission to fly with the policy, and with an expert to learn from unless it is empty."""

    weights: Weights
    expert: str
    share: float  # of decisions that the expert flies
    scenario: str
    seed: int
    duration: float  # s


class Learned(NamedTuple):
    """Decisions of a mission as examples, and its mean GOSPA [m]."""

    examples: list[Example]
    gospa: float


@dataclass(frozen=True)
class Training:
    """Settings of a training."""

    rounds: int = 3
    missions: int = 40  # of a round
    duration: float = 40.0  # s, of a mission
    expert: str = "sma-nbo-gospa"
    epochs: int = 40  # of a fit
    rate: float = 0.01  # of learning
    validations: int = 6  # maps on which each round's policy flies alone
    seed: int = 0

    def __post_init__(self) -> None:
        if not (self.rounds >= 1 and self.missions >= 2 and self.duration > 0 and self.epochs >= 1):
            raise ValueError("rounds and epochs must be at least 1, missions at least 2, duration above 0")

    def lessons(self, turn: int, weights: Weights) -> list[Lesson]:
        """Missions of a round, the first of which the expert flies alone; each has a map of its own."""
        first, share = TRAINED + 10_000 * self.seed + turn * self.missions, 0.4**turn if turn else 1.0
        return [
            Lesson(weights, self.expert, share, WORLDS[k % len(WORLDS)], first + k, self.duration)
            for k in range(self.missions)
        ]


class Tutored:
    """Flies by the expert at some decisions and by the policy at the others, and keeps what the expert would do."""

    def __init__(self, lesson: Lesson) -> None:
        self.policy, self.share = Seedling(lesson.weights), lesson.share
        self.expert: Planner = load_planner(lesson.expert)
        self.exchange: Exchange = getattr(self.expert, "exchange", Exchange())
        self.examples: list[Example] = []

    def plan(self, team: Sequence[Situation], rng: np.random.Generator) -> list[Plan]:
        """Plans of the expert or of the policy, by chance."""
        plans, decided = self.expert.plan(team, rng), dict[int, Plan]()
        for situation, plan in zip(team, plans, strict=True):
            own, step = situation.own, situation.step
            moves = choices(situation, decided)
            self.examples.append(example(moves, step * plan.controls[0], step * own.max_speed))
            decided[own.id] = plan
        return plans if rng.random() < self.share else self.policy.plan(team, rng)


def fly(lesson: Lesson) -> Learned:
    """Fly a mission and learn from it; RuntimeError with its fault if the expert decided nothing."""
    planner = Tutored(lesson) if lesson.expert else Seedling(lesson.weights)
    settings = {**_FAST, "duration": lesson.duration}
    distances: list[float] = []
    with understory.mission(lesson.scenario, planner, seed=lesson.seed, settings=settings) as mission:
        for snapshot in mission.fly():
            people = snapshot.people[~np.isnan(snapshot.people[:, 0])]
            for uav in snapshot.working:
                means, _ = beliefs_of(snapshot.tracks[uav])
                distances.append(gospa(means[:, :2], people).distance)
    examples = planner.examples if isinstance(planner, Tutored) else []
    if lesson.expert and not examples:
        raise RuntimeError(f"expert {lesson.expert!r}: {mission.faults[0].message}")
    return Learned(examples, sum(distances) / len(distances))


Map = Callable[[Callable[[Lesson], Learned], Iterable[Lesson]], Iterable[Learned]]


def train(settings: Training, each: Map, say: Callable[[dict[str, float], Weights], None]) -> Weights:
    """Trained weights; `say` is told of each round, with the weights so far."""
    with threadpool_limits(1, user_api="blas"):  # sums of several threads differ in the last bit, and choices with them
        return _trained(settings, each, say)


def _trained(settings: Training, each: Map, say: Callable[[dict[str, float], Weights], None]) -> Weights:
    weights, fitting, held_out = drawn(settings.seed), list[Example](), list[Example]()
    for turn in range(settings.rounds):
        for k, learned in enumerate(each(fly, settings.lessons(turn, weights))):
            (held_out if k % _HELD_OUT == 1 else fitting).extend(learned.examples)
        before = loss(weights, held_out)
        weights = fitted(weights, fitting, settings.epochs, settings.rate, settings.seed + turn)
        maps = range(VALIDATED, VALIDATED + settings.validations)
        alone = [Lesson(weights, "", 0.0, "forest", seed, settings.duration) for seed in maps]
        told = {
            "round": turn + 1,
            "decisions": len(fitting),
            "loss": loss(weights, fitting),
            "held_out_before": before,
            "held_out": loss(weights, held_out),
            "gospa": float(np.mean([flown.gospa for flown in each(fly, alone)])) if alone else np.nan,
        }
        say(told, weights)
    return weights


class _Log:
    """Writes a line for each round, and the weights so far."""

    def __init__(self, out: Path) -> None:
        self.out, self.began = out, time.perf_counter()
        self.file = out.with_suffix(".csv")
        self.file.unlink(missing_ok=True)

    def __call__(self, told: dict[str, float], weights: Weights) -> None:
        row = {**told, "seconds": time.perf_counter() - self.began}
        with self.file.open("a", encoding="utf-8") as file:
            if told["round"] == 1:
                file.write(",".join(row) + "\n")
            file.write(",".join(f"{value:.6g}" for value in row.values()) + "\n")
        print(", ".join(f"{name} {value:.4g}" for name, value in row.items()), flush=True)
        save(weights, self.out)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(
        prog="python -m seedling.train",
        description=__doc__.partition("\n")[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for name, default in vars(Training()).items():
        parser.add_argument(f"--{name}", type=type(default), default=default)
    parser.add_argument("--workers", type=int, default=1, help="processes that fly missions")
    parser.add_argument("--out", type=Path, default=Path("weights.npz"), help="weights; the log has the suffix .csv")
    given = parser.parse_args(arguments)
    try:
        settings = Training(**{name: getattr(given, name) for name in vars(Training())})
        load_planner(settings.expert)
    except ValueError as error:
        parser.error(str(error))
    if not given.out.parent.is_dir():
        parser.error(f"--out: there is no folder {given.out.parent}")
    if given.workers == 1:
        train(settings, map, _Log(given.out))
        return
    with get_context("spawn").Pool(given.workers) as pool:
        train(settings, _in(pool), _Log(given.out))


def _in(pool: Any) -> Map:  # noqa: ANN401 - of multiprocessing, whose classes depend on the context
    """Map over the processes of a pool, one flight at a time."""
    return lambda function, lessons: pool.map(function, lessons, chunksize=1)


if __name__ == "__main__":
    main()
