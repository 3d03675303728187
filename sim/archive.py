"""A recording on disk: compressed npz, never pickled, the same bytes for the same mission."""

from __future__ import annotations

import io
import os
import struct
import tokenize
import zipfile
import zlib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from sim.atomic import whole
from sim.contacts import KINDS
from sim.recording import VERSION, Recording

_EPOCH = (1980, 1, 1, 0, 0, 0)
# Fields that recordings did not always have.
_LATER = {field.name for field in fields(Recording) if field.default_factory is not MISSING}
_UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, struct.error, ValueError),
    *(SyntaxError, tokenize.TokenError),  # NumPy parses an array's header as Python
)


def save(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write the recording whole or not at all; equal content gives equal bytes."""
    with whole(Path(path)) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, (_, dtype, _) in _fields().items():
            value = getattr(recording, name)
            array = np.array(str(value)) if dtype == "<U" else np.ascontiguousarray(value, dtype=dtype)
            content = io.BytesIO()
            np.lib.format.write_array(content, array.reshape(np.shape(value)), allow_pickle=False)
            # Time stamp and system are the only parts of an entry that do not follow from its content.
            info = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            archive.writestr(info, content.getvalue())


def load(path: str | os.PathLike[str]) -> Recording:
    """Read and check a recording; anything wrong is a ValueError of one line that names file and field."""
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, struct.error, NotImplementedError, ValueError) as error:
        raise ValueError(f"{path}: not a recording: {_line(error)}") from error
    sizes: dict[str, int] = {}
    values: dict[str, Any] = {}
    with archive:
        lacking = _lacking(archive)
        for name, (kind, dtype, shape) in _fields().items():
            if name in lacking:
                values[name] = kind() if kind in (bool, str) else _unknown(dtype, shape, sizes)
                continue
            array = _read(archive, path, name)
            try:
                _check(array, dtype, shape, sizes)
                values[name] = kind(array.item()) if kind in (int, str, bool) else array
                _check_version(values["version"])
            except ValueError as error:
                raise ValueError(f"{path}: field '{name}': {error}") from error
    for name, symbol in (("measurement_offsets", "D"), ("track_offsets", "S")):
        offsets, rows = values[name], sizes[symbol]
        if offsets[0] != 0 or offsets[-1] != rows or np.any(np.diff(offsets) < 0):
            raise ValueError(f"{path}: field '{name}': does not rise from 0 to {rows}")
    _check_contacts(values["contacts"], (sizes["K"], sizes["n"], len(KINDS)), path)
    return Recording(**values)


def _fields() -> dict[str, tuple[Any, str, str]]:
    hints = get_type_hints(Recording, include_extras=True)
    return {name: (hint.__origin__, *hint.__metadata__) for name, hint in hints.items()}


def _read(archive: zipfile.ZipFile, path: str | os.PathLike[str], name: str) -> NDArray[Any]:
    try:
        with archive.open(f"{name}.npy") as member:
            return np.asarray(np.lib.format.read_array(member, allow_pickle=False))
    except KeyError:
        raise ValueError(f"{path}: field '{name}' is missing") from None
    except _UNREADABLE as error:
        raise ValueError(f"{path}: field '{name}' cannot be read: {_line(error)}") from error


def _lacking(archive: zipfile.ZipFile) -> set[str]:
    """Fields that the recording is too old to have; none if it holds something unknown, so that damage is noticed.

    An entry's comment, which we never write, may have swallowed the entries behind it.
    """
    names = {name.removesuffix(".npy") for name in archive.namelist()}
    intact = not any(entry.extra or entry.comment for entry in archive.infolist())
    return _LATER - names if intact and names <= set(_fields()) else set()


def _unknown(dtype: str, shape: str, sizes: dict[str, int]) -> NDArray[Any]:
    """What stands for a field that an old recording lacks: no rows, or -1 everywhere."""
    return np.full([_size(symbol, 0, sizes) for symbol in shape.split()], -1, dtype)


def _check(array: NDArray[Any], dtype: str, shape: str, sizes: dict[str, int]) -> None:
    """Compare with the annotation; the first array that has a dimension fixes its size for the others."""
    if array.dtype.kind != "U" if dtype == "<U" else array.dtype != np.dtype(dtype):
        raise ValueError(f"has dtype {array.dtype}, not {dtype}")
    symbols = shape.split()
    expected = [_size(symbol, size, sizes) for symbol, size in zip(symbols, array.shape, strict=False)]
    if array.shape != tuple(expected) or len(symbols) != array.ndim:
        raise ValueError(f"has shape {array.shape}, not ({', '.join(symbols)}) as the fields before it")
    sizes.update(zip(symbols, array.shape, strict=True))


def _size(symbol: str, found: int, sizes: dict[str, int]) -> int:
    if symbol == "K*n+1":
        return sizes["K"] * sizes["n"] + 1
    return int(symbol) if symbol.isdigit() else sizes.get(symbol, found)


def _check_contacts(contacts: NDArray[Any], limits: tuple[int, int, int], path: str | os.PathLike[str]) -> None:
    if np.any(contacts < 0) or np.any(contacts[:, :3] >= limits) or np.any(np.diff(contacts[:, 0]) < 0):
        raise ValueError(f"{path}: field 'contacts': names a scan, UAV or kind that is not there, or not in order")


def _check_version(version: int) -> None:
    if version != VERSION:
        raise ValueError(f"is {version}, but this program reads {VERSION}")


def _line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
