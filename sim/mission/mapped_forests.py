"""Maps of the forest that UAVs make themselves, and share."""

import math
from collections.abc import Sequence

import numpy as np

from sim.mission.map_exchange import DatedMap, MapExchange
from sim.mission.radio import RadioLinks
from sim.mission.scan_relay import ScanRelay
from sim.scenario.believed import MAPPERS
from sim.scenario.scenario import Scenario
from sim.sensing.mapper_output_check import read_map
from tracking.detection.detector import Frame
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.unseen_ground import expect_unseen_trees
from tracking.geometry.visibility import Forest, Tree
from tracking.mapping.fusion import TreeMap, fuse_maps
from tracking.mapping.mapper import COVERED, OPEN, SeenGround, TreeMapper
from tracking.numerics.arrays import Indices
from tracking.plugins.plugin_error import PluginError, plugin_call

_PAUSE = 1.0  # s, from one map to the next
_CELL = 2.0  # m, edge of the cells of ground of which UAVs know whether they have seen them
_USUAL = Tree(0.0, 0.0, canopy_radius=4.0)  # the size of unknown trees while no tree has been mapped


class MappedForests:
    """Maps that UAVs make while they fly, each from the frames of its own camera. No true tree is known to them.

    Once a second each makes its map anew of what it saw, and sends it, if maps are shared. It believes this map fused
    with those that it has received. Trees have the deviations of the mapper; where no UAV that it heard of has looked
    yet, there may be trees of the mean size of those that are mapped.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._area = scenario.area.width, scenario.area.height
        self._occlusion = scenario.sensing.occlusion
        self._mappers: list[TreeMapper] = [MAPPERS.make(scenario.mapping.mapper) for _ in scenario.uavs]
        self._maps = MapExchange(scenario.network, len(scenario.uavs))
        self._shares = scenario.mapping.share
        self._made = 0.0  # s, time of the last maps
        self._due: list[int] = []  # UAVs that have to send their maps
        with MAPPERS.errors(scenario.mapping.mapper, "be asked before the first frame"):
            for uav in range(len(scenario.uavs)):
                self._make_map(uav, 0.0)
        self._forests = [self._believe(uav) for uav in range(len(scenario.uavs))]

    def observe(self, time: float, frames: Sequence[Frame]) -> Sequence[tuple[int, PluginError]]:
        """Map the trees in the frames of one scan; where a mapper fails, its UAV keeps the last map of its own."""
        errors = []
        for frame in frames:
            mapper = self._mappers[frame.uav]
            try:
                with plugin_call(mapper, "add"):
                    mapper.add(frame)
            except PluginError as error:
                errors.append((frame.uav, error))
        if time > self._made + 0.999 * _PAUSE:
            self._made, self._due = time, list(range(len(self._mappers)))
            for uav in self._due:
                try:
                    self._make_map(uav, time)
                except PluginError as error:
                    errors.append((uav, error))
                self._forests[uav] = self._believe(uav)
        return errors

    def share(self, time: float, links: RadioLinks, working: Sequence[int], relay: ScanRelay) -> Indices | None:
        """Send the maps that were made in this scan, and take in those that have arrived.

        A UAV believes these when it makes its next map.
        """
        if not self._shares:
            return None
        due, self._due = [i for i in self._due if i in working], []
        return self._maps.step(time, due, links, working, relay)

    def believed(self, uav: int) -> Forest:
        """The map of a UAV."""
        return self._forests[uav]

    def _make_map(self, uav: int, time: float) -> None:
        trees, ground = read_map(self._mappers[uav])
        self._maps.publish(uav, DatedMap(time, TreeMap(trees, _lay_over(self._area, ground))))

    def _believe(self, uav: int) -> Forest:
        fused = fuse_maps([dated.map for dated in self._maps.maps(uav).values()])
        mapped = fused.trees
        trees = tuple(found.tree for found in mapped)
        deviations = tuple(math.sqrt(0.5 * float(np.trace(found.covariance[:2, :2]))) for found in mapped)
        sizes = np.array([(tree.canopy_radius, tree.canopy_base, tree.canopy_top) for tree in trees])
        usual = Tree(0.0, 0.0, *sizes.mean(axis=0).tolist()) if trees else _USUAL
        unseen = expect_unseen_trees(fused.ground, usual.canopy_radius)
        return Forest(trees, self._occlusion, deviations or 0.0, unseen, usual)


def _lay_over(area: tuple[float, float], ground: SeenGround) -> Raster:
    """Ground as of `find_gap_fraction`, in cells over an area of width and height [m]."""
    width, height = area
    raster = Raster.over(area, np.full((math.ceil(height / _CELL), math.ceil(width / _CELL)), math.nan))
    places = [
        low + side * (0.5 + np.arange(n))
        for low, side, n in zip(raster.low, raster.cell, raster.values.T.shape, strict=True)
    ]
    rows, columns = (
        np.floor((at - low) / ground.cell).astype(np.int64)
        for at, low in zip(places[::-1], ground.corner[::-1], strict=True)
    )
    inside_rows, inside_columns = (
        (0 <= at) & (at < n) for at, n in zip((rows, columns), ground.states.shape, strict=True)
    )
    states = ground.states[np.ix_(rows[inside_rows], columns[inside_columns])]
    values = np.where(states == OPEN, 1.0, np.where(states == COVERED, 0.0, math.nan))
    raster.values[np.ix_(inside_rows, inside_columns)] = values
    return raster
