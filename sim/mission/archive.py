"""A recording on disk: an npz file without pickled objects, with the same bytes for the same mission."""

import hashlib
import io
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.mission.atomic_files import write_whole
from sim.mission.npz import Npz, open_npz
from sim.mission.recording import FIELDS, OPTIONAL, VERSION, Field, Recording
from sim.mission.recording_check import check_recording
from tracking.errors import InputError, one_line

_EPOCH = (1980, 1, 1, 0, 0, 0)
_LONGEST = 2**20  # characters of a text field
_LARGE = 2**24  # bytes, of recordings that are compressed


def save(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write the recording completely or not at all; equal content gives equal bytes."""
    with write_whole(Path(path)) as part:
        part.write_bytes(encode(recording))


def compute_digest(recording: Recording) -> str:
    """SHA-256 of the recording's bytes before compression; `save` writes these bytes unless the recording is large."""
    return hashlib.sha256(_pack(recording, zipfile.ZIP_STORED)).hexdigest()


def encode(recording: Recording) -> bytes:
    """The bytes that `save` writes.

    Only large recordings are compressed, because versions of the compression library differ in their output.
    """
    plain = _pack(recording, zipfile.ZIP_STORED)
    return plain if len(plain) <= _LARGE else _pack(recording, zipfile.ZIP_DEFLATED)


def _pack(recording: Recording, compression: int) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, field in FIELDS.items():
            value = getattr(recording, name)
            if value is None and name in OPTIONAL:
                continue
            array = np.array(str(value)) if field.dtype == "<U" else np.ascontiguousarray(value, dtype=field.dtype)
            member = io.BytesIO()
            np.lib.format.write_array(member, array.reshape(np.shape(value)), allow_pickle=False)
            # All other parts of an entry follow from its content.
            info = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            info.create_system = 3
            info.compress_type = compression
            archive.writestr(info, member.getvalue())
    return file.getvalue()


def load_recording(path: str | os.PathLike[str]) -> Recording:
    """Read and check a recording; errors are ValueErrors of one line that names file and field.

    The file may come from any source: nothing in it is executed, imported or opened, and it takes no more memory than
    `sim.mission.npz` allows for its size.
    """
    try:
        with open_npz(path) as archive:
            recording = _decode(archive)
        check_recording(recording)
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from error
    return recording


def find_recording(folder: Path) -> Recording:
    """The recording in a run's folder or file; InputError if there is none that can be read."""
    try:
        path = folder / "mission.npz" if folder.is_dir() else folder
        if not path.exists():
            raise InputError(f"{folder} " + (_describe_content(folder) if folder.is_dir() else "does not exist"))
        recording = load_recording(path)
        _ = recording.setting  # which may be unknown here
    except OSError as error:
        raise InputError(f"DIR: {folder} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"DIR: {error}") from error
    return recording


def _describe_content(folder: Path) -> str:
    if (folder / "study.sqlite").exists():
        return "holds a study; its report.html has commands that fly its trials again, `--keep recordings` keeps them"
    return "holds no mission.npz"


def _decode(archive: Npz) -> Recording:
    if "version" not in archive.names:
        found = ", ".join(map(repr, archive.names[:5]))[:200]
        raise ValueError(f"not a recording: its arrays are {found}" if found else "not a recording: holds nothing")
    sizes: dict[str, int] = {}
    values: dict[str, Any] = {}
    for name, field in FIELDS.items():
        if name not in archive.names and name in OPTIONAL:
            continue
        if name not in archive.names:
            raise ValueError(f"made by another version of understory: it has no field '{name}'")
        with _name_errors(name):
            array = archive.read(name)
            _check_form(array, field, sizes)
            values[name] = array if field.shape else _make_plain(field.kind, array)
            if name == "version":
                _check_version(values[name])
    return Recording(**values)


@contextmanager
def _name_errors(name: str) -> Iterator[None]:
    """Prefix ValueErrors raised in the block with the name of a field."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"field '{name}': {one_line(error)}") from error


def _check_form(array: NDArray[Any], field: Field, sizes: dict[str, int]) -> None:
    """Compare data type and shape with the annotation; the first array with a dimension fixes its size for the rest."""
    found = array.dtype.str
    if not (found.startswith("<U") if field.dtype == "<U" else found == field.dtype):
        raise ValueError(f"has dtype {found}, not {field.dtype}")
    if field.dtype == "<U" and array.dtype.itemsize // 4 > _LONGEST:
        raise ValueError(f"has dtype {found}; at most {_LONGEST} characters are allowed")
    symbols = field.shape.split()
    expected = [_find_size(symbol, n, sizes) for symbol, n in zip(symbols, array.shape, strict=False)]
    if list(array.shape) != expected or len(symbols) != array.ndim:
        raise ValueError(f"has shape {array.shape}, not ({', '.join(symbols)}) as the fields before it")
    sizes.update(zip(symbols, array.shape, strict=True))


def _find_size(symbol: str, found: int, sizes: Mapping[str, int]) -> int:
    if symbol == "K*n+1":
        return sizes["K"] * sizes["n"] + 1
    if symbol[0].isdigit():  # one number, or several as in 6|7
        allowed = [int(number) for number in symbol.split("|")]
        return found if found in allowed else allowed[0]
    return sizes.get(symbol, found)


def _make_plain(kind: type, array: NDArray[Any]) -> Any:  # noqa: ANN401 - as the annotation says
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
