"""Plug-ins that do what plug-ins must not: by a line of claim, their code, the exit code and what is said."""

PLANNER = "--planner hostile:Mine --duration 2 --set sensing.mode=ideal"
DETECTOR = "--set sensing.detector=hostile:Mine --planner hover --duration 0.4"
HEAD = """
import os, signal, subprocess, sys, threading, time, warnings
from types import SimpleNamespace
import numpy as np
from planning.planner import Exchange, Plan
from tracking.detection.detector import Detections
still = lambda team: [Plan(np.zeros((1, 2))) for _ in team]
one = lambda **given: Detections(**{**dict(pixels=[[9, 9]], ground=[[1, 1]], covariances=[[[1, 0], [0, 1]]]), **given})
class Mute(Exception):
    def __str__(self): raise RuntimeError
class Silent(Mute):
    __repr__ = Mute.__str__
class Base(BaseException): pass
class Raising:
    def __getattr__(self, name): raise RuntimeError("asked for " + name)
"""
LAST = "return still(team)"


def planner(*lines: str) -> str:
    """A planner by the lines of its method."""
    return "\n        ".join(["class Mine:\n    def plan(self, team, rng):", *lines]) + "\n"


def detector(*lines: str) -> str:
    """A detector by the lines of its method."""
    return "\n        ".join(["class Mine:\n    def detect(self, frame):", *lines]) + "\n"


def made(code: str):
    """The plug-in of some code."""
    names = {}
    exec(compile(HEAD + code, "hostile.py", "exec"), names)
    return names["Mine"]()


def flies(controls: str) -> str:
    """A planner that gives every UAV these controls."""
    return planner(f"return [Plan({controls}) for _ in team]")


# Missions that end with 0, and what a fault in summary.json says; nothing: there is none.
FLOWN = {
    "a planner raises": (planner("raise KeyError('gone')"), "KeyError: 'gone'"),
    "a planner calls sys.exit": (planner("sys.exit(0)"), "SystemExit: 0"),
    "a planner raises a BaseException": (planner("raise Base('out')"), "Base: out"),
    "a planner raises GeneratorExit": (planner("raise GeneratorExit"), "GeneratorExit"),
    "an exception's __str__ raises": (planner("raise Mute"), "Mute: what it says cannot be read"),
    "an exception's __repr__ raises as well": (planner("raise Silent"), "Silent: what it says cannot be read"),
    "an exception says a million lines": (planner("raise ValueError('ab\\n' * 10**6)"), "ValueError: ab ab"),
    "an exception clears the screen": (planner("raise ValueError('\\x1b[2J\\ud800[/red]')"), "ValueError: [2J [/red]"),
    "a planner calls itself for ever": (planner("return self.plan(team, rng)"), "RecursionError"),
    "a planner asks for a keyboard": (planner("input()"), "EOFError"),
    "a planner wants more memory than there is": (planner("return np.ones(10**12)"), "MemoryError"),
    "controls of 10**400": (flies("[[10**400, 0]]"), "controls are not finite"),
    "controls of 1e308": (flies("[[1e308, 1e308]]"), "speed inf m/s exceeds 5 m/s"),
    "complex controls": (flies("np.ones((1, 2)) * 1j"), "controls are not numbers"),
    "controls in words": (flies("[['1', '2']]"), "controls are not numbers"),
    "controls in one row": (flies("[1, 2]"), "shape"),
    "a plan of no steps": (flies("np.zeros((0, 2))"), "shape"),
    "words in place of plans": (planner("return ['north', None, 'south']"), "it is no Plan but of type "),
    "controls that are a dictionary": (flies("{1: 2}"), "controls are not numbers"),
    "controls that hold themselves": (planner("a = []", "a += [a, a]", "return [Plan(a)] * len(team)"), "not numbers"),
    "controls of ragged rows": (flies("[[1, 2], [3]]"), "controls are not numbers"),
    "a plan of millions of steps": (flies("np.zeros((3_000_000, 2))"), "more than 2000 numbers"),
    "a plan of a trillion steps": (flies("np.broadcast_to(0.0, (10**12, 2))"), "more than 2000 numbers"),
    "a plan as long as a range": (flies("[range(10**12), range(10**12)]"), "more than 2000 numbers"),
    "a property of a plan raises": (planner("return [Raising() for _ in team]"), "RuntimeError: asked for"),
    "numbers raise when they are read": (flies("[[Raising(), 0]]"), "RuntimeError: asked for"),
    "plans without end": (planner("while True:", "    yield still(team)[0]"), "more than 3 plans for 3 UAVs"),
    "plans of a generator that raises": (planner("yield still(team)[0]", "raise Base('midway')"), "Base: midway"),
    "a number in place of plans": (planner("return 3"), "TypeError: 'int' object is not iterable"),
    "others without end": (
        "class Endless(dict):\n    def items(self):\n        while True: yield 0, [[0, 0]]\n"
        + planner("return [Plan([[0, 0]], Endless()) for _ in team]"),
        "others has more than 1000 entries",
    ),
    "names of others that cannot be shown": (
        planner("return [Plan([[0, 0]], {type('X', (), {'__repr__': Mute.__str__})(): 1}) for _ in team]"),
        "RuntimeError",
    ),
    "a frozen vehicle is made faster": (
        planner(
            "for s in team: object.__setattr__(s.own, 'max_speed', 141.0)", "return [Plan([[100, 100]]) for _ in team]"
        ),
        "speed 141 m/s exceeds 5 m/s",
    ),
    "the team is emptied": (planner("team.clear()", LAST), "0 plans for 3 UAVs"),
    "everything in a situation is overwritten": (
        planner(
            "for s in team:",
            "    for t in s.tracks: t.belief.mean[:] = t.belief.covariance[:] = np.nan",
            "    s.own.position[:] = s.forest.cylinders[:] = s.motion.Q[:] = np.nan",
            "    object.__setattr__(s.own.camera, 'fov', 'wide')",
            "    object.__setattr__(s, 'own', None)",
            LAST,
        ),
        "",
    ),
    "what NumPy does about overflows is changed": (planner("np.seterr(all='raise')", LAST), ""),
    "all warnings become errors": (planner("warnings.simplefilter('error')", LAST), ""),
    "calls may no longer be deep": (planner("sys.setrecursionlimit(150)", LAST), ""),
    "threads without end": (planner("threading.Thread(target=time.sleep, args=(1e6,)).start()", LAST), ""),
    "processes without end": (planner("subprocess.Popen(['sleep', '1000'])", LAST), ""),
    "a planner forks": (planner("os.fork()", LAST), ""),
    "the folder is left": (planner("os.chdir('/')", LAST), ""),
    "standard output is closed": (planner("sys.stdout.close()", "sys.stderr.close()", LAST), ""),
}

