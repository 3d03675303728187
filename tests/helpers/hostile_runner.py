"""Calls commands one by one, each in a process of its own that is forked from this one, where all is loaded.

Reads lines of JSON {"folder", "arguments"}; answers {"code", "seconds", "megabytes"}, code null for what was killed.
"""

import json
import os
import resource
import signal
import sys
import time
import traceback
from pathlib import Path

import cv2

import sim.cli.run_flight  # noqa: F401 - what commands import late is loaded once
from helpers.studies import Serial
from sim import __main__ as cli
from sim.facts.explain import explanation  # noqa: F401
from sim.mission.archive import find_recording  # noqa: F401
from sim.mission.warmup import warm_up
from sim.running import beside, pictures  # noqa: F401
from sim.study.report import terminal  # noqa: F401
from sim.study.trials import get_release
from sim.views import rerun_viewer  # noqa: F401
from sim.views.drawing import redrawn_film  # noqa: F401
from sim.views.page import page  # noqa: F401

SECONDS, BYTES = 20.0, 2 * 2**30


def called(arguments, folder):
    """Call a command in a folder, as its own process would; its exit code."""
    os.setsid()  # so that all it starts can be ended with it
    os.chdir(folder / "in")
    os.environ["TMPDIR"] = str(folder / "tmp")
    os.environ["COLUMNS"] = "80"
    for number, name in enumerate(("/dev/null", folder / "out.txt", folder / "err.txt")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
    resource.setrlimit(resource.RLIMIT_DATA, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sys.argv = ["understory", *arguments]
    try:
        cli.main(Serial())  # processes of a pool take seconds to start
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code


def run(arguments, folder):
    """Result of a command."""
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        os._exit(called(arguments, folder))
    code = None
    while True:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            break
        if time.monotonic() - start > SECONDS:
            os.killpg(child, signal.SIGKILL)
            _, status, used = os.wait4(child, 0)
            break
        time.sleep(0.005)
    return {"code": code, "seconds": time.monotonic() - start, "megabytes": used.ru_maxrss / 1024}


def main():
    cv2.setNumThreads(1)
    beside.count_cores = lambda: 1  # a process beside that of a command takes seconds to start
    if (compiling := os.fork()) == 0:  # its memory would count as that of each command
        warm_up()
        os._exit(0)
    os.waitpid(compiling, 0)
    warm_up()
    get_release()
    print("ready", flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        print(json.dumps(run(asked["arguments"], Path(asked["folder"]))), flush=True)


if __name__ == "__main__":
    main()
