"""Commands of the terminal: shared options, help, error messages and exit codes."""

import errno
import faulthandler
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, NamedTuple

import typer
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup

from sim.mission.atomic_files import PlaceTaken, make_part_path
from sim.scenario.quantities import parse_duration
from sim.terminal.console import fail
from tracking.errors import InputError, check_known
from tracking.plugins.plugin_error import PluginError
from tracking.settings import DAY

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # the disk is full or fails
# Places that cannot be written or read.
_NO_PLACE = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG, errno.ELOOP)


_STYLE: Any = {"add_completion": False, "pretty_exceptions_enable": False, "rich_markup_mode": "rich"}

Duration = Annotated[
    str | None, typer.Option(metavar="TIME", help="Simulated time, such as 40, 40s or 1.5min. Default: the scenario's.")
]
Timeout = Annotated[
    str | None, typer.Option(metavar="TIME", help="Wall time after which a mission fails, such as 90 or 5min.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a key of the scenario, such as trees.density=75; repeatable."
    ),
]
Recorded = Annotated[Path, typer.Argument(metavar="DIR", help="A run's folder, or its mission.npz.")]


class Call(NamedTuple):
    """What a command knows beside its arguments, as `typer.Context.obj`."""

    executor: Executor | None
    begun: float  # s


class Command(TyperCommand):
    """A command whose help shows the meaning of a value rather than its Python type."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401 - types that differ between typer's versions
        """Arguments and options."""
        return _hide_types(super().get_params(ctx))

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - as above
        """Print the help; Rich would take units in brackets, [m], for styles and leave them out."""
        for param in self.params:
            param.help = escape(param.help or "")  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - as above
        """Parse the arguments; InputError if an option that may be given once is repeated."""
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        again = [p for i, p in enumerate(given) if p in given[:i] and not p.multiple and p.param_type_name == "option"]
        if again:
            raise InputError(f"{again[0].opts[0]}: given more than once; allowed is once")
        return super().parse_args(ctx, args)


class _Group(TyperGroup):
    """Commands that are imported when they are called; an unknown one is an InputError with the nearest name."""

    targets: Mapping[str, str]  # "module:function" of each command

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401 - types that differ between typer's versions
        """Options of the group."""
        return _hide_types(super().get_params(ctx))

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[Any, Any, list[str]]:  # noqa: ANN401 - as above
        """Name, command and remaining arguments of a call."""
        if args[0].startswith("-"):
            return super().resolve_command(ctx, args)
        check_known("command", args[0], self.commands)
        return args[0], load_command(self.targets[args[0]]), args[1:]


def load_command(target: str) -> Any:  # noqa: ANN401 - a type that differs between typer's versions
    """Import the function "module:function" and make a command of it."""
    module, _, name = target.partition(":")
    return typer.main.get_command(_make_app(getattr(import_module(module), name)))


def make_command_group(start: Callable[..., None], commands: Mapping[str, tuple[str, str]]) -> Any:  # noqa: ANN401 - as above
    """The command line: `start` without a command, and commands by name as "module:function" and a line of help."""
    app = typer.Typer(cls=_Group, **_STYLE)
    app.callback(invoke_without_command=True)(start)
    for name, (_, summary) in commands.items():
        app.command(name, help=summary)(lambda: None)  # for the list of commands only
    group = typer.main.get_command(app)
    group.targets = {name: target for name, (target, _) in commands.items()}  # type: ignore[attr-defined]
    return group


def _hide_types(params: list[Any]) -> list[Any]:
    """Hide the Python type that is shown for a parameter whose value has no name; return the parameters."""
    for param in params:
        if param.param_type_name == "argument" or getattr(param, "is_flag", False):
            param.display_type_rich = lambda ctx: ""
    return params


def merge_overrides(overrides: list[str] | None, duration: str | None) -> list[str]:
    """The overrides together with that of --duration; InputError if a key is given more than once."""
    keys = [override.partition("=")[0].strip() for override in overrides or ()]
    if again := [key for i, key in enumerate(keys) if key in keys[:i]]:
        raise InputError(f"--set: {again[0]} is given more than once; allowed is once")
    if duration is None:
        return list(overrides or ())
    if "duration" in keys:
        raise InputError("--duration: not allowed together with --set duration")
    return [*(overrides or ()), f"duration={parse_duration(duration, '--duration', DAY)}"]


def find_folder(recorded: Path) -> Path:
    """The folder of a recording, given by its folder or its file."""
    return recorded if recorded.is_dir() else recorded.parent


def check_new(path: Path, suffix: str, option: str, *, also: str = "") -> None:
    """InputError unless a new file with this suffix can be written at `path`; a trial write decides."""
    if path.suffix != suffix:
        raise InputError(f"{option}: {str(path)!r} is not allowed; expected a new file that ends in {suffix}{also}")
    part = make_part_path(path)
    try:
        if path.exists():
            raise InputError(f"{option}: {path} exists; name a new file")
        if not path.parent.is_dir():
            raise InputError(f"{option}: {path} cannot be written: there is no folder {path.parent}")
        part.touch()
        part.unlink()
    except OSError as error:
        raise InputError(f"{option}: {path} cannot be written: {error.strerror}") from error


def _make_app(function: Callable[..., None]) -> typer.Typer:
    """A command line of one command."""
    app = typer.Typer(**_STYLE)
    app.command(cls=Command)(function)
    return app


def run_command_line(app: Callable[..., Any], executor: Executor | None = None, begun: float | None = None) -> None:
    """Run a command line. Exit codes: 0 success, 2 wrong input (with a message of one line), 1 any other failure.

    executor: flies the trials of `compare`, in place of processes of this machine. begun: value of `time.perf_counter`
    from which on the command's time counts, by default now.
    """
    call = Call(executor, time.perf_counter() if begun is None else begun)
    sys.path.append(os.getcwd())  # finds plug-ins in the current folder; last, so that they hide no package
    _replace_unknown_characters()
    _take_signals()
    if not faulthandler.is_enabled():
        faulthandler.enable(all_threads=False)  # says in which line a plug-in crashes the process
    try:
        _check_temporary_folder()
        if app(standalone_mode=False, obj=call):  # typer's exit code, which only Ctrl-C makes non-zero
            fail("interrupted; nothing new is kept", code=1)
    except (InputError, PlaceTaken) as error:
        fail(str(error), code=2 if isinstance(error, InputError) else 1)
    except PluginError as error:
        fail(f"{error.with_place}; nothing is kept", code=1)
    except (KeyboardInterrupt, typer.Abort):
        fail("interrupted; nothing new is kept", code=1)
    except OSError as error:
        if error.errno not in (*_NO_ROOM, *_NO_PLACE):
            raise
        code = 1 if error.errno in _NO_ROOM else 2
        fail(f"{error.filename or 'a file'}: {error.strerror}; nothing is kept", code=code)
    except Exception as error:
        # Typer's own errors about arguments have this method; their class differs between its versions.
        if not hasattr(error, "format_message"):
            raise
        fail(error.format_message(), code=2)


def _replace_unknown_characters() -> None:
    """Print ? for a character that the encoding of the terminal does not have, as in ASCII or an old code page."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def _check_temporary_folder() -> None:
    """InputError if there is no temporary folder, which libraries need, too."""
    try:
        tempfile.gettempdir()
    except FileNotFoundError as error:
        raise InputError("TMPDIR: no temporary folder can be written to; name one that can") from error


def _take_signals() -> None:
    """Turn Ctrl-C, and SIGTERM as sent by schedulers, into KeyboardInterrupts without further output."""
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # otherwise the caller ignores or handles it
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    # Half-made objects, such as those of a compiler, would print errors when they are deleted.
    sys.unraisablehook = lambda _: None
    raise KeyboardInterrupt
