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
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # neither NUMBA_CACHE_DIR nor our folders nor the user's own can be written to
        not_kept.append(function.__qualname__)
        return cast(Function, numba.njit(error_model="numpy")(function))
