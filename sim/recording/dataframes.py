"""Columns as a data frame of whichever library there is."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from tracking.plugins.registry import InputError


def dataframe(columns: Mapping[str, Any]) -> Any:  # noqa: ANN401 - pandas' or polars', of which neither is needed otherwise
    """Columns of equal length as a pandas frame, or a polars one where there is no pandas; InputError without both."""
    for library in ("pandas", "polars"):
        try:
            made = import_module(library).DataFrame
        except (ImportError, AttributeError):  # the latter of a folder of that name
            continue
        return made(dict(columns))
    raise InputError("tables need pandas or polars; neither is installed: pip install pandas")
