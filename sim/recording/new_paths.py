"""Paths of new files and folders: names that are free, and names until they are whole."""

import secrets
from pathlib import Path

from tracking.plugins.registry import InputError


def unfinished(path: Path) -> Path:
    """Path of a file until it is whole: a hidden name that nothing else has, in the same folder."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


def check_new(path: Path, suffix: str, option: str, *, also: str = "") -> None:
    """InputError unless a new file that ends in `suffix` can be written at `path`, which is tried."""
    if path.suffix != suffix:
        raise InputError(f"{option}: {str(path)!r} is not allowed; expected a new file that ends in {suffix}{also}")
    part = unfinished(path)
    try:
        if path.exists():
            raise InputError(f"{option}: {path} exists; name a new file")
        if not path.parent.is_dir():
            raise InputError(f"{option}: {path} cannot be written: there is no folder {path.parent}")
        part.touch()
        part.unlink()
    except OSError as error:
        raise InputError(f"{option}: {path} cannot be written: {error.strerror}") from error


def unused(path: Path, suffix: str = "") -> Path:
    """The path with a suffix such as .mp4 added, or its first numbered sibling, that does not exist yet."""
    number, free = 1, path.with_name(f"{path.name}{suffix}")
    while free.exists():
        number += 1
        free = path.with_name(f"{path.name}-{number}{suffix}")
    return free
