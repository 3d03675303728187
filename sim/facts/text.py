"""Words about a mission, before anything draws or prints them."""

from typing import NamedTuple


class TextGroup(NamedTuple):
    """A heading, and sentences under it."""

    heading: str
    sentences: list[str]
