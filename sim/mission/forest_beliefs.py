"""What each UAV believes of the forest at a time: the only place that trackers, detectors, planners and search ask."""

from collections.abc import Sequence
from typing import Protocol

from sim.mission.radio import RadioLinks
from sim.mission.scan_relay import ScanRelay
from sim.scenario.scenario import Scenario
from sim.world.believed_forest import believe_forest
from tracking.detection.detector import Frame
from tracking.geometry.visibility import Forest
from tracking.numerics.arrays import Indices
from tracking.plugins.plugin_error import PluginError


class ForestBeliefs(Protocol):
    """What each UAV of a mission believes of the forest.

    At each scan the mission shows it the frames of all cameras, and then takes from it what each UAV believes. That
    travels with the UAV's `Shot`, and from there with its `Frame` to the detector and with its `Scan` to the tracker.
    The `Situation` for the planner and the map of undetected people take it from the scan, and so does the recorder:
    `Recording.believed_at` is what explanations ask.

    What changes has to be a new `Forest`; nobody writes into one. Trees with errors have a `Forest.deviation` each,
    and `tracking.geometry.unseen_ground.expect_unseen_trees` turns ground that is not yet seen into `Forest.unknown`.
    """

    def observe(self, time: float, frames: Sequence[Frame]) -> Sequence[tuple[int, PluginError]]:
        """Learn from the frames of the scan at a time [s]; return errors of plug-ins, each with its UAV.

        frames: none without images.
        """

    def share(self, time: float, links: RadioLinks, working: Sequence[int], relay: ScanRelay) -> Indices | None:
        """Exchange maps over the links of a scan; return the bytes (n,) that each UAV sends, None if none are shared.

        relay: has the transmitters that maps share with scans.
        """

    def believed(self, uav: int) -> Forest:
        """The forest as a UAV believes it now."""


class GivenMap:
    """The map that all UAVs are given at the start, with the errors of `scenario.believed`."""

    def __init__(self, forest: Forest) -> None:
        self._forest = forest

    def observe(self, time: float, frames: Sequence[Frame]) -> Sequence[tuple[int, PluginError]]:
        """Nothing: the map stays."""
        return ()

    def share(self, time: float, links: RadioLinks, working: Sequence[int], relay: ScanRelay) -> Indices | None:
        """Nothing: all have it."""
        return None

    def believed(self, uav: int) -> Forest:
        """The map."""
        return self._forest


def make_forest_beliefs(scenario: Scenario, forest: Forest, seed: int) -> ForestBeliefs:
    """The beliefs of a mission with true trees `forest`, which UAVs that map trees themselves do not get."""
    if scenario.mapping.forest == "mapped":
        from sim.mission.mapped_forests import MappedForests  # whose code other missions need not load

        return MappedForests(scenario)
    return GivenMap(believe_forest(forest, scenario, seed))
