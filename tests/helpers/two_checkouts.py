"""Wall clock and processor time of commands in two checkouts, one after the other in turn.

    git worktree add ../before HEAD~1
    python tests/helpers/two_checkouts.py ../before run --duration 40

The words are those of `understory`; `{out}` among them is a new place for what it writes; else `--out` names that.
The first call in each checkout compiles and does not count. Times are medians; processor time is that of all processes.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parents[2]


class Times(NamedTuple):
    """Times of one call [s]."""

    wall: float
    processor: float


def call(checkout, words, folder):
    """Call a command from a folder where no package hides those of the checkout."""
    named = [word.replace("{out}", str(folder / "out")) for word in words]
    named += [] if named != list(words) or "--help" in words else ["--out", str(folder / "out")]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from sim.__main__ import main; main()"
    command = [sys.executable, "-c", code, str(checkout), *named]
    subprocess.run(
        command, cwd=folder, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(checkout)}
    )
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Times(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main():
    """Print the times of both checkouts and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="the checkout of the commit before")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("words", nargs=argparse.REMAINDER, help="a command of understory")
    asked = parser.parse_args()
    found = {"before": [], "now": []}
    for k in range(asked.rounds + 1):
        for name, checkout in (("before", asked.before.resolve()), ("now", ROOT)):
            with tempfile.TemporaryDirectory() as folder:
                times = call(checkout, asked.words, Path(folder))
            found[name] += [times] * (k > 0)
    before, now = ({f: median(getattr(t, f) for t in own) for f in Times._fields} for own in found.values())
    for field in Times._fields:
        print(f"{field} {before[field]:.2f} s before, {now[field]:.2f} s now, ratio {now[field] / before[field]:.2f}")


if __name__ == "__main__":
    main()
