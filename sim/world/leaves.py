"""Leaves of porous crowns: clusters at random places and in random directions, which an image shows one by one."""

import math
from dataclasses import dataclass

import numpy as np

from sim.scenario.random_streams import stream
from tracking.geometry.leaf_gaps import CLUSTER
from tracking.geometry.visibility import Solid
from tracking.numerics.arrays import Array
from tracking.numerics.poisson import draw_poisson
from tracking.numerics.trigonometry import cos_each, sin_each

_MOST = 20_000.0  # clusters of a crown, which the engine takes; in a crown that would have more, they are larger


@dataclass(frozen=True)
class Leaves:
    """The leaves of one porous solid of a map, which the map's seed decides."""

    seed: int
    index: int  # of the solid among those of the map, canopies first
    solid: Solid

    @property
    def volume(self) -> float:
        """Volume of the solid [m³]."""
        s = self.solid
        return math.pi * s.radius * s.radius * (s.top - s.bottom)

    @property
    def edge(self) -> float:
        """Edge of a cluster [m]."""
        return max(CLUSTER, math.sqrt(self.solid.leaf_area_density * self.volume / _MOST))

    @property
    def reach(self) -> float:
        """Largest distance [m] from the centre of a cluster, which is inside the crown, to its corners."""
        return self.edge * math.sqrt(0.5)

    def draw(self) -> Array:
        """Corners (N, 4, 3) m of all clusters about the foot of the crown's axis; N is Poisson.

        Centres are uniform in the crown, and directions on the sphere. So a ray through s m of the crown is free with
        probability exp(-s density / 2), because a square shows half its area from a random direction in the mean.
        """
        rng = stream(self.seed, "leaves", self.index)
        solid = self.solid
        count = draw_poisson(rng, solid.leaf_area_density * self.volume / (self.edge * self.edge))
        share = rng.random(count)
        height = rng.random(count)
        up = rng.uniform(-1.0, 1.0, count)
        turns = rng.uniform(-math.pi, math.pi, (3, count))
        (c, cos_tilt, cos_spin), (s, sin_tilt, sin_spin) = cos_each(turns), sin_each(turns)
        radius = solid.radius * np.sqrt(share)
        level = np.sqrt(1.0 - up * up)
        centres = np.column_stack([radius * c, radius * s, (solid.top - solid.bottom) * height])
        # Two axes across the direction (level cos_tilt, level sin_tilt, up), turned by the spin about it.
        one = np.column_stack([-sin_tilt, cos_tilt, np.zeros(count)])
        two = np.column_stack([-up * cos_tilt, -up * sin_tilt, level])
        a = (one * cos_spin[:, None] + two * sin_spin[:, None]) * (self.edge / 2)
        b = (two * cos_spin[:, None] - one * sin_spin[:, None]) * (self.edge / 2)
        return np.asarray(np.stack([centres + a + b, centres - a + b, centres - a - b, centres + a - b], axis=1))
