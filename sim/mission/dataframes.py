"""Columns as a data frame of pandas or polars, or as a Parquet file."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
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


def write_parquet(columns: Mapping[str, Any], path: Path) -> None:
    """Write columns of equal length as a Parquet file; InputError without pandas with pyarrow, or polars."""
    frame = make_dataframe(columns)
    try:
        (frame.to_parquet if hasattr(frame, "to_parquet") else frame.write_parquet)(path)
    except ImportError as error:
        raise InputError("parquet: needs pandas with pyarrow, or polars: pip install pyarrow") from error
