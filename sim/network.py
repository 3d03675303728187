"""The radio network of a fleet: who hears whom at an instant, which messages are lost, and how far beliefs differ."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from tracking.compiled import Array
from tracking.ospa import ospa
from tracking.tracker import Track

Index = Annotated[int, Meta(ge=0)]
Link = tuple[Index, Index]
Bools = NDArray[np.bool_]


class Cut(Struct, frozen=True, forbid_unknown_fields=True):
    """Links that are down for a while."""

    links: Annotated[tuple[Link, ...], Meta(min_length=1)]
    start: Annotated[float, Meta(ge=0)] = 0.0  # s
    end: float | None = None  # s, when they are up again; None: never

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise ValueError(f"end {self.end:g} must be after start {self.start:g}")


class Network(Struct, frozen=True, forbid_unknown_fields=True):
    """Who talks to whom, how often per scan, and what comes of it."""

    rounds: Annotated[int, Meta(ge=0)] = 5
    range: Annotated[float, Meta(gt=0)] = 1000.0  # m
    fusion: Literal["kla", "hcmci"] = "kla"
    loss: Annotated[float, Meta(ge=0, le=1)] = 0.0  # probability per message, that is per round and direction
    links: tuple[Link, ...] = ()  # the only ones there are; empty: all
    cuts: tuple[Cut, ...] = ()

    def check(self, uavs: int) -> None:
        """ValueError if links are not between two UAVs of a fleet of so many, each named once."""
        _check_links("network.links", self.links, uavs)
        known = {tuple(sorted(link)) for link in self.links}
        for i, cut in enumerate(self.cuts):
            where = f"network.cuts.{i}.links"
            _check_links(where, cut.links, uavs)
            for link in cut.links:
                if known and tuple(sorted(link)) not in known:
                    allowed = ", ".join(str(list(pair)) for pair in self.links)
                    raise ValueError(f"{where}: {list(link)} is not in network.links; allowed are {allowed}")

    def linked(self, time: float, positions: Array) -> Bools:
        """Who hears whom (n, n) of UAVs at positions (n, 3) m: those within range whose link exists and is not cut."""
        gap = np.linalg.norm(positions[:, None] - positions[None], axis=2)
        heard = np.asarray((gap <= self.range) & ~np.eye(len(gap), dtype=np.bool_))
        if self.links:
            heard &= _adjacency(self.links, len(gap))
        for cut in self.cuts:
            if cut.start <= time and (cut.end is None or time < cut.end):
                heard &= ~_adjacency(cut.links, len(gap))
        return heard

    def lost(self, uavs: int, rng: np.random.Generator) -> Bools | None:
        """Which messages of one scan are lost (L, n, n), per round, hearer and speaker; None: nothing ever is.

        The same chance is used whatever the probability, so what is lost at a lower one is lost at a higher one too.
        """
        if self.loss == 0.0:
            return None
        return rng.random((self.rounds, uavs, uavs)) < self.loss


def disagreement(held: Sequence[Sequence[Track]]) -> float:
    """How far the tracks of UAVs differ: OSPA distance [m] between the positions held by two, mean over the pairs.

    `held` is what each UAV holds; of fewer than two, none disagrees.
    """
    places = [np.array([track.belief.mean[:2] for track in tracks]) for tracks in held]
    gaps = [ospa(one, other).distance for one, other in combinations(places, 2)]
    return float(np.mean(gaps)) if gaps else 0.0


def _check_links(where: str, links: Sequence[Link], uavs: int) -> None:
    seen: set[tuple[int, ...]] = set()
    for link in links:
        pair = tuple(sorted(link))
        if pair[1] >= uavs:
            raise ValueError(f"{where}: {list(link)} names UAV {pair[1]}; allowed are 0 to {uavs - 1}")
        if pair[0] == pair[1]:
            raise ValueError(f"{where}: {list(link)} links UAV {pair[0]} to itself; allowed are pairs of two UAVs")
        if pair in seen:
            raise ValueError(f"{where}: {list(link)} is there twice; allowed is each pair once")
        seen.add(pair)


def _adjacency(links: Sequence[Link], uavs: int) -> Bools:
    table = np.zeros((uavs, uavs), dtype=np.bool_)
    ends = np.array(links)
    table[ends[:, 0], ends[:, 1]] = table[ends[:, 1], ends[:, 0]] = True
    return table
