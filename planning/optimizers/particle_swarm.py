"""Particle swarm optimisation."""

import math
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from planning.objective.terms import Objective
from planning.planner import limit_speed
from planning.prediction.targets_in_reach import TargetsInReach
from tracking.numerics.arrays import Array


@dataclass(frozen=True)
class ParticleSwarm:
    """Particle swarm of [Li22]'s public code: 20 particles per step of the horizon, drawn to their own and common best.

    Up to half of the particles begin at the best starts, and the others at random plans.
    """

    evaluations: int = 0  # of the objective, besides the starts; the last move is of the whole swarm; 0: 51 moves
    particles_per_step: int = 20
    own: float = 0.5  # c1
    swarm: float = 0.3  # c2
    inertia: float = 0.9  # w
    seconds: float = 0.0  # time after which the search stops; 0: no limit

    def minimise(
        self,
        objective: Objective,
        starts: Array,
        max_speeds: Array,
        rng: np.random.Generator,
        in_reach: TargetsInReach | None = None,
    ) -> Array:
        """As `Optimizer.minimise`."""
        began = perf_counter()
        shape = (self.particles_per_step * starts.shape[2], *starts.shape[1:])
        particles = limit_speed(rng.uniform(-1.0, 1.0, shape) * max_speeds[:, None, None], max_speeds)
        starts = limit_speed(starts, max_speeds)
        firsts = objective(starts)
        order = np.argsort(firsts, kind="stable")[: len(particles) // 2]
        particles[: len(order)] = starts[order]
        velocities = rng.uniform(-1.0, 1.0, shape) * max_speeds[:, None, None]
        best, values = particles.copy(), objective(particles)
        moves = math.ceil(self.evaluations / len(particles)) or 52
        for _ in range(moves - 1):
            if self.seconds and perf_counter() - began > self.seconds:
                break
            leader = best[np.argmin(values)]
            toward_own, toward_swarm = rng.random((2, *shape))
            velocities *= self.inertia
            velocities += self.own * toward_own * (best - particles) + self.swarm * toward_swarm * (leader - particles)
            particles = limit_speed(particles + velocities, max_speeds)
            costs = objective(particles)
            better = costs < values
            best[better], values[better] = particles[better], costs[better]
        return np.asarray(best[np.argmin(values)])
