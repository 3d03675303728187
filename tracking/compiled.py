"""One way to compile a numerical kernel, typed."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

not_kept: list[str] = []  # functions whose compiled code this process cannot write anywhere


def compiled(function: Function) -> Function:
    """Compile with numba, cached on disk where that can be; the signature stays visible to the type checker.

    `error_model="numpy"` divides as NumPy does; fast-math stays off, so that results are the same everywhere.
    """
    return cast(Function, _kept(numba.njit, function, error_model="numpy"))


def elementwise(function: Callable[..., float]) -> Callable[..., Array]:
    """Compile a function of numbers for arrays that broadcast, as a universal function of NumPy's.

    A function of its own, not one that is `compiled` too: on disk numba would take one for the other.
    """
    return cast("Callable[..., Array]", _kept(numba.vectorize, function))


def _kept(compiler: Callable[..., Any], function: Callable[..., Any], **options: str) -> object:
    """Compile a function and keep its code on disk where that can be."""
    try:
        return compiler(cache=True, **options)(function)
    except RuntimeError:  # neither NUMBA_CACHE_DIR nor our folders nor the user's own can be written to
        not_kept.append(function.__qualname__)
        return compiler(**options)(function)
