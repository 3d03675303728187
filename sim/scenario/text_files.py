"""Reading of text files, which must be regular files of limited size."""

import re
import stat
import sys
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from tracking.errors import InputError, did_you_mean, nearest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_BYTES = 2**26  # largest size of a file
_UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_FORMATS = {  # by their first bytes
    b"PK\x03\x04": "a workbook of Excel, or another ZIP archive",
    b"\xd0\xcf\x11\xe0": "a workbook of Excel",
    b"\x1f\x8b": "a gzip archive",
    b"SQLite format": "a database, such as a GeoPackage",
}
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")  # characters that no text has
_BLOCK = 2**20  # bytes read at once
_MOST_TOML = 2**22  # bytes, which are parsed at about a megabyte per second
_DEEPEST = 30  # levels of nested tables and lists
# Parts of a dotted key, one for each level. A parser needs time and memory that grow with the square of their number.
_PART = r"""(?:[\w-]+|"(?:\\.|[^"\\\n])*"|'[^'\n]*')[ \t]*\.[ \t]*"""
_DEEP_KEY = re.compile(rf"(?<![\w\\-])(?:{_PART}){{{_DEEPEST}}}")


def read_bytes(path: Path, where: str, most: int = MOST_BYTES) -> bytes:
    """The bytes of a regular file, no more than `most`; InputError (also for pipes and devices) begins with `where`."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # checked before opening, which would wait for a pipe
            raise OSError("is not a file")
        with path.open("rb") as file:
            # Read in blocks: files such as those in /proc tell no size, and to read `most` at once would allocate it.
            read = b"".join(islice(iter(lambda: file.read(_BLOCK), b""), most // _BLOCK + 1))
    except (OSError, ValueError) as error:  # ValueError: the path contains a zero byte
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{where}: {path} cannot be read: {reason}") from error
    if len(read) > most:
        raise InputError(f"{where}: {path} cannot be read: has more than the {most} bytes that are allowed")
    return read


def read_text(path: Path, where: str, most: int = MOST_BYTES) -> str:
    """The text of a file in UTF-8, in UTF-16 with a mark, or in Windows-1252; limits and errors as in `read_bytes`."""
    read = read_bytes(path, where, most)
    for encoding in ("utf-16",) if read.startswith(_UTF_16_MARKS) else ("utf-8-sig", "cp1252"):
        try:
            text = read.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not _CONTROL.search(text):
            return text.lstrip("\ufeff")  # some programs write a second mark
    other = next((f", but {name}" for first, name in _FORMATS.items() if read.startswith(first)), "")
    no_text = "is no text in UTF-8, UTF-16 with a mark, or Windows-1252"
    raise InputError(f"{where}: {path} cannot be read: {no_text}{other}")


def find_toml_file(name: str, packaged: Mapping[str, Path], where: str) -> Path:
    """Path of the packaged TOML file with this name, or of the file with this path; InputError if there is none."""
    path = packaged.get(name, Path(name))
    if path.suffix != ".toml":
        raise InputError(f"{where}: {name!r} is unknown; {did_you_mean(name, packaged)} (or a .toml file)")
    if not path.is_file():
        raise InputError(f"{where}: there is no file {name}{_suggest_files(path, packaged)}")
    return path


def _suggest_files(path: Path, packaged: Mapping[str, Path]) -> str:
    """End of an error message that suggests similar files; the common ending .toml does not count as similar."""
    if path.stem in packaged:
        return f"; did you mean {path.stem}, which is packaged?"
    near = [str(file) for file in sorted(path.parent.glob("*.toml")) if nearest(path.stem, [file.stem])]
    return nearest(str(path), near)


def read_toml(path: Path, where: str) -> dict[str, Any]:
    """The tables of a TOML file; errors as in `read_bytes`."""
    return parse_toml(read_text(path, where, _MOST_TOML), f"{where}: {path}")


def parse_toml(written: str, where: str) -> dict[str, Any]:
    """The tables of a TOML text; InputError begins with `where`."""
    if _DEEP_KEY.search(written):
        raise _make_depth_error(where)
    try:
        found = tomllib.loads(written)
    except ValueError as error:  # invalid TOML, or an integer of thousands of digits
        raise InputError(f"{where}: {error}") from error
    except RecursionError as error:
        raise _make_depth_error(where) from error
    level: list[Any] = [found]
    for _ in range(_DEEPEST):
        level = [item for node in level for item in (node.values() if isinstance(node, dict) else node)]
        level = [item for item in level if isinstance(item, dict | list)]
    if level:
        raise _make_depth_error(where)
    return found


def _make_depth_error(where: str) -> InputError:
    return InputError(f"{where}: is nested too deep; at most {_DEEPEST} levels are allowed")
