"""Other people's classes, by import string."""

from __future__ import annotations

import importlib
from typing import Any


def imported(target: str) -> Any:  # noqa: ANN401 - whatever a user's module holds
    """The class "package.module:Class" names; ImportError says in one line why there is none.

    Importing runs the module, which may fail in any way.
    """
    module, _, attribute = target.partition(":")
    if not all(part.isidentifier() for part in module.split(".")):
        raise ImportError(f"{module!r} is not the name of a module")
    try:
        found = getattr(importlib.import_module(module), attribute, None)
    except ImportError:
        raise
    except (Exception, SystemExit) as error:
        raise ImportError(f"{type(error).__name__}: {error}") from error
    if not callable(found):
        raise ImportError(f"{module} has no class {attribute!r}")
    return found
