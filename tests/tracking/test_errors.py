"""Words of messages."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.errors import list_numbers, one_line, spell


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (999.7, 3, "1000"),
        (-1234567.0, 2, "-1234567"),
        (0.1 + 0.2, 12, "0.3"),
        (3, 2, "3"),
        (0.0, 3, "0"),
    ],
)
def test_numbers_are_those_of_people(value, digits, text):
    assert spell(value, digits) == text


@settings(deadline=None)
@given(st.floats(1e-4, 1e15, exclude_max=True), st.integers(1, 12))
def test_ordinary_numbers_have_no_exponent_and_are_right_to_their_digits(value, digits):
    text = spell(value, digits)
    assert "e" not in text
    assert abs(float(text) - value) <= max(0.5 * 10.0 ** (1 - digits) * value * (1 + 1e-9), 1e-12 * value)


def test_lists_have_commas_and_one_and():
    listed = [list_numbers("tree", numbers) for numbers in ([45], [45, 286], [45, 286, 287, 312])]
    assert listed == ["tree 45", "trees 45 and 286", "trees 45, 286, 287 and 312"]


def test_a_message_is_one_printable_line_that_keeps_its_ends_and_an_empty_one_is_its_type():
    assert one_line(ValueError("no\n\tsuch\x1b[2J  file")) == one_line("no such [2J file") == "no such [2J file"
    assert one_line(KeyError()) == "KeyError" and one_line("") == ""
    line = one_line("a" * 1500 + "b" * 1500)
    assert line == "a" * 997 + " ... " + "b" * 997 and one_line("a" * 2000) == "a" * 2000
