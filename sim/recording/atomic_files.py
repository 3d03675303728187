"""Files and folders that appear completely or not at all, and unused names for them."""

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tracking.errors import InputError


class PlaceTaken(Exception):
    """Results are in another place than asked for; the message is one line that names it."""


def part_path(path: Path) -> Path:
    """Path of a file until it is complete: a unique hidden name in the same folder."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


def unused_path(path: Path, suffix: str = "") -> Path:
    """The path with a suffix such as .mp4, or the first numbered variant of it that does not exist yet."""
    number, free = 1, path.with_name(f"{path.name}{suffix}")
    while free.exists():
        number += 1
        free = path.with_name(f"{path.name}-{number}{suffix}")
    return free


@contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """Yield a path to write to; the file is renamed to `path` when the block ends, and removed if the block raises."""
    part = part_path(path)
    try:
        yield part
        os.replace(part, path)
    finally:
        with suppress(OSError):  # the error of the block says more
            part.unlink()


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder, which is renamed to `out` when the block ends, and removed if the block raises.

    If another program has made `out` meanwhile, the folder gets the next unused name, which a PlaceTaken tells.
    """
    if not out.name:
        raise InputError(f"--out: {str(out)!r} cannot be the name of a new folder")
    place = Path(os.path.realpath(out))  # the target of a link, because a folder cannot replace the link
    part = part_path(place)
    made: list[Path] = []
    try:
        try:
            if out.exists() and not (out.is_dir() and not any(out.iterdir())):
                what = "already holds a run" if (out / "summary.json").exists() else "exists and is not an empty folder"
                raise InputError(f"--out: {out} {what}; name a new folder")
            if out.is_mount():  # the root of a file system cannot be replaced either
                raise InputError(f"--out: {out} is where a file system is mounted; name a new folder in it")
            made = [folder for folder in place.parents if not folder.exists()]  # innermost first
            part.mkdir(parents=True)
        except OSError as error:
            raise InputError(f"--out: {out} cannot be written: {error.strerror}") from error
        yield part
        _rename_folder(part, place, out)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        for folder in made:
            with suppress(OSError):  # not made, or now used by another process
                folder.rmdir()
        raise


def _rename_folder(part: Path, place: Path, out: Path) -> None:
    """Rename a complete folder to its place, or to the next unused name."""
    try:
        part.rename(place)
    except OSError as error:
        if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
            raise
        free = unused_path(place)
        part.rename(free)
        raise PlaceTaken(
            f"{out} was made by another program meanwhile; the results are in {free.name} beside it"
        ) from error
