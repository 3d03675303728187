"""Lets the reference show the comments on fields of dataclasses, where their units and shapes stand."""

import sys
from pathlib import Path
from typing import Any

import griffe

sys.path.append(str(Path(__file__).parent))
from generate import field_comment


class FieldComments(griffe.Extension):
    """Takes the comment on a field for its docstring."""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:  # noqa: ANN401 - whatever Griffe adds
        """Give a field without a docstring its comment."""
        if attr.docstring is None and isinstance(attr.parent, griffe.Class) and isinstance(attr.filepath, Path):
            lines = attr.filepath.read_text(encoding="utf-8").splitlines()
            text = field_comment(lines, attr.lineno or 1, attr.endlineno or 1)
            attr.docstring = griffe.Docstring(text, parent=attr) if text else None
