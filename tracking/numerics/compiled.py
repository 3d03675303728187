"""Decorators that compile numerical functions with Numba and keep the code on disk.

Numba keeps code until the function's own file changes, but the code contains functions and constants of other files,
too. So the code of a module is kept in a folder whose name has a digest of the module and of all that it imports.
"""

import glob
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

_ROOT = Path(__file__).parents[2]
_IMPORT = re.compile(r"^from ((?:tracking|planning|sim)\.[\w.]+) import", re.MULTILINE)
_DIGITS = 16  # of a digest in the name of a folder

functions: dict[str, Path] = {}  # folders for the code of functions, by module and name
not_kept: list[str] = []  # functions whose compiled code this process cannot write to disk


def compiled(function: Function) -> Function:
    """Compile with Numba, cached on disk where possible; the signature stays visible to the type checker.

    `error_model="numpy"` divides as NumPy does; fast-math stays off, so that results are the same everywhere.
    """
    return cast(Function, _compile(function))


def inlined(function: Function) -> Function:
    """As `compiled`, and copied into compiled callers, for functions that take less time than a call."""
    return cast(Function, _compile(function, forceinline=True))


def merged(function: Function) -> Function:
    """As `compiled`, and taken as a part of its only compiled caller, which takes less time than compiling both."""
    return cast(Function, _compile(function, inline="always"))


def _compile(function: Callable[..., Any], **options: Any) -> object:  # noqa: ANN401 - as many types as options
    """Compile a function when it is first called, and keep its code in the folder of its module if there is one."""
    config: Any = numba.config
    options |= {"error_model": "numpy", "no_cfunc_wrapper": True}
    if home := code_folder():
        users = config.CACHE_DIR
        folder = _prepare_folder(Path(function.__code__.co_filename), home)
        if "inline" not in options:
            functions[f"{function.__module__}.{function.__qualname__}"] = folder
        config.CACHE_DIR = str(folder)
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError:  # Numba finds no place for the code
            pass
        finally:
            config.CACHE_DIR = users
    not_kept.append(function.__qualname__)
    return numba.njit(**options)(function)


@cache
def code_folder() -> Path | None:
    """The first folder for compiled code that this process can write to; None if there is none."""
    return next((folder for folder in _list_code_folders() if _can_write(folder)), None)


def _list_code_folders() -> Iterator[Path]:
    """Folders for compiled code: in NUMBA_CACHE_DIR, the installation, the user's cache and the temporary folder."""
    name = f"understory-{hashlib.sha256(os.fsencode(_ROOT)).hexdigest()[:_DIGITS]}"
    if named := numba.config.CACHE_DIR:  # type: ignore[attr-defined]
        yield Path(named) / name
    yield Path(__file__).parents[1] / "__pycache__" / name
    if os.path.isabs(users := os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")):
        yield Path(users) / name
    own = Path(tempfile.gettempdir()) / f"{name}-{os.getuid()}"
    if _is_private(own):
        yield own


def _is_private(folder: Path) -> bool:
    """Make a folder for this user alone; False if it is not, because the code of another user must not run."""
    try:
        folder.mkdir(mode=stat.S_IRWXU, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    return found.st_uid == os.getuid() and found.st_mode == stat.S_IFDIR | stat.S_IRWXU


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _time_changed(path: Path) -> float:
    """Time [s] at which a folder was changed; 0 if another process has deleted it."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


@cache
def _prepare_folder(module: Path, home: Path) -> Path:
    """The folder of a module's code; a new one gets the code of this digest that another folder has."""
    name = os.path.relpath(module, _ROOT).removesuffix(".py").replace(os.sep, "-")
    folder = home / f"{name}-{digest_of(module)[:_DIGITS]}"
    if not folder.is_dir():
        older = sorted(home.glob(f"{name}-{'?' * _DIGITS}"), key=_time_changed)
        for stale in older[:-1]:  # the last one stays for processes that began before the source was changed
            shutil.rmtree(stale, ignore_errors=True)
        filled = [other / folder.name for other in _list_code_folders() if (other / folder.name).is_dir()]
        if filled:  # such as that of an installation that only its owner can write to
            copy = tempfile.mkdtemp(dir=home)
            shutil.copytree(filled[0], copy, dirs_exist_ok=True)
            try:
                os.replace(copy, folder)
            except OSError:  # another process was faster
                shutil.rmtree(copy)
    return folder


def find_uncompiled() -> set[str]:
    """Names of our compiled functions whose modules have no code on disk."""
    empty = {folder for folder in set(functions.values()) if not any(folder.rglob("*.nbi"))}
    return {name for name, folder in functions.items() if folder in empty}


def take_code(folder: Path, home: Path) -> None:
    """Move the code of functions that has none in `home` there, from the folder that another process made of its own.

    Numba's index of a function's code is moved last, so that other processes find all that it names.
    """
    for index in folder.rglob("*.nbi"):
        target = home.joinpath(*index.relative_to(folder).parts[1:])  # without the name of that process's `code_folder`
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            for data in index.parent.glob(f"{glob.escape(index.stem)}.*.nbc"):
                os.replace(data, target.with_name(data.name))
            os.replace(index, target)


@cache
def digest_of(file: Path) -> str:
    """SHA-256 of a module's source, of our modules that it imports, directly or not, and of Numba's version."""
    text = file.read_text(encoding="utf-8")
    names = sorted(set(_IMPORT.findall(text)))
    files = [_ROOT / f"{name.replace('.', '/')}.py" for name in names]
    parts = [numba.__version__, text, *(digest_of(imported) for imported in files if imported.is_file())]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
