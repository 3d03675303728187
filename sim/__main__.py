"""Entry of the command line: `understory COMMAND`, whose commands are functions of `sim.cli`."""

import os
import sys
from collections.abc import Callable

from sim.installation import ROOT

# Our packages come before those of the current folder, so that `python -m sim` never imports the user's by mistake.
sys.path.append(str(ROOT))
sys.path.sort(key=lambda place: os.path.abspath(place) == os.getcwd())

from sim.cli.checks import check_detector, check_planner, check_tracker
from sim.cli.compare import compare
from sim.cli.explain import explain
from sim.cli.recordings import export, frames, replay
from sim.cli.run import run
from sim.cli.start import planners, scenarios, start, studies
from sim.terminal.commands import Command, concluded, new_app

app = new_app()
app.callback(invoke_without_command=True)(start)
COMMANDS: tuple[Callable[..., None], ...] = (
    *(run, compare, frames, replay, explain, export, planners, scenarios, studies),
    *(check_planner, check_detector, check_tracker),
)
for command in COMMANDS:
    app.command(cls=Command)(command)


def main() -> None:
    """Run the command line and exit."""
    concluded(app)


if __name__ == "__main__":
    main()
