"""Files and folders that appear completely or not at all, and unused names for them."""

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from tracking.errors import InputError


class PlaceTaken(Exception):
    """Results are in another place than asked for; the message is one line that names it."""


def make_part_path(path: Path) -> Path:
    """Path of a file until it is complete: a unique hidden name in the same folder."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


@contextmanager
def claim_place(asked: Path | None, default: Path, suffix: str = "") -> Iterator[Path]:
    """Yield the place that was asked for, else the first unused one of `default`, `default`-2, ..., each with `suffix`.

    Until the block ends no other process gets the same default: a hidden file marks it. The mark of a killed process
    stays, and its number is left out from then on. InputError if the place cannot be written.
    """
    if asked is not None:
        yield asked
        return
    made = [folder for folder in default.parents if not folder.exists()]
    try:
        for folder in reversed(made):
            folder.mkdir(exist_ok=True)
        place, mark = next(filter(None, map(_claim, number_names(default, suffix))))
    except OSError as error:
        raise InputError(f"{default}{suffix} cannot be written: {error.strerror}; name a place with --out") from error
    try:
        yield place
    finally:
        mark.unlink(missing_ok=True)
        for folder in made:
            with suppress(OSError):  # it holds the results
                folder.rmdir()


def number_names(path: Path, suffix: str = "") -> Iterator[Path]:
    """The path, path-2, path-3 and so on, each with the suffix."""
    yield path.with_name(f"{path.name}{suffix}")
    for number in count(2):
        yield path.with_name(f"{path.name}-{number}{suffix}")


def _claim(place: Path) -> tuple[Path, Path] | None:
    """The place and its new mark, unless the place is used or marked."""
    mark = place.with_name(f".{place.name}.taken")
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return None
    if place.exists():
        mark.unlink()
        return None
    return place, mark


@contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """Yield a path to write to; the file is renamed to `path` when the block ends, and removed if the block raises."""
    part = make_part_path(path)
    try:
        yield part
        os.replace(part, path)
    finally:
        with suppress(OSError):  # the error of the block says more
            part.unlink()


@contextmanager
def make_new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder, which is renamed to `out` when the block ends, and removed if the block raises.

    If another program has made `out` meanwhile, the folder gets the next unused name, which PlaceTaken names.
    """
    if not out.name:
        raise InputError(f"--out: {str(out)!r} cannot be the name of a new folder")
    place = Path(os.path.realpath(out))  # the target of a link, because a folder cannot replace the link
    part = make_part_path(place)
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
    for name in number_names(place):
        try:
            part.rename(name)
        except OSError as error:
            if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
                raise
        else:
            break
    if name != place:
        raise PlaceTaken(f"{out} was made by another program meanwhile; the results are in {name.name} beside it")
