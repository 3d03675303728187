"""Checks of planners' options by the annotations of their dataclasses: words to choose from, and ranges of numbers."""

from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from tracking.errors import nearest


class Range(NamedTuple):
    """Allowed values of a number, as in `Annotated[int, Range(1, 100)]`."""

    least: float
    most: float
    above: bool = False  # True: the least value itself is not allowed

    def __str__(self) -> str:
        return f"above {self.least:g}, to {self.most:g}" if self.above else f"from {self.least:g} to {self.most:g}"

    def has(self, value: float) -> bool:
        """True if a value is allowed."""
        return self.least < value <= self.most if self.above else self.least <= value <= self.most


def check_options(planner: object) -> None:
    """Raise ValueError if an option, a field of the planner, is not as its annotation allows."""
    for name, kind in get_type_hints(type(planner), include_extras=True).items():
        value = getattr(planner, name)
        arguments = get_args(kind)
        if len(arguments) > 1 and isinstance(arguments[1], Range):
            _check_number(name, value, *arguments)
        # Words that an annotation allows are those of `Literal`, alone or as a part of a union.
        words = [word for part in (kind, *arguments) if get_origin(part) is Literal for word in get_args(part)]
        if isinstance(value, str) and words and value not in words:
            allowed = ", ".join(map(repr, words))
            raise ValueError(f"{name} {value!r} is unknown; allowed are {allowed}{nearest(value, words)}")


def _check_number(name: str, value: Any, number: type, bounds: Range) -> None:  # noqa: ANN401 - a user's option
    kinds = (int,) if number is int else (int, float)
    if type(value) not in kinds or not bounds.has(value):
        raise ValueError(f"{name} must be a {'whole ' * (number is int)}number {bounds}, is {value!r}")
