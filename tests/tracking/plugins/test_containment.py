"""Errors of plug-ins have the line of the plug-in that they come from."""

import functools

import numpy as np
import pytest

from tracking.plugins import containment
from tracking.plugins.containment import ForeignError, Unusable, contained, numbers


def logged(method):
    @functools.wraps(method)
    def call(self):
        return method(self)

    return call


class Part:
    """A plug-in with a method of each kind, all of which give None."""

    attribute = None

    def method(self):
        pass

    @staticmethod
    def unbound():
        pass

    @property
    def read(self):
        pass

    @logged
    def wrapped(self):
        pass


def made(needed):
    """A plug-in's maker."""


@pytest.mark.parametrize(("maker", "text"), [(Part, "Part: class Part:"), (made, "made: def made(needed):")])
def test_a_maker_that_cannot_be_called_has_its_own_line(maker, text):
    with pytest.raises(ForeignError) as told, contained(called=(maker, "__init__")):
        raise Unusable("no")
    (line,) = told.value.trace
    assert line.startswith(f"{__file__}:") and line.endswith(f", in {text}")


@pytest.mark.parametrize(
    ("method", "text"),
    [
        ("method", "Part.method: def method(self):"),
        ("unbound", "Part.unbound: @staticmethod"),
        ("read", "Part.read: @property"),
        ("wrapped", "Part.wrapped: @logged"),
        ("attribute", "Part: class Part:"),
        ("absent", "Part: class Part:"),
    ],
)
def test_a_wrong_result_has_the_line_that_defines_the_method(monkeypatch, method, text):
    monkeypatch.setattr(containment, "_places", lambda error: ())  # as if the error were of a file of ours
    for wrong in (TypeError, Unusable):
        with pytest.raises(ForeignError) as told, contained(called=(Part(), method)):
            raise wrong("no")
        (line,) = told.value.trace
        assert line.startswith(f"{__file__}:") and line.endswith(f", in {text}")
        assert told.value.explained.startswith(f"no ({__file__}:")


class Tensor:
    """An array of another library, whose `size` is a method."""

    def __init__(self, *values):
        self.values = values

    def size(self):
        return (len(self.values),)

    def __len__(self):
        return len(self.values)

    def __getitem__(self, k):
        return self.values[k]

    def __array__(self, dtype=None, copy=None):
        return np.array(self.values, dtype=dtype)


def test_arrays_of_another_library_are_taken_alone_and_in_lists():
    for given in (Tensor(1.0, 2.0), [Tensor(1.0, 2.0), Tensor(3.0, 4.0)], [[1.0, 2.0], Tensor(3.0, 4.0)]):
        found = numbers("controls", given, 4)
        assert found.dtype == float and found.ravel().tolist() == [1.0, 2.0, 3.0, 4.0][: found.size]
    for given in (Tensor(*range(5)), [Tensor(*range(5))]):
        with pytest.raises(Unusable, match="controls are more than 4 numbers"):
            numbers("controls", given, 4)
