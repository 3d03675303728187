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
_UNPACK, _SAVE = "unpack it first", "save it as UTF-8"
_UTF_32 = (b"\xff\xfe\x00\x00", b"\x00\x00\xfe\xff")
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
# By their first bytes, files that are no text in UTF-8, and what to do with them.
_KINDS = {
    b"\x1f\x8b": ("compressed by gzip", _UNPACK),
    b"BZh": ("compressed by bzip2", _UNPACK),
    b"\xfd7zXZ\x00": ("compressed by xz", _UNPACK),
    b"\x28\xb5\x2f\xfd": ("compressed by zstd", _UNPACK),
    b"PK\x03\x04": ("a zip archive, as workbooks of spreadsheets are", "unpack it, or save the table as CSV in UTF-8"),
    **dict.fromkeys(_UTF_32, ("text in UTF-32", _SAVE)),
    **dict.fromkeys(_UTF_16, ("text in UTF-16", _SAVE)),
}
# Control characters of Latin-1 except tabs and ends of lines; no text has them.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\x80-\x84\x86-\x9f]")
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
    """The text of a file in UTF-8; limits and errors as in `read_bytes`."""
    read = read_bytes(path, where, most)
    _check_text(read, path, where)
    try:
        return read.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{where}: {path} cannot be read: {error}") from error


def read_spreadsheet_text(path: Path, where: str, most: int = MOST_BYTES) -> str:
    """As `read_text`, but in any encoding that spreadsheets write: UTF-8, UTF-16 with a mark, or Latin-1."""
    read = read_bytes(path, where, most)
    if read.startswith(_UTF_16) and not read.startswith(_UTF_32):
        try:
            return read.decode("utf-16")
        except UnicodeDecodeError as error:
            raise InputError(f"{where}: {path} cannot be read: {error}") from error
    _check_text(read, path, where)
    try:
        return read.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = read.decode("latin-1")
    if control := _CONTROL.search(text):
        raise InputError(f"{where}: {path} cannot be read: is no text, as byte {control.start()} is {control[0]!r}")
    return text


def _check_text(read: bytes, path: Path, where: str) -> None:
    """InputError if bytes are not the beginning of a text in an encoding of single bytes."""
    for start, (kind, remedy) in _KINDS.items():
        if read.startswith(start):
            raise InputError(f"{where}: {path} cannot be read: is {kind}; {remedy}")
    if b"\0" in read:
        raise InputError(f"{where}: {path} cannot be read: has zero bytes, as UTF-16 or no text has; {_SAVE}")


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
