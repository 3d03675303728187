"""Teams with other vehicles or intents, and their plans."""

import dataclasses

import numpy as np

from planning.planner import Plan
from planning.planner_loading import load_planner
from planning.prediction.response import Response

LITTLE = {"mcr": "(samples=5, evaluations=64)", "dec-mcts": "(evaluations=20, rounds=2, sequences=2, samples=1)"}
LITTLE |= dict.fromkeys(["lawnmower", "greedy", "random", "hover", "thompson"], "")  # no effort to limit


class Spy:
    """A planner that keeps the teams it is given; each UAV flies what `ways` gives for its situation, or hovers."""

    def __init__(self, ways=lambda situation: np.zeros((1, 2))):
        self.teams, self.ways = [], ways

    def plan(self, team, rng):
        self.teams.append(team)
        return [Plan(np.array(self.ways(situation))) for situation in team]


def at_once(count):
    """Response of `count` hovering UAVs that follow commands at once, [Li22] eq. (5)."""
    return Response(np.zeros((count, 2)), np.zeros(count), np.zeros(count))


def with_little_effort(name):
    """The text of a planner of ours that tries few plans."""
    return name + LITTLE.get(name, "(evaluations=64)")


def planned(planner, team, seed=0):
    """Controls (n, H, 2) m/s of the team's plans by a planner, or by the one of a name."""
    planner = load_planner(planner) if isinstance(planner, str) else planner
    return np.array([plan.controls for plan in planner.plan(team, np.random.default_rng(seed))])


def refitted(team, change):
    """The team with every vehicle changed, as each UAV knows it."""
    return [dataclasses.replace(s, own=change(s.own), neighbours=tuple(map(change, s.neighbours))) for s in team]


def knowing(team, plans):
    """The team after plans of which these are the rest."""
    intents = {s.own.id: Plan(np.vstack([np.zeros((1, 2)), p])) for s, p in zip(team, plans, strict=True)}
    return [dataclasses.replace(s, intents=intents) for s in team]


def among(situation, uavs):
    """The situation of the first of UAVs `uavs`, by ascending id, if there were no others."""
    own, *neighbours = (situation.vehicles[i] for i in uavs)
    return dataclasses.replace(situation, own=own, neighbours=tuple(neighbours))
