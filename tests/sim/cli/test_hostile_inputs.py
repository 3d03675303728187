"""Whatever a command is given, it ends soon, in results or in one clear line, and what is refused leaves nothing.

`pytest -m slow -s -n 0 tests/sim/cli/test_hostile_inputs.py` tries 2000 inputs and prints how many came to what.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

import pytest
from helpers.hostile_inputs import KINDS, case
from helpers.hostile_runner import BYTES

TESTS = Path(__file__).parents[2]
LANES = 2
LONGEST = 2100  # characters of a refusal
REMARKS = [
    "not used, as ",
    "not used with ",
    "is not a multiple of the",
    "misses will end tracks",
    "tracks will follow",
    "weighs them",
    "a person covers",
    "are times in seconds",
    "few tracks or none",
]
REMARKS += ["another version", "kept, not shown", "not used without", "left out: id", "trees.file: not used"]
ENVIRONMENT = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
ENVIRONMENT["PYTHONPATH"] = os.pathsep.join([str(TESTS.parent), str(TESTS)])


class Runner:
    """A process in which commands are called, started anew where it dies."""

    def __enter__(self):
        command, pipe = [sys.executable, "-m", "helpers.hostile_runner"], subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=os.environ | ENVIRONMENT)
        assert self.process.stdout.readline() == "ready\n"
        return self

    def __exit__(self, *error):
        self.process.stdin.close()
        self.process.wait(timeout=30)

    def run(self, arguments, folder):
        self.process.stdin.write(json.dumps({"arguments": arguments, "folder": str(folder)}) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


def complaints(result, folder, before):
    """Faults in the way a command ended."""
    out, err = ((folder / name).read_text(errors="replace") for name in ("out.txt", "err.txt"))
    lines = [line for line in err.splitlines() if not any(remark in line for remark in REMARKS)]
    after, code = listing(folder), result["code"]
    wrong = {
        f"unfinished after {result['seconds']:.0f} s": code is None,
        f"exit code {code}": code not in (0, 2, None),
        "a traceback": "Traceback" in out + err,
        f"took {result['megabytes']:.0f} MB": result["megabytes"] * 2**20 > BYTES,
        "left what is unfinished": any(name.endswith(".part") or name.startswith("tmp/") for name in after),
        "said what was not asked for": code == 0 and lines,
    }
    if code == 2:
        one = len(lines) == 1 and lines[0].startswith("understory: ") and lines[0].isprintable()
        wrong[f"{len(lines)} lines, or not to be printed"] = not one
        wrong["a line without end"] = max(map(len, lines), default=0) > LONGEST
        wrong[f"left {sorted(after - before)[:3]}, removed {sorted(before - after)[:3]}"] = after != before
    return [text for text, is_so in wrong.items() if is_so]


def listing(folder):
    return {str(path.relative_to(folder)) for top in ("in", "tmp") for path in (folder / top).rglob("*")}


def tried(number, runners, root):
    """End of an input, and the faults in it."""
    asked, folder = case(number), root / str(number)
    for name in ("in", "tmp"):
        (folder / name).mkdir(parents=True)
    asked.make(folder / "in")
    before = listing(folder)
    runner = runners.get()
    try:
        result = runner.run(asked.arguments, folder)
    finally:
        runners.put(runner)
    found = complaints(result, folder, before)
    if found:
        words = [word if len(word) < 200 else f"{word[:100]}...{len(word)}" for word in asked.arguments]
        end = (folder / "err.txt").read_text(errors="replace")[-600:]
        found = [f"input {number}, {asked.kind}: {'; '.join(found)}\n  {words}\n  {end}"]
    shutil.rmtree(folder)
    return asked.kind, result, found


def try_all(numbers, root):
    """Print what inputs came to; the complaints."""
    start, runners = time.monotonic(), SimpleQueue()
    with Runner() as one, Runner() as other, ThreadPoolExecutor(LANES) as threads:
        for runner in (one, other):
            runners.put(runner)
        ended = list(threads.map(lambda number: tried(number, runners, root), numbers))
    counts = Counter((kind, result["code"]) for kind, result, _ in ended)
    for kind in KINDS:
        done = {code: counts[kind, code] for code in sorted({c for k, c in counts if k == kind}, key=str)}
        print(f"\n{kind}: exit codes {done}", end="")
    slowest, largest = (max(result[name] for _, result, _ in ended) for name in ("seconds", "megabytes"))
    print(f"\n{len(ended)} inputs, {time.monotonic() - start:.0f} s; at most {slowest:.1f} s and {largest:.0f} MB each")
    return [complaint for *_, found in ended for complaint in found]


@pytest.mark.slow
def test_two_thousand_hostile_inputs_end_soon_in_results_or_one_clear_line(tmp_path):
    found = try_all(range(2000), tmp_path)
    assert not found, "\n".join([f"{len(found)} of 2000 inputs", *found])
