"""Imports go one way, and only where they may."""

import ast
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("sim", "planning", "tracking", "assets")
# Rooms of each package from the ground up: what stands in one imports only from it and from those below it.
LAYERS = {
    "tracking": (
        *(
            "errors",
            "settings",
            "numerics",
            "navigation",
            "plugins",
            "geometry",
            "filter",
            "detection",
            "mapping",
            "parameters",
            "track",
            "testing",
            "registration",
        ),
        *("association", "measurement_update", "account", "management", "fusion", "fleet_scan", "metrics", "tracker"),
        "undetected",
    ),
    "planning": (
        *("planner", "catalogue", "planner_loading", "options", "prediction", "objective", "optimizers"),
        *("coordination", "composed", "baselines", "rivals", "oracle", "testing", "planner_check"),
    ),
    "sim": (
        *("installation", "scenario", "processes", "world", "sensing", "mission", "facts.metrics", "facts"),
        *("facts.explain", "views", "views.drawing", "views.frames", "views.page", "exchange"),
        *("running", "terminal", "study", "study.analysis", "study.report.figures", "study.report"),
        *("environments", "cli", "__main__"),
    ),
}
BELOW = {"tracking": {"tracking"}, "planning": {"planning", "tracking"}, "assets": {"assets"}}
BELOW["sim"] = {"sim", "planning", "tracking"}
ENGINE = {"world", "bodies", "opengl", "renderer", "shown_bodies", "window"}
# Of these, planned_path.py asks where plans that were flown lead, and teammates.py where they have brought a UAV
# out of contact.
PLANNING = {
    "sim/mission/plan_check.py",
    "sim/mission/teammates.py",
    "sim/mission/mission.py",
    "sim/mission/compilation.py",
    "sim/mission/warmup.py",
    "sim/running/fly.py",
    "sim/running/results.py",
    "sim/study/analysis/labels.py",
    "sim/study/analysis/normalised_score.py",
    "sim/study/cells.py",
    "sim/cli/run.py",
    "sim/cli/checks.py",
    "sim/cli/compare.py",
    "sim/cli/lists.py",
    "sim/facts/planned_path.py",
    "sim/study/trials.py",
}
# A recorded mission has figures, which are imported when they are asked for: the one arrow that points up.
UPWARD = {"sim/facts/flight.py": "views"}
MODULES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))
INTERFACE = ROOT / "understory.py"  # names what users import, and stands above all packages


