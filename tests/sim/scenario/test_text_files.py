"""Text comes from plain files of a sensible size alone, and TOML from what a parser ends with."""

import os

import pytest

from sim.scenario.errors import InputError
from sim.scenario.text_files import MOST_BYTES, content, text, toml, toml_file, tomllib


def sparse(path):
    with path.open("wb") as file:
        file.truncate(MOST_BYTES + 1)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (os.mkfifo, "is no file"),
        (lambda path: path.mkdir(), "is no file"),
        (lambda path: path.symlink_to("/dev/zero"), "is no file"),
        (lambda path: path.symlink_to("/dev/random"), "is no file"),
        (lambda path: path.symlink_to(path.name), "symbolic links"),
        (lambda path: None, "No such file"),
        (sparse, f"more than the {MOST_BYTES} bytes that are allowed"),
        (lambda path: path.write_bytes(b"\xff"), "codec can't decode"),
    ],
    ids=["pipe", "folder", "zeros", "chance", "loop", "nothing", "too large", "no text"],
)
def test_what_is_no_plain_text_is_refused(tmp_path, make, reason):
    path = tmp_path / "given"
    make(path)
    with pytest.raises(InputError, match=rf"^field: .*given cannot be read: .*{reason}"):
        text(path, "field")


def test_the_largest_allowed_file_is_read_without_its_byte_order_mark(tmp_path):
    path = tmp_path / "given.toml"
    path.write_bytes(b"\xef\xbb\xbfx = 1")
    assert content(path, "field", 8) == b"\xef\xbb\xbfx = 1" and toml_file(path, "field") == {"x": 1}
    with pytest.raises(InputError, match="more than the 7 bytes"):
        content(path, "field", 7)


@pytest.mark.parametrize(
    "written",
    [
        f"x = {'[' * 5000}{']' * 5000}",
        f"x = {'{a=' * 5000}1{'}' * 5000}",
        f"{'a.' * 300_000}a = 1",
        f"[{'a.' * 300_000}a]",
        f"x = {'[' * 31}{']' * 31}",
        '"a,=".' * 300_000 + "a = 1",
        r'x = {y = """a\"""""", ' + "'b'." * 300_000 + "a = 1}",
    ],
    ids=["lists", "tables", "key", "header", "a few too many", "quoted key", "key behind a string"],
)
def test_nests_are_refused_at_once(written):
    with pytest.raises(InputError, match=r"^field: is nested too deep; at most 30 levels are allowed$"):
        toml(written, "field")


def test_thirty_levels_are_read_and_long_integers_refused():
    assert toml(f"x = {'[' * 29}{']' * 29}", "field")["x"]
    with pytest.raises(InputError, match=r"^field: "):
        toml(f"x = {'9' * 5000}", "field")


@pytest.mark.parametrize(
    "written",
    [
        "x = 1  # {}",
        "x = '{}'",
        r'x = "\"{}"',
        'x = """\\"""{}\n{}"""""',
        "x = '''{}\n{}''''",
        'x = [\n"{}",  # "{}\n \'{}\']',
    ],
    ids=["comment", "literal", "basic", "basic of lines", "literal of lines", "list"],
)
def test_sentences_in_comments_and_strings_are_no_keys(written):
    told = written.replace("{}", "Fly once more. " * 200)
    assert toml(told, "field") == tomllib.loads(told)


@pytest.mark.parametrize("piece", ['"""\n', '\\"""\n', "'''\n'", "'", '"', "\\", '",', "#"])
def test_strings_without_an_end_take_no_time_that_grows_with_their_square(piece):
    with pytest.raises(InputError, match=r"^field: "):
        toml("x = " + "." * 101 + piece * 500_000, "field")
