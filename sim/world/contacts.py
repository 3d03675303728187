"""What UAVs touch."""

from __future__ import annotations

from typing import NamedTuple

KINDS = ("uav", "canopy", "trunk", "person", "ground")


class Contact(NamedTuple):
    """A UAV and what it touched: the other one's kind, one of `KINDS`, and its index among them."""

    uav: int
    kind: str
    other: int
