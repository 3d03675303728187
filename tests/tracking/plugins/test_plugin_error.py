"""Errors of plug-ins have the line of the plug-in that they come from."""

import functools

import numpy as np
import pytest

from tracking.errors import one_line
from tracking.plugins import plugin_error
from tracking.plugins.plugin_error import PluginError, Unusable, plugin_call
from tracking.plugins.result_check import COVARIANCES, read_numbers


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


@pytest.mark.parametrize(
    ("plugin", "method", "text"),
    [
        (Part, "__init__", "Part: class Part:"),
        (made, "__init__", "made: def made(needed):"),
        (Part(), "method", "Part.method: def method(self):"),
        (Part(), "unbound", "Part.unbound: @staticmethod"),
        (Part(), "read", "Part.read: @property"),
        (Part(), "wrapped", "Part.wrapped: @logged"),
        (Part(), "attribute", "Part: class Part:"),
        (Part(), "absent", "Part: class Part:"),
    ],
)
def test_a_wrong_result_has_the_line_that_defines_the_method(monkeypatch, plugin, method, text):
    monkeypatch.setattr(plugin_error, "_find_own_lines", lambda error: ())  # as if the error were of a file of ours
    with pytest.raises(PluginError) as told, plugin_call(plugin, method):
        raise Unusable("no")
    (line,) = told.value.trace
    assert line.startswith(f"{__file__}:") and line.endswith(f", in {text}")
    assert str(told.value) == "no" and told.value.with_place.startswith(f"no ({__file__}:")


def test_an_exception_has_its_class_its_text_and_the_lines_of_the_plug_ins_file():
    def mean():
        return np.mean(["a"])

    with pytest.raises(PluginError) as told, plugin_call():
        mean()
    *_, last = told.value.trace
    assert last.startswith(f"{__file__}:") and last.endswith('in mean: return np.mean(["a"])')
    assert str(told.value).split(":")[0].endswith("TypeError")


def test_a_value_error_of_the_plug_in_has_its_class_and_one_of_ours_only_its_text(monkeypatch):
    with pytest.raises(PluginError, match=r"^ValueError: no$"), plugin_call():
        raise ValueError("no")
    monkeypatch.setattr(plugin_error, "_find_own_lines", lambda error: ())  # as if the errors were of a file of ours
    with pytest.raises(PluginError, match=r"^no$"), plugin_call():
        raise ValueError("no")
    with pytest.raises(PluginError, match=r"^TypeError: no$"), plugin_call():
        raise TypeError("no")


def test_a_text_becomes_one_line_of_printable_characters():
    assert one_line(ValueError("two\n\x1b[31mlines\u202e ")) == "two [31mlines"
    assert one_line(KeyError()) == "KeyError"
    assert one_line("from" + 500 * "x" + "to", 20) == "fromxxx ... xxxxxto"


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
        found = read_numbers("controls", given)
        assert found.dtype == float and found.ravel().tolist() == [1.0, 2.0, 3.0, 4.0][: found.size]


@pytest.mark.parametrize("given", [["1", "2"], [1j], [[1, 2], [3]], {1: 2}, [10**400]])
def test_what_is_no_number_is_refused(given):
    with pytest.raises(Unusable, match=r"^controls are not numbers$"):
        read_numbers("controls", given)


@pytest.mark.parametrize("wrong", [np.diag([1.0, 1.0, 1.0, -1e-9]), np.eye(4) + 0.1 * np.eye(4, k=1), 1e13 * np.eye(4)])
def test_each_of_several_covariances_has_to_be_symmetric_and_definite(wrong):
    good = np.tile(np.eye(4), (3, 1, 1))
    np.testing.assert_array_equal(COVARIANCES.check("covariances", good, 3), good)
    for k in range(3):
        one = good.copy()
        one[k] = wrong
        with pytest.raises(Unusable, match="covariances are not symmetric and positive definite, from 1e-12 to 1e12"):
            COVARIANCES.check("covariances", one, 3)
