"""Columns as a data frame of pandas or polars."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from tracking.errors import InputError


def make_dataframe(columns: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a frame of pandas or polars, both optional
    """Columns of equal length as a pandas data frame, or a polars one without pandas; InputError without both."""
    for library in ("pandas", "polars"):
        try:
            made = import_module(library).DataFrame
        except (ImportError, AttributeError):  # AttributeError: a folder with the library's name was imported
            continue
        return made(dict(columns))
    raise InputError("tables need pandas or polars; neither is installed: pip install pandas")
