"""Arrays of an untrusted npz file: none is unpickled, and all together take no more memory than its size allows."""

import os
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


class Npz:
    """An open archive of arrays."""

    def __init__(self, file: BinaryIO) -> None:
        """Read the table of contents; ValueError if it is too long or damaged, or all members are too large."""
        size = file.seek(0, os.SEEK_END)
        count = _count_members(file, size)
        try:
            self._archive = zipfile.ZipFile(file)
        except Exception as error:  # zipfile, zlib and struct raise errors of many kinds
            raise ValueError(f"is a damaged archive: {one_line(error)}") from error
        members = self._archive.infolist()
        self.names = [member.filename.removesuffix(".npy") for member in members]
        if len(set(self.names)) < len(self.names):
            raise ValueError("holds two members of one name")
        if len(members) != count:  # a damaged length of one entry can hide the next ones
            raise ValueError(f"is a damaged archive: lists {len(members)} members, not {count}")
        if any(member.compress_type not in _PLAIN or member.flag_bits & 1 for member in members):
            raise ValueError("holds members that are encrypted or compressed otherwise than by deflate")
        total, most = sum(member.file_size for member in members), min(MOST_BYTES, max(SMALL, RATIO * size))
        if total > most:
            raise ValueError(f"would inflate to {total} bytes; a file of {size} bytes is allowed {most}")

    def read(self, name: str) -> NDArray[np.generic]:
        """An array, in C order; ValueError if it cannot be read without unpickling."""
        try:
            with self._archive.open(f"{name}.npy") as member:
                array = np.lib.format.read_array(member, allow_pickle=False)
                if member.read(1):  # at the end of the member, its checksum is compared
                    raise ValueError(f"holds more bytes than its shape {array.shape} needs")
        except Exception as error:
            raise ValueError(f"cannot be read: {one_line(error)}") from error
        return np.ascontiguousarray(array).reshape(array.shape)


@contextmanager
def open_npz(path: str | os.PathLike[str]) -> Iterator[Npz]:
    """The archive at `path`; ValueError if it is no valid archive, OSError if it cannot be opened."""
    if not stat.S_ISREG(os.stat(path).st_mode):  # checked before opening, which would wait for a pipe
        raise ValueError("not a recording: is not a file")
    with open(path, "rb") as file:
        try:
            archive = Npz(file)
        except ValueError as error:
            raise ValueError(f"not a recording: {error}") from error
        yield archive


def _count_members(file: BinaryIO, size: int) -> int:
    """Number of members that the end of a zip archive states; ValueError if there is no such end, or if it is large.

    A long table of contents would take memory.
    """
    file.seek(max(0, size - 42))
    tail = file.read(42)
    end = tail[-22:]
    if len(end) < 22 or end[:4] != b"PK\x05\x06" or end[20:] != b"\0\0":
        raise ValueError("is not an npz archive, or only the beginning of one")
    count, length = struct.unpack("<HI", end[10:16])
    if length > _MOST_DIRECTORY or tail[:4] == b"PK\x06\x07":
        raise ValueError("is an archive of too many members")
    return int(count)
