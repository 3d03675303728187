"""A recording on disk: an npz file without pickled objects, with the same bytes for the same mission."""

import hashlib
import io
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.recording.atomic_files import whole
from sim.recording.npz import Npz, opened
from sim.recording.recording import FIELDS, VERSION, Recording
from sim.recording.validation import check
from tracking.errors import one_line

_EPOCH = (1980, 1, 1, 0, 0, 0)
# Fields that old recordings lack.
_LATER = {field.name for field in fields(Recording) if field.default_factory is not MISSING}
_LONGEST = 2**20  # characters of a text field


def save(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write the recording completely or not at all; equal content gives equal bytes."""
    with whole(Path(path)) as part:
        part.write_bytes(content(recording))


def digest(recording: Recording) -> str:
    """SHA-256 of the bytes that `save` writes."""
    return hashlib.sha256(content(recording)).hexdigest()


def content(recording: Recording) -> bytes:
    """The bytes that `save` writes, uncompressed because versions of the compression library differ in their output."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, (_, dtype, _) in FIELDS.items():
            value = getattr(recording, name)
            array = np.array(str(value)) if dtype == "<U" else np.ascontiguousarray(value, dtype=dtype)
            member = io.BytesIO()
            np.lib.format.write_array(member, array.reshape(np.shape(value)), allow_pickle=False)
            # All other parts of an entry follow from its content.
            info = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            info.create_system = 3
            archive.writestr(info, member.getvalue())
    return file.getvalue()


def load(path: str | os.PathLike[str]) -> Recording:
    """Read and check a recording; errors are ValueErrors of one line that names file and field.

    The file may come from any source: nothing in it is executed, imported or opened, and it takes no more memory than
    `sim.recording.npz` allows for its size. Fields that an old file lacks get their defaults.
    """
    try:
        with opened(path) as archive:
            return _loaded(archive)
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from error


def _loaded(archive: Npz) -> Recording:
    _check_ours(archive)
    sizes: dict[str, int] = {}
    lacking = _lacking(archive)
    for name, (_, dtype, shape) in FIELDS.items():
        if name not in lacking:
            if name not in archive.names:
                raise ValueError(f"field '{name}' is missing")
            with _about(name):
                _check(*archive.header(name)[:2], dtype, shape, sizes)
                if name == "version":
                    _check_version(int(archive.read(name)))
    values: dict[str, Any] = {}
    for name, (kind, dtype, shape) in FIELDS.items():
        if name in lacking:
            size = [_size(symbol, 0, sizes) for symbol in shape.split()]
            values[name] = kind() if kind in (bool, str, int) else np.full(size, -1, dtype)  # no rows, or -1 everywhere
            continue
        with _about(name):
            array = archive.read(name)
            values[name] = _plain(kind, array) if kind in (int, str, bool) else array
    recording = Recording(**values)
    check(recording)
    return recording


@contextmanager
def _about(name: str) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f"field '{name}': {one_line(error)}") from error


def _check_ours(archive: Npz) -> None:
    """ValueError that lists the content of an archive without a recording's version."""
    if "version" not in archive.names:
        names = ", ".join(map(repr, archive.names[:5]))[:200]
        raise ValueError(f"not a recording: its arrays are {names}" if names else "not a recording: holds nothing")


def _lacking(archive: Npz) -> set[str]:
    """Fields that an old recording lacks; none if it contains unknown fields, so that damage is noticed."""
    names = set(archive.names)
    return _LATER - names if archive.plain and names <= set(FIELDS) else set()


def _check(found: str, size: tuple[int, ...], dtype: str, shape: str, sizes: dict[str, int]) -> None:
    """Compare data type and shape with the annotation; the first array with a dimension fixes its size for the rest."""
    if not (found.startswith("<U") and found[2:].isdigit() if dtype == "<U" else found == dtype):
        raise ValueError(f"has dtype {found}, not {dtype}")
    if dtype == "<U" and int(found[2:]) > _LONGEST:
        raise ValueError(f"has dtype {found}; at most {_LONGEST} characters are allowed")
    symbols = shape.split()
    expected = [_size(symbol, n, sizes) for symbol, n in zip(symbols, size, strict=False)]
    if size != tuple(expected) or len(symbols) != len(size):
        raise ValueError(f"has shape {size}, not ({', '.join(symbols)}) as the fields before it")
    sizes.update(zip(symbols, size, strict=True))


def _size(symbol: str, found: int, sizes: dict[str, int]) -> int:
    if symbol == "K*n+1":
        return sizes["K"] * sizes["n"] + 1
    return int(symbol) if symbol.isdigit() else sizes.get(symbol, found)


def _plain(kind: type, array: NDArray[Any]) -> Any:  # noqa: ANN401 - as the annotation says
    """A Python string, number or bool from an array; a number in the form of text must consist of digits 0 to 9."""
    if array.dtype.kind != "U":
        return kind(array.item())
    text = array.tobytes().decode("utf-32-le").rstrip("\0")  # NumPy itself accepts invalid characters
    if kind is int and not (text.isascii() and text.isdigit()):
        raise ValueError(f"is {text[:50]!r}, not a number of digits 0 to 9")
    return kind(text)


def _check_version(version: int) -> None:
    if version > VERSION:
        reads = f"is {version}, but this program reads {VERSION}"
        raise ValueError(f"{reads}: made by a newer understory; upgrade understory to read it")
    if version < 1:
        raise ValueError(f"is {version}; the first was 1")
