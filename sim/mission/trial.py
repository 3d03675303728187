"""A mission to fly and its progress, as values that can be sent to any process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from sim.scenario.scenario import Scenario
from tracking.plugins.registry import InputError


@dataclass(frozen=True)
class Trial:
    """Everything that determines a mission."""

    scenario: Scenario
    planner: str  # as `planning.loading.load_planner` takes it
    seed: int
    repeat: int = 0  # of sensors, network, wind and planner on the map of the seed
    place: str = ""  # of the scenario, with which errors about its world begin: as from `place_of`


@contextmanager
def naming(place: str, *passing: type[InputError]) -> Iterator[None]:
    """InputErrors that are raised in the block begin with a place, such as `Trial.place`, but for those `passing`."""
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


Progress = Callable[[ScanProgress], None]
Say = Callable[[str], None]
