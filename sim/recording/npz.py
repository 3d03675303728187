"""Arrays of an untrusted npz file: none is unpickled, and none is read before its size has been checked."""

import math
import os
import re
import stat
import struct
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from tracking.errors import one_line

MOST_BYTES = 2**30  # of all arrays together
SMALL, RATIO = 2**25, 64  # bytes to which any file may inflate, or the ratio to its own size if that is more
_MOST_DIRECTORY = 2**16  # bytes of the archive's table of contents, which is read before anything can be checked
_PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # other methods inflate without a limit
_MAGIC = b"\x93NUMPY\x01\x00"
# The header that NumPy writes before an array; any other is refused.
_HEADER = re.compile(rb"\{'descr': '([^']{1,24})', 'fortran_order': (True|False), 'shape': \(([0-9, ]{0,99})\), \} *\n")


class Npz:
    """An open archive of arrays."""

    def __init__(self, file: BinaryIO) -> None:
        """Read the table of contents; ValueError if it is too long or not plain, or all members are too large."""
        size = file.seek(0, os.SEEK_END)
        _check_end(file, size)
        try:
            self._archive = zipfile.ZipFile(file)
        except Exception as error:  # zipfile, zlib and struct raise errors of many kinds
            raise ValueError(f"is a damaged archive: {one_line(error)}") from error
        entries = self._archive.infolist()
        self.names = tuple(entry.filename.removesuffix(".npy") for entry in entries)
        # We never write comments; in a damaged file, one may contain the entries that follow it.
        self.plain = not any(entry.extra or entry.comment for entry in entries)
        if len(set(self.names)) < len(self.names):
            raise ValueError("holds two members of one name")
        if any(entry.compress_type not in _PLAIN or entry.flag_bits & 1 for entry in entries):
            raise ValueError("holds members that are encrypted or compressed otherwise than by deflate")
        total, most = sum(entry.file_size for entry in entries), min(MOST_BYTES, max(SMALL, RATIO * size))
        if total > most:
            raise ValueError(f"would inflate to {total} bytes; a file of {size} bytes is allowed {most}")

    def read(self, name: str) -> NDArray[np.generic]:
        """An array with a valid header; ValueError if its number of bytes differs from the header's."""
        kind, shape, start = self.header(name)
        held = self._archive.getinfo(f"{name}.npy").file_size - start
        needed = math.prod(shape) * np.dtype(kind).itemsize
        if held != needed:
            raise ValueError(f"cannot be read: has {held} bytes, its shape {shape} needs {needed}")
        try:
            with self._archive.open(f"{name}.npy") as member:
                array: NDArray[np.generic] = np.lib.format.read_array(member, allow_pickle=False)
                member.read(1)  # reaches the end, where the checksum is compared
        except Exception as error:
            raise ValueError(f"cannot be read: {one_line(error)}") from error
        return array

    def header(self, name: str) -> tuple[str, tuple[int, ...], int]:
        """Data type such as `<f8`, shape, and number of bytes before the values of an array in the archive.

        ValueError if the header cannot be read.
        """
        try:
            with self._archive.open(f"{name}.npy") as member:
                prefix = member.read(len(_MAGIC) + 2)
                if prefix[:-2] != _MAGIC:
                    raise ValueError("is no array")
                text = member.read(int.from_bytes(prefix[-2:], "little"))
        except Exception as error:
            raise ValueError(f"cannot be read: {one_line(error)}") from error
        found = _HEADER.fullmatch(text)
        if found is None:
            raise ValueError("cannot be read: its header is none of a plain array")
        kind, shape = found[1].decode("latin-1"), tuple(int(n) for n in found[3].split(b",") if n.strip())
        if "O" in kind:
            raise ValueError("cannot be read: Object arrays, which hold code, are never loaded")
        if found[2] == b"True":
            raise ValueError("cannot be read: its order of axes is Fortran's")
        return kind, shape, len(prefix) + len(text)


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Npz]:
    """The archive at `path`; ValueError if it is no valid archive, OSError if it cannot be opened."""
    if not stat.S_ISREG(os.stat(path).st_mode):  # checked before opening, which would wait for a pipe
        raise ValueError("not a recording: is not a file")
    with open(path, "rb") as file:
        try:
            archive = Npz(file)
        except ValueError as error:
            raise ValueError(f"not a recording: {error}") from error
        yield archive


def _check_end(file: BinaryIO, size: int) -> None:
    """ValueError unless the file ends like a zip archive with few members, as a list of many would take memory."""
    file.seek(max(0, size - 42))
    tail = file.read(42)
    end = tail[-22:]
    if len(end) < 22 or end[:4] != b"PK\x05\x06" or end[20:] != b"\0\0":
        raise ValueError("is not an npz archive, or only the beginning of one")
    (length,) = struct.unpack("<I", end[12:16])
    if length > _MOST_DIRECTORY or tail[:4] == b"PK\x06\x07":
        raise ValueError("is an archive of too many members")