@cache
def parsed(path: Path) -> tuple[str, ast.Module, tuple[ast.AST, ...]]:
    """Text, syntax tree and all nodes of a file."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return text, tree, tuple(ast.walk(tree))


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """Syntax trees do not outlast these tests: the garbage collector would walk over them in all that follow."""
    yield
    parsed.cache_clear()


@cache
def imported(path: Path) -> set[str]:
    names = set()
    for node in parsed(path)[2]:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module)
    return names


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def room(module: str) -> tuple[str, str]:
    """Package and room of a dotted module; a module that stands in a package itself is a room of its own."""
    package, _, rest = module.partition(".")
    return package, rest if rest in LAYERS.get(package, ()) else rest.rpartition(".")[0]


def modules_imported(path: Path) -> set[str]:
    """Our modules that a file imports, by dotted names."""
    found = set()
    for node in parsed(path)[2]:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = ROOT.joinpath(*node.module.split("."), f"{alias.name}.py")
                found.add(f"{node.module}.{alias.name}" if inner.is_file() else node.module)
    return {name for name in found if name.split(".")[0] in LAYERS}


def test_imports_go_down_the_layers():
    for path in MODULES:
        assert INTERFACE.stem not in {name.split(".")[0] for name in imported(path)}, named(path)
        package, own = room(named(path).removesuffix(".py").removesuffix("/__init__").replace("/", "."))
        for module in modules_imported(path):
            other, below = room(module)
            assert other in BELOW[package], f"{named(path)} imports {module}"
            if other == package and below.split(".")[0] != UPWARD.get(named(path)):
                order = LAYERS[package]
                assert order.index(below) <= order.index(own), f"{named(path)} imports {module}"


def test_messages_round_numbers_without_exponents():
    """A format such as .3g writes 1080 as 1.08e+03, which `tracking.errors.spell` does not."""
    for path in [*MODULES, INTERFACE]:
        assert not re.search(r":[-+]?\.[1-5]g\}", parsed(path)[0]), named(path)


def test_the_layers_name_every_room():
    there = {room(named(path).removesuffix(".py").replace("/", ".")) for path in MODULES if path.name != "__init__.py"}
    assert {(p, r) for p, r in there if p in LAYERS} == {(p, r) for p, order in LAYERS.items() for r in order}


def test_engine_and_planners_are_known_only_where_they_must_be():
    for path in MODULES:
        tops, name = {module.split(".")[0] for module in imported(path)}, named(path)
        assert ("pybullet" in tops) == (name == "sim/world/engine.py"), name
        assert ("sim.world.engine" in imported(path)) == (path.stem in ENGINE and name.startswith("sim/")), name
        if name.startswith("sim/") and name not in PLANNING:
            # What a plan is may be known; how plans are made may not.
            assert {n for n in imported(path) if n.startswith("planning")} <= {"planning.planner"}, name


# What chooses its code by processor (BLAS, LAPACK, NumPy's elementary functions, sorting without a stable order, the
# C library's functions) may differ in the last bit. None of it computes on a mission's path.
EXACT = {"inf", "nan", "pi", "tau", "sqrt", "floor", "ceil", "isnan", "isfinite", "isclose", "radians", "prod"}
EXACT |= {"copysign", "frexp", "factorial", "ldexp", "fsum"}
DISPATCHED = {"linalg", "dot", "vdot", "matmul", "einsum", "inner", "tensordot", "convolve", "correlate", "cov"}
DISPATCHED |= {"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos"}
DISPATCHED |= {"arctan", "arctan2", "sinh", "cosh", "tanh", "hypot", "power", "float_power", "cbrt", "deg2rad"}
DISPATCHED |= {"radians", "partition", "argpartition", "geomspace", "logspace"}
CHANCE = {"standard_normal", "normal", "exponential", "standard_exponential", "gamma", "multivariate_normal"}
CHANCE |= {"poisson", "binomial", "gumbel", "laplace", "logistic", "lognormal", "negative_binomial", "rayleigh"}
CHANCE |= {"standard_t"}
FOREIGN = {"scipy", "math"}
LIBRARIES = {"scipy.optimize.linear_sum_assignment", "scipy.spatial.cKDTree", "scipy.interpolate.PchipInterpolator"}
# What checks planners, and metrics of finished recordings, compute nothing that a mission flies by.
BESIDE = {"planning/testing/made_up_teams.py", "planning/planner_check.py"}


def path_of_a_mission() -> list[Path]:
    """Every module of ours that the mission loop imports, directly or not, as do planners and detectors by name."""
    names = {path: named(path).removesuffix(".py").replace("/", ".") for path in MODULES}
    modules = {name: path for path, name in names.items()}
    todo = ["sim.mission.mission", "tracking.detection.blob_detector"]
    todo, found = todo + [n for n in modules if n.startswith("planning.")], set()
    while todo:
        name = todo.pop()
        if name in modules and name not in found:
            found.add(name)
            todo += imported(modules[name])
    return sorted(modules[name] for name in found)


def dispatched(nodes: Iterable[ast.AST]) -> list[str]:
    """Names of what a module computes by code that is chosen by processor, with lines."""
    return [f"line {node.lineno}: {what}" for node in nodes if (what := _dispatched(node))]


def _dispatched(node: ast.AST) -> str:
    match node:
        case ast.BinOp(op=ast.MatMult()):
            return "@"
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            return "" if _whole(left) and _whole(right) else "**, which calls the C library for plain numbers"
        case ast.Call(func=ast.Attribute(value=ast.Name(id="np"), attr="argsort"), keywords=keywords):
            return "" if any(k.arg == "kind" for k in keywords) else "argsort without kind='stable'"
        case ast.Attribute(value=value, attr=name):
            return _named(value.id if isinstance(value, ast.Name) else "", name)
        case ast.ImportFrom(module=str(module), names=names) if module.split(".")[0] in FOREIGN:
            return ", ".join(f"{module}.{a.name}" for a in names if f"{module}.{a.name}" not in LIBRARIES)
        case ast.Import(names=names):
            return ", ".join(a.name for a in names if a.name.split(".")[0] in FOREIGN - {"math"})
    return _built_in(node)


def _built_in(node: ast.AST) -> str:
    match node:
        case ast.Name(id="pow"):
            return "pow"
        case ast.Name(id="sum"):
            return "sum, which since Python 3.12 adds real numbers with compensation; math.fsum rounds them once"
    return ""


def _named(owner: str, name: str) -> str:
    exact = name in EXACT if owner == "math" else owner != "np" or name not in DISPATCHED
    method = owner != "np" and name in {"dot", "argsort", *CHANCE}
    return f"{owner}.{name}" if method or not exact else ""


def _whole(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def test_arithmetic_on_a_missions_path_is_the_same_on_every_processor():
    for path in path_of_a_mission():
        assert named(path) in BESIDE or dispatched(parsed(path)[2]) == [], named(path)


@pytest.mark.parametrize(
    "line",
    [
        "x = A @ B",
        "x = y**2",
        "x = 2.0**y",
        "x = np.exp(y)",
        "x = np.linalg.inv(y)",
        "x = math.atan2(y, z)",
        "x = rng.standard_normal(3)",
        "x = np.argsort(y)",
        "x = y.dot(z)",
        "x = y.argsort()",
        "from scipy.special import ndtr",
        "from math import exp",
        "import scipy.linalg as la",
        "x = pow(y, 0.3)",
        "x = sum(y)",
        "x = sum((each.cost for each in y), 0.0)",
    ],
)
def test_the_rule_on_arithmetic_sees_what_depends_on_the_processor(line):
    assert len(dispatched(ast.walk(ast.parse(line)))) == 1