# What ends with another exit code, and what its one line says.
REFUSED = {
    "a constructor raises": ("class Mine:\n    def __init__(self): raise Base('no')", 2, "cannot be made: Base: no"),
    "a constructor calls sys.exit": ("class Mine:\n    def __init__(self): sys.exit(0)", 2, "made: SystemExit: 0"),
    "a module raises a BaseException": ("raise Base('no')", 2, "cannot be imported: Base: no"),
    "plan is a property that raises": (
        "class Mine:\n    @property\n    def plan(self): raise Mute",
        2,
        "cannot be made: Mute: what it says cannot be read",
    ),
    "knowing is 3": ("class Mine:\n    knowing = 3\n    def plan(self, team, rng): return []", 2, "`knowing`: 'int'"),
    "knowing tells of nothing": (
        "class Mine:\n    def knowing(self, people): return 3\n    def plan(self, team, rng): return []",
        2,
        "what it returns has no method plan(team, rng)",
    ),
    "exchange is a property that raises": (
        "class Mine:\n    exchange = property(Mute.__str__)\n    def plan(self, team, rng): return []",
        2,
        "cannot say what it sends: RuntimeError",
    ),
    "a trillion rounds of exchange": (
        "class Mine:\n    exchange = Exchange()\n    def plan(self, team, rng): return []\n"
        "object.__setattr__(Mine.exchange, 'rounds', 10**12)",
        2,
        "rounds must be at most 1000",
    ),
    "a module ends the process": (
        "os._exit(0)",
        1,
        "before its first scan was complete: the process it ran in ended by itself",
    ),
    "a planner ends the process": (planner("os._exit(0)"), 1, "ended by itself, with exit code 0; nothing is kept"),
    "a planner crashes": (planner("os.kill(os.getpid(), signal.SIGSEGV)"), 1, "was killed by SIGSEGV"),
    "a planner hangs": (planner("while True: pass"), 1, "took longer than the timeout of 10 s; nothing is kept"),
    "a planner sleeps and lets nothing wake it": (
        planner("while True:", "    try: time.sleep(1e6)", "    except BaseException: pass"),
        1,
        "took longer than the timeout",
    ),
    "a constructor hangs": ("class Mine:\n    def __init__(self): time.sleep(1e6)", 1, "took longer than the timeout"),
    "a planner presses Ctrl-C": (planner("raise KeyboardInterrupt"), 1, "interrupted; nothing new is kept"),
}

DETECTED = {
    "a detector raises": (detector("raise KeyError('gone')"), "detector: KeyError: 'gone'"),
    "a detector calls sys.exit": (detector("sys.exit(3)"), "detector: SystemExit: 3"),
    "a detector raises a BaseException": (detector("raise Base('out')"), "detector: Base: out"),
    "20 000 detections": (detector("return one(ground=np.zeros((20_000, 2)))"), "ground are more than 400 numbers"),
    "a trillion detections": (
        detector("return one(ground=np.broadcast_to(0.0, (10**12, 2)))"),
        "more than 400 numbers",
    ),
    "detections at 10**400": (detector("return one(ground=[[10**400, 0]])"), "ground are not finite"),
    "complex covariances": (detector("return one(covariances=np.ones((1, 2, 2)) * 1j)"), "covariances are not numbers"),
    "detections' properties raise": (detector("return Raising()"), "detector: RuntimeError: asked for"),
    "a frame's camera is changed": (
        detector("object.__setattr__(frame.camera, 'fov', 'wide')", "frame.pose.position[:] = 1e9", "return one()"),
        "",
    ),
}
UNDETECTED = {
    "a detector's constructor raises": (
        "class Mine:\n    def __init__(self): raise KeyError('weights')",
        2,
        "sensing.detector: 'hostile:Mine' cannot be made: KeyError: 'weights'",
    ),
    "a detector's constructor calls sys.exit": (
        "class Mine:\n    def __init__(self): sys.exit(0)",
        2,
        "cannot be made: SystemExit: 0",
    ),
    "a detector ends the process": (detector("os._exit(7)"), 1, "ended by itself, with exit code 7"),
    "a detector hangs": (detector("while True: pass"), 1, "took longer than the timeout of 10 s"),
}
