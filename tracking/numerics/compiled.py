"""Decorators that compile numerical functions with Numba and keep the code on disk."""

import gc
import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import event

from tracking.numerics.arrays import Array

Function = TypeVar("Function", bound=Callable[..., Any])

_IMPORT = re.compile(r"^from ((?:tracking|planning|sim)\.[\w.]+) import", re.MULTILINE)

not_kept: list[str] = []  # functions whose compiled code this process cannot write to disk


class _Uncollected(event.Listener):
    """Pauses the garbage collector, which would take an eighth of the time, while code is compiled."""

    def __init__(self) -> None:
        self._depth, self._paused = 0, False

    def on_start(self, _: event.Event) -> None:
        if self._depth == 0:
            self._paused = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, _: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._paused:
            gc.enable()


event.register("numba:compile", _Uncollected())  # type: ignore[no-untyped-call]


def compiled(function: Function) -> Function:
    """Compile with Numba, cached on disk where possible; the signature stays visible to the type checker.

    `error_model="numpy"` divides as NumPy does; fast-math stays off, so that results are the same everywhere.
    """
    return cast(Function, _kept(numba.njit, function, error_model="numpy", no_cfunc_wrapper=True))


def inlined(function: Function) -> Function:
    """As `compiled`, and copied into compiled callers, for functions that take less time than a call."""
    return cast(Function, _kept(numba.njit, function, error_model="numpy", no_cfunc_wrapper=True, forceinline=True))


def elementwise(function: Callable[..., float]) -> Callable[..., Array]:
    """Compile a function of numbers as a NumPy universal function, for arrays that broadcast.

    The function must not be `compiled` as well, because Numba would confuse the two on disk.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # for debugging; vectorize would compile all the same
        return cast("Callable[..., Array]", np.vectorize(function, otypes=[float]))
    return cast("Callable[..., Array]", _kept(numba.vectorize, function))


def _kept(compiler: Callable[..., Any], function: Callable[..., Any], **options: str | bool) -> object:
    """Compile a function and keep its code on disk where possible, as long as its sources stay the same."""
    try:
        made = compiler(cache=True, **options)(function)
    except RuntimeError:  # neither NUMBA_CACHE_DIR nor the folders of code and user can be written to
        not_kept.append(function.__qualname__)
        return compiler(**options)(function)
    if made is function:  # with NUMBA_DISABLE_JIT=1, for debugging
        return made
    # Numba checks only the function's own file, but the code contains functions and constants of other files.
    index = made._cache if hasattr(made, "_cache") else made._dispatcher.cache
    kept = index._cache_file
    kept._source_stamp = (kept._source_stamp, digest_of(Path(function.__code__.co_filename)))
    load = kept._load_index

    def load_index() -> Any:  # noqa: ANN401 - numba's
        try:
            return load()
        except (AttributeError, ImportError):  # code of older sources, with a named tuple that is gone
            return {}

    kept._load_index = load_index
    return made


@cache
def digest_of(file: Path, root: Path = Path(__file__).parents[2]) -> str:
    """SHA-256 of a module's source and of the modules under `root` that it imports, directly or not."""
    text = file.read_text(encoding="utf-8")
    names = sorted(set(_IMPORT.findall(text)))
    files = [root / f"{name.replace('.', '/')}.py" for name in names]
    parts = [text, *(digest_of(imported, root) for imported in files if imported.is_file())]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
