"""Times of decisions, side by side and as teams and scenes grow; docs/results/benchmarks.md says how to run this.

What is compared takes turns, so that the load of the machine falls on all of it; of several CPU times the least counts.
In ordinary test runs each runs once, on little, and its times are not judged.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.timing import least

from planning.planner_loading import load_planner
from tracking.geometry.visibility import Forest
from tracking.undetected import Intensity

BOUND = 1.15  # exponent of the time of a decision, by UAVs or by targets
EVALUATIONS = 12_288  # of every planner, for each plan or joint plan that it looks for
# s, a whole trial of 40 decisions or more, R = 5, lambda = 75: [Li22], table of runtimes, by horizon.
PAPER = {
    "sma-nbo": (574, 1307, 1914),
    "sma-nbo-mwtp": (604, 1319, 1924),
    "mcr": (1662, 3822, 6291),
    "dec-pomdp": (None, 1789, 2551),
}
NAMES = ("sma-nbo", "sma-nbo-mwtp", "pma-nbo", "mcr", "dec-pomdp", "centralized")
FAST = ("thompson", "random")  # which search nothing
MCR = "mcr(samples=4, beta=0.5, evaluations=9216)"
COMPOSED = ("sma-nbo-mwtp", "sma-nbo-gospa", "greedy-mi", "rsp", "dec-mcts")
LONGER = "mcr(samples=10, horizon=5)"  # which has more time than the others in docs/results/worlds.md
RIVALS = (*(f"{name}(horizon=5)" for name in COMPOSED), MCR, *FAST, LONGER)


def deciding(planner, team):
    return lambda: planner.plan(team, np.random.default_rng(0))


def decisions(names, teams, rounds):
    """Mean over teams of the least time [ms] of a decision of each planner."""
    planners = [load_planner(name) for name in names]
    for planner in planners:
        planner.plan(teams[0], np.random.default_rng(0))
    times = [least(*(deciding(planner, team) for planner in planners), rounds=rounds) for team in teams]
    return 1e3 * np.mean(times, axis=0)


def test_decisions(random_team, judged):
    """Three UAVs, four targets, five steps, 75 trees."""
    teams = [random_team(seed, trees=75) for seed in range(6 if judged else 1)]
    options = "" if judged else "(evaluations=64)"
    names = [name + options for name in ("sma-nbo-gospa", "sma-nbo-mwtp", "sma-nbo", "mcr")]
    default, mwtp, nbo, mcr = decisions(names, teams, 10 if judged else 1)
    print(f"\nsma-nbo-gospa {default:.1f} ms, sma-nbo-mwtp {mwtp:.1f} ms, sma-nbo {nbo:.1f} ms, ", end="")
    print(f"mcr {mcr:.1f} ms: {mcr / nbo:.1f} x sma-nbo")
    assert not judged or (default < 25.0 and mwtp < 30.0 and mcr < 10.0 * nbo)


def test_decisions_with_people_to_find(random_team, judged):
    """The default planner in the same scenes, without undetected people and with four spread over the whole area."""
    people = Intensity(np.full((20, 30), 4.0 / 600), (-75.0, -50.0), (5.0, 5.0))
    known = [random_team(seed, trees=75) for seed in range(6 if judged else 1)]
    searching = [[replace(situation, undetected=people) for situation in team] for team in known]
    planner = load_planner("sma-nbo-gospa" if judged else "sma-nbo-gospa(evaluations=64)")
    planner.plan(searching[0], np.random.default_rng(0))
    pairs = zip(known, searching, strict=True)
    times = [least(*(deciding(planner, team) for team in pair), rounds=10 if judged else 1) for pair in pairs]
    without, searched = 1e3 * np.mean(times, axis=0)
    print(f"\nwithout {without:.1f} ms, with {searched:.1f} ms: {searched / without:.2f} x")
    assert not judged or searched < 1.4 * without


@pytest.mark.parametrize(("option", "bound"), [("cost_to_go=0.03", 1.3), ("connectivity=100", 1.15)])
@pytest.mark.parametrize(("uavs", "targets"), [(3, 4), (5, 15), (10, 30)])
def test_decisions_with_an_option(random_team, judged, uavs, targets, option, bound):
    """Ratio to the default planner without it, in small and large teams whose radios reach 40 m."""
    options = "" if judged else ", evaluations=64"
    names = [f"sma-nbo-gospa(connectivity=0{options})", f"sma-nbo-gospa({option}{options})"]
    if "connectivity" not in option:
        names[1] = names[1].replace("(", "(connectivity=0, ")
    drawn = [random_team(seed, uavs=uavs, targets=targets, trees=75, spread=40.0) for seed in range(3 if judged else 1)]
    teams = [[replace(situation, radio_range=40.0) for situation in team] for team in drawn]
    without, with_one = decisions(names, teams, 8 if judged else 1)
    print(f"\n{without:.1f} ms, with {option} {with_one:.1f} ms: {with_one / without:.2f} x", end="")
    assert not judged or with_one < bound * without


def test_decisions_of_rivals(random_team, judged):
    """Three UAVs, four targets, 75 trees: only the last planner takes much longer than the first, `sma-nbo-mwtp`."""
    teams = [random_team(seed, trees=75) for seed in range(6 if judged else 1)]
    few = [name.replace(", evaluations=9216)", ")").replace(")", ", evaluations=64)") for name in RIVALS]
    times = decisions(RIVALS if judged else few, teams, 10 if judged else 1)
    print("\n" + ", ".join(f"{name} {ms:.1f} ms" for name, ms in zip(RIVALS, times, strict=True)))
    assert not judged or (times[:-1].max() < 1.25 * times[0] and times[-1] < 2.0 * times[0])


@pytest.mark.parametrize(("what", "counts"), [("uavs", (3, 6, 10, 20)), ("targets", (4, 10, 25, 50))])
def test_decisions_as_teams_and_scenes_grow(random_team, judged, what, counts):
    """UAVs from 3, among 10 targets; targets from 4, with 3 UAVs. The exponent is that of a power law."""
    counts = counts if judged else (2, 3)
    planner = load_planner("sma-nbo-mwtp" if judged else "sma-nbo-mwtp(evaluations=64)")
    teams = [random_team(0, **({"targets": 10} | {what: n}), trees=75, spread=40.0) for n in counts]
    times = 1e3 * least(*(deciding(planner, team) for team in teams), rounds=10 if judged else 1)
    exponent = np.polyfit(np.log(counts), np.log(times), 1)[0]
    print(f"\n{what} {counts}: {np.round(times, 1).tolist()} ms, exponent {exponent:.2f}, bound {BOUND}")
    assert not judged or exponent <= BOUND


@pytest.mark.parametrize(("people", "bound"), [(0.0, 1.3), (1.0, 1.4)])
def test_decisions_in_large_fleets(random_team, judged, people, bound):
    """A fleet of six with 20 targets among 75 trees, alone and as one of ten such fleets side by side.

    `people` to find are expected for each UAV.
    """
    tiles = [(260.0 * k, 173.0 * row) for row in range(2) for k in range(5)] if judged else [(0.0, 0.0), (260.0, 0.0)]
    fleets = [side_by_side(random_team, some, people)[:6] for some in (tiles[:1], tiles)]
    planner = load_planner("sma-nbo-gospa" if judged else "sma-nbo-gospa(evaluations=64)")
    planner.plan(fleets[1], np.random.default_rng(0))
    few, many = 1e3 / 6 * least(*(deciding(planner, team) for team in fleets), rounds=10 if judged else 1)
    print(f"\nof 6 UAVs {few:.1f} ms, of {6 * len(tiles)} {many:.1f} ms: {many / few:.2f} x")
    assert not judged or many < bound * few


def side_by_side(random_team, tiles, people):
    """The team of the middle fleet and of copies of it at other places (T, 2) m; forests and tracks are copied, too."""
    tile = random_team(0, uavs=6, targets=20, trees=75, spread=60.0)
    moves = [np.array([x - tiles[len(tiles) // 2][0], y - tiles[len(tiles) // 2][1]]) for x, y in tiles]
    moves.sort(key=lambda move: tuple(np.abs(move)))
    vehicles, tracks, trees = [], [], []
    for k, move in enumerate(moves):
        here = np.array([*move, 0.0])
        vehicles += [replace(s.own, id=6 * k + s.own.id, position=s.own.position + here) for s in tile]
        for t in tile[0].tracks:
            mean = t.belief.mean + np.array([*move, 0.0, 0.0])
            tracks.append(replace(t, id=20 * k + t.id, belief=replace(t.belief, mean=mean)))
        trees += [replace(tree, x=tree.x + move[0], y=tree.y + move[1]) for tree in tile[0].forest.trees]
    low, high = np.min(moves, axis=0) - (130.0, 86.5), np.max(moves, axis=0) + np.array([130.0, 86.5])
    shape = tuple(np.ceil((high - low)[::-1] / 5.0).astype(int))
    raster = Intensity(np.full(shape, people * len(vehicles) / np.prod(shape)), tuple(low), (5.0, 5.0))
    forest = Forest(tuple(trees))
    return [
        replace(
            tile[0],
            own=v,
            neighbours=tuple(w for w in vehicles if w is not v),
            tracks=tuple(tracks),
            forest=forest,
            undetected=raster,
        )
        for v in vehicles
    ]


@pytest.mark.parametrize("horizon", [1, 3, 5])
def test_runtimes_beside_the_papers(random_team, judged, horizon):
    """The paper's runtime table; its times are of whole trials, so ratios to its SMA-NBO are what compares."""
    teams = [random_team(seed, trees=75) for seed in range(3 if judged else 1)]
    options = f"horizon={horizon}, evaluations={EVALUATIONS if judged else 64}"
    names = [*(f"{name}({options})" for name in NAMES), f"sma-nbo-mwtp(optimizer=particle-swarm, {options})"]
    times = decisions(names, teams, 3 if judged else 1)
    column = (1, 3, 5).index(horizon)
    for name, ms in zip([*NAMES, "sma-nbo-mwtp(optimizer=particle-swarm)"], times, strict=True):
        theirs = PAPER.get(name, (None,) * 3)[column]
        ratio = f"{theirs / PAPER['sma-nbo'][column]:.1f}" if theirs else "-"
        print(f"H = {horizon} {name:40} {ms:8.1f} ms, {ms / times[0]:5.1f}, paper {ratio}")
        assert np.isfinite(ms)
