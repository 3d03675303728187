"""Contacts of UAVs with other bodies."""

from typing import NamedTuple

KINDS = ("uav", "canopy", "trunk", "person", "ground")
_NAMES = {"uav": "UAV", "canopy": "the canopy of tree", "trunk": "the trunk of tree", "person": "person"}


class Contact(NamedTuple):
    """Contact of a UAV with another body, given by its kind, one of `KINDS`, and its index among its kind."""

    uav: int
    kind: str
    other: int


def describe_body(kind: str, other: int) -> str:
    """Description of the body that a UAV touched; arguments as in `Contact`."""
    return "the ground" if kind == "ground" else f"{_NAMES[kind]} {other}"
