"""Settings of the radio network of a fleet, checked against the fleet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta, Struct

DAY = 86_400.0  # s, longer than any mission
Index = Annotated[int, Meta(ge=0)]
Link = tuple[Index, Index]


class Cut(Struct, frozen=True, forbid_unknown_fields=True):
    """Links that are down for a while."""

    links: Annotated[tuple[Link, ...], Meta(min_length=1)]  # links that are down: pairs of UAVs
    start: Annotated[float, Meta(ge=0, le=DAY)] = 0.0  # s, from then on they are down
    end: Annotated[float, Meta(le=DAY)] | None = None  # s, when they are up again; for good without it

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise ValueError(f"end {self.end:g} must be after start {self.start:g}")


class Network(Struct, frozen=True, forbid_unknown_fields=True):
    """Radio network: links, rounds of consensus per scan, fusion rule and losses."""

    rounds: Annotated[int, Meta(ge=0, le=1000)] = 5  # rounds of consensus per scan
    # m, distance beyond which no message arrives, whatever the links
    range: Annotated[float, Meta(gt=0, le=1e6)] = 1000.0
    # `"kla"`: weighted average of information, as in the paper; `"hcmci"`: hybrid consensus on measurements and
    # information; `"module:Class"`: yours ([how](../how-to/plugins.md#a-motion-model-a-fusion-rule))
    fusion: str = "kla"
    # probability that a message is lost, per round and direction, drawn by seed and repeat
    loss: Annotated[float, Meta(ge=0, le=1)] = 0.0
    links: tuple[Link, ...] = ()  # the only links there are, as pairs of UAVs: `[[0, 1], [1, 2]]`; without any, all
    # links that are down for a while: `[{links = [[0, 2], [1, 2]], start = 10, end = 20}]`
    cuts: Annotated[tuple[Cut, ...], Meta(max_length=1000)] = ()
    # s, from a decision until the first control of its plan is flown; until then UAVs go on as before, and hover at the
    # start; a multiple of the time between scans
    plan_delay: Annotated[float, Meta(ge=0, le=DAY)] = 0.0

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
