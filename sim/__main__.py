"""Entry of the command line: `understory COMMAND`. The commands are functions of `sim.cli`."""

import gc
import os
import sys
from concurrent.futures import Executor

from sim.installation import ROOT

# Our packages come before those of the current folder, so that `python -m sim` never imports the user's by mistake.
sys.path.append(str(ROOT))
sys.path.sort(key=lambda place: os.path.abspath(place) == os.getcwd())

from sim.cli.start import start
from sim.mission.stopwatch import find_process_start
from sim.terminal.commands import make_command_group, run_command_line

# Function of each command, and its line in the list of commands. A command's module is imported when it is called:
# all of them together take two seconds.
COMMANDS = {
    "run": ("sim.cli.run:run", "Fly one mission: recording, summary, film, page, OSPA curve and timeline."),
    "compare": ("sim.cli.compare:compare", "Compare planners or trackers on the same forests, people and seeds."),
    "track": ("sim.cli.track:track", "Track people in a flight from elsewhere, by its poses and detections."),
    "frames": ("sim.cli.frames:frames", "Render frames of a recorded mission again, annotated."),
    "replay": ("sim.cli.replay:replay", "Show a recorded mission again: film, page, 3-D window or Rerun viewer."),
    "explain": ("sim.cli.explain:explain", "Say when and why people were lost, or how a track came about."),
    "export": ("sim.cli.export:export", "Write missions for other tools, as tables or labelled images."),
    "planners": ("sim.cli.lists:planners", "List the planners with their meanings, packages and options."),
    "scenarios": ("sim.cli.lists:scenarios", "List the packaged scenarios."),
    "studies": ("sim.cli.lists:studies", "List the packaged studies."),
    "check-planner": ("sim.cli.checks:check_planner", "Check that a planner keeps the rules for planners."),
    "check-detector": ("sim.cli.checks:check_detector", "Check that a detector keeps the rules for detectors."),
    "check-mapper": ("sim.cli.checks:check_mapper", "Check that a mapper of trees keeps the rules for mappers."),
    "check-tracker": ("sim.cli.checks:check_tracker", "Check that a tracker keeps the rules for trackers."),
}
app = make_command_group(start, COMMANDS)


def main(executor: Executor | None = None) -> None:
    """Run the command line and exit; executor: flies the trials of `compare`, by default processes of this machine."""
    gc.set_threshold(50_000)  # imports make many objects that stay; to walk over them again and again took 0.2 s
    ours = getattr(sys.modules["__main__"], "main", None) is main  # else the process has done other things before
    begun = find_process_start() if ours else None
    run_command_line(app, executor, begun)


if __name__ == "__main__":
    main()
