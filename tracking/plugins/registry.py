"""Registry of plug-ins of one kind, built-in ones by name and others by import string; the error of wrong input."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.importing import imported
from tracking.plugins.spelling import did_you_mean


class InputError(ValueError):
    """The input cannot be used; the message is one line: field, value, what is allowed, the nearest valid name."""


@dataclass(frozen=True)
class Registry:
    """Plug-ins of one kind; `InputError` begins with `field`, the setting that names one of them."""

    field: str
    built_in: Mapping[str, str]  # import strings by name; they and their arguments may differ from those of outside
    methods: tuple[str, ...]  # that each has, with arguments: "detect(frame)"
    bare: bool = False  # plug-ins from outside are made without arguments

    def __iter__(self) -> Iterator[str]:
        """Names of the built-in plug-ins."""
        return iter(self.built_in)

    def check(self, name: str) -> None:
        """InputError unless a plug-in is built in or may be an import string, "package.module:Class"."""
        if name not in self.built_in and ":" not in name:
            known = did_you_mean(name, self.built_in)
            raise InputError(f"{self.field}: {name!r} is unknown; {known} (or package.module:Class)")

    def find(self, name: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
        """The class of that name or import string; InputError says what is wrong."""
        self.check(name)
        try:
            return imported(self.built_in.get(name, name))
        except ImportError as error:
            raise InputError(f"{self.field}: {name!r} cannot be imported: {error}") from error

    def make(self, name: str, *arguments: object) -> Any:  # noqa: ANN401 - whatever a user's class makes
        """The plug-in of that name or import string; InputError says what is wrong."""
        make = self.find(name)
        with self.errors(name, "be made"):
            made = make() if self.bare and name not in self.built_in else make(*arguments)
            missing = [m for m in self.methods if not callable(getattr(made, m.partition("(")[0], None))]
        if missing:
            raise InputError(f"{self.field}: {name!r} has no method {missing[0]}")
        return made

    @contextmanager
    def errors(self, name: str, what: str) -> Iterator[None]:
        """Raises a InputError, "FIELD: NAME cannot WHAT: why", for whatever a plug-in raises in the block."""
        try:
            with contained():
                yield
        except ForeignError as error:
            raise InputError(f"{self.field}: {name!r} cannot {what}: {error.explained}") from error
