"""One way to compile a numerical kernel, typed."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile with numba, cached on disk; the signature stays visible to the type checker.

    `error_model="numpy"` divides as NumPy does; fast-math stays off, so that results are the same everywhere.
    """
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
