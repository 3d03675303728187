"""Fixtures of tests of the documentation."""

import sys

import pytest
from helpers.pages import Shell


@pytest.fixture
def shell(tmp_path, monkeypatch, capsys):
    """The command line and Python of pages, in an empty folder."""
    yield Shell(tmp_path, monkeypatch, capsys)
    # Another page may have modules of the same names.
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]
