"""A planner of your own: every UAV flies to the nearest track that no neighbour is nearer to.

Prints how it does on one map, beside hovering and the default planner.
"""

import numpy as np

import understory


class Sharing:
    """Every UAV takes the nearest of the tracks that are nearer to it than to its neighbours."""

    decentralised = True  # a claim that check_planner tests

    def plan(self, team, rng):
        """A plan for each situation: velocities (1, 2) in m/s, east and north."""
        return [understory.Plan(self.towards_nearest(situation)[None]) for situation in team]

    def towards_nearest(self, situation):
        own = situation.own
        fleet = np.array([vehicle.position[:2] for vehicle in (own, *situation.neighbours)])
        gaps = np.array([track.belief.mean[:2] - fleet for track in situation.tracks]).reshape(-1, len(fleet), 2)
        distances = np.sqrt(np.square(gaps).sum(axis=2))
        mine = gaps[distances.argmin(axis=1) == 0, 0]
        gap = min(mine, key=np.linalg.norm, default=np.zeros(2)) / situation.step
        return gap * min(1.0, own.max_speed / max(np.linalg.norm(gap), 1e-9))


if __name__ == "__main__":
    for finding in understory.check_planner(Sharing):
        assert finding.passed is not False, finding
    for planner in (Sharing(), "hover", "sma-nbo-gospa"):
        print(understory.run("forest", planner, seed=2, settings={"duration": 30, "sensing.mode": "ideal"}))
