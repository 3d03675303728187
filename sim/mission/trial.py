"""A mission to fly and its progress, as values that can be sent to other processes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from sim.scenario.scenario import Scenario
from tracking.errors import InputError


@dataclass(frozen=True)
class Trial:
    """Everything that determines a mission."""

    scenario: Scenario
    planner: str  # in the form that `planning.planner_loading.load_planner` takes
    seed: int
    repeat: int = 0  # decides, with the seed, the randomness of sensors, network, wind and planner
    place: str = ""  # beginning of errors about the scenario, from `place_of`


@contextmanager
def prefix_errors(place: str, *passing: type[InputError]) -> Iterator[None]:
    """Prefix InputErrors raised in the block with a place, such as `Trial.place`, except those of types `passing`."""
    try:
        yield
    except passing:
        raise
    except InputError as error:
        raise InputError(f"{place}{error}") from error


class ScanProgress(NamedTuple):
    """Progress at one scan."""

    time: float  # s
    distances: list[float]  # OSPA [m] of each UAV that works


class Compilation(NamedTuple):
    """Progress of compiling: numbers of functions."""

    done: int
    total: int


Moment = Compilation | ScanProgress
Progress = Callable[[Moment], None]
Say = Callable[[str], None]
