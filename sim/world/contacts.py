"""Contacts of UAVs with other bodies."""

from typing import NamedTuple

KINDS = ("uav", "canopy", "trunk", "person", "ground")


class Contact(NamedTuple):
    """Contact of a UAV: the kind of the other body, one of `KINDS`, and its index in that kind."""

    uav: int
    kind: str
    other: int
