"""The command line, called within the process of a test."""

import sys

from sim import __main__ as cli


def called(arguments, monkeypatch, capsys, executor=None):
    """Exit code, standard output and standard error of `understory` with these arguments; executor: of `compare`."""
    monkeypatch.setattr(sys, "argv", ["understory", *arguments])
    try:
        cli.main(executor)
        code = 0
    except SystemExit as end:
        code = end.code or 0
    captured = capsys.readouterr()
    return code, captured.out, captured.err
