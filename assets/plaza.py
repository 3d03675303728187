"""Source of `trajectories/plaza.csv`: run `python -m assets.plaza` after a change here.

Fourteen pedestrians cross a plaza by the social force model: each accelerates towards the next place, is repelled by
the others, and drawn to the companions of a group. Groups walk together, some people stop for a while, some turn back,
and all come and go at the rim, each at a time of their own. Source of the model: D. Helbing and P. Molnar, Social force
model for pedestrian dynamics, Physical Review E, 1995.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SEED = 20
DURATION = 60.0  # s
STEP = 0.05  # s
EVERY = 10  # steps between two rows
RELAXATION = 0.6  # s, to reach the wanted velocity
REPULSION = 2.2  # m/s²
RANGE = 0.5  # m
BODY = 0.6  # m between two axes
COHESION = 0.9  # 1/s² of the gap to a group's centre
TOGETHER = 1.6  # m, gap without cohesion
NEAR = 1.5  # m, from a place that counts as reached
FASTEST = 2.6  # m/s


@dataclass
class Person:
    """One pedestrian: places to go to, and pauses [s] at them."""

    group: int
    places: list[tuple[float, float]]
    pauses: list[float]
    speed: float  # m/s
    enters: float  # s


# Groups, each: members, time of entry [s], speed [m/s], and places with pauses.
GROUPS = (
    (3, 0.0, 1.25, [(-44, -16, 0), (-6, -10, 0), (8, 6, 9), (46, 20, 0)]),
    (2, 0.0, 1.45, [(-20, 30, 0), (-8, 6, 0), (22, -8, 0), (48, -26, 0)]),
    (2, 6.0, 1.15, [(44, 2, 0), (10, 2, 7), (-12, 12, 0), (-46, 14, 0)]),
    (1, 0.0, 1.7, [(-30, 2, 0), (4, -2, 0), (18, 16, 0), (-4, 24, 0), (-34, 26, 0)]),
    (1, 0.0, 2.0, [(-12, -28, 0), (-4, 8, 0), (30, 28, 0)]),
    (1, 0.0, 1.4, [(20, -30, 0), (14, 4, 12), (20, -32, 0)]),
    (1, 9.0, 1.55, [(-46, 4, 0), (-14, 0, 5), (2, -20, 0), (36, -30, 0)]),
    (1, 12.0, 1.9, [(46, 24, 0), (12, 10, 0), (-24, -8, 0), (-46, -26, 0)]),
    (2, 20.0, 1.3, [(0, 34, 0), (4, 10, 6), (-18, -4, 0), (-22, -34, 0)]),
)


def people(rng: np.random.Generator) -> list[Person]:
    """All pedestrians, members of a group a little apart from one another."""
    found = []
    for group, (size, enters, speed, stations) in enumerate(GROUPS):
        for _ in range(size):
            offset = rng.normal(0.0, 0.9, 2)
            places = [(x + offset[0] + rng.normal(0, 0.4), y + offset[1] + rng.normal(0, 0.4)) for x, y, _ in stations]
            found.append(Person(group, places, [pause for _, _, pause in stations], speed, enters))
    return found


def rows(rng: np.random.Generator) -> list[tuple[float, int, float, float]]:
    """Time [s], person and place [m] of all rows of the file."""
    persons = people(rng)
    positions = np.array([p.places[0] for p in persons])
    velocities = np.zeros_like(positions)
    waits = np.zeros(len(persons))
    goals = np.ones(len(persons), dtype=int)
    there = np.zeros(len(persons), dtype=bool)
    found = []
    for k in range(int(DURATION / STEP) + 1):
        time = k * STEP
        for i, person in enumerate(persons):
            there[i] = time >= person.enters and goals[i] < len(person.places)
        if k % EVERY == 0:
            found += [(time, i, *positions[i].tolist()) for i in np.flatnonzero(there).tolist()]
        wanted = np.array([_wanted(p, x, g, w) for p, x, g, w in zip(persons, positions, goals, waits, strict=True)])
        force = (
            (wanted - velocities) / RELAXATION
            + _social(persons, positions, there)
            + rng.normal(0, 0.5, (len(persons), 2))
        )
        velocities[there] += STEP * force[there]
        speed = np.maximum(np.hypot(*velocities.T), 1e-9)
        velocities *= np.minimum(1.0, FASTEST / speed)[:, None]
        positions[there] += STEP * velocities[there]
        waits -= STEP
        for i in np.flatnonzero(there).tolist():
            place = persons[i].places[goals[i]]
            if np.hypot(*(positions[i] - place)) < NEAR:
                waits[i] = persons[i].pauses[goals[i]]
                goals[i] += 1
    return found


def _wanted(person: Person, position: Array, goal: int, wait: float) -> Array:
    """Velocity that a person wants, m/s."""
    if wait > 0 or goal >= len(person.places):
        return np.zeros(2)
    ahead = np.asarray(person.places[goal]) - position
    return np.asarray(person.speed * ahead / max(float(np.hypot(*ahead)), 1e-9))


def _social(persons: list[Person], positions: Array, there: NDArray[np.bool_]) -> Array:
    """Repulsion of all others, and cohesion of groups (M, 2) m/s²."""
    force = np.zeros_like(positions)
    for i in np.flatnonzero(there).tolist():
        for j in np.flatnonzero(there).tolist():
            away = positions[i] - positions[j]
            gap = max(float(np.hypot(*away)), 1e-6)
            if i != j and gap < 4.0:
                force[i] += REPULSION * np.exp((BODY - gap) / RANGE) * away / gap
        mates = [j for j, p in enumerate(persons) if p.group == persons[i].group and there[j]]
        to_centre = positions[mates].mean(axis=0) - positions[i]
        gap = float(np.hypot(*to_centre))
        if gap > TOGETHER:
            force[i] += COHESION * (gap - TOGETHER) * to_centre / gap
    return force


def main() -> None:
    """Write the file."""
    lines = [f"{time:g},{person},{x:.2f},{y:.2f}" for time, person, x, y in rows(np.random.default_rng(SEED))]
    path = Path(__file__).parent / "trajectories" / "plaza.csv"
    path.write_text("\n".join(["t,id,x,y", *lines]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
