"""Imports go one way, and only where they may."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("sim", "planning", "tracking", "assets")
ALLOWED = {"tracking": {"tracking"}, "planning": {"planning", "tracking"}, "assets": {"assets"}, "sim": set(PACKAGES)}
ENGINE = {"sim/world.py", "sim/renderer.py", "sim/opengl.py", "sim/replay/window.py"}
# Of these, matches.py asks what the MWTP makes of plans that were flown.
PLANNING = {
    "sim/autopilot.py",
    "sim/flight.py",
    "sim/mission.py",
    "sim/warmup.py",
    "sim/__main__.py",
    "sim/replay/matches.py",
} | {f"sim/study/{name}.py" for name in ("command", "tasks")}
MODULES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module)
    return names


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("path", MODULES, ids=named)
def test_imports_go_one_way(path):
    tops = {name.split(".")[0] for name in imported(path)}
    name = named(path)
    package = name.split("/")[0]
    assert tops & set(PACKAGES) <= ALLOWED[package]
    assert ("pybullet" in tops) == (name == "sim/engine.py")
    assert ("sim.engine" in imported(path)) == (name in ENGINE)
    if package == "sim" and name not in PLANNING:
        # What a plan is may be known; how plans are made may not.
        assert {n for n in imported(path) if n.startswith("planning")} <= {"planning.planner"}


def test_the_rules_see_the_whole_project():
    assert len(MODULES) > 20


@pytest.mark.parametrize("path", MODULES, ids=named)
def test_files_and_functions_stay_small(path):
    source = path.read_text(encoding="utf-8")
    assert source.count("\n") <= 300
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            first = node.body[1].lineno if ast.get_docstring(node) and len(node.body) > 1 else node.lineno
            assert node.end_lineno - first <= 40, f"{path.name}: {node.name}"


# What chooses its code by processor (BLAS, LAPACK, NumPy's elementary functions, sorting without a stable order, the
# C library's functions) may differ in the last bit. None of it computes on a mission's path.
EXACT = {"inf", "nan", "pi", "tau", "sqrt", "floor", "ceil", "isnan", "isfinite", "isclose", "radians", "prod"}
EXACT |= {"frexp", "factorial", "ldexp"}
DISPATCHED = {"linalg", "dot", "vdot", "matmul", "einsum", "inner", "tensordot", "convolve", "correlate", "cov"}
DISPATCHED |= {"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos"}
DISPATCHED |= {"arctan", "arctan2", "sinh", "cosh", "tanh", "hypot", "power", "float_power", "cbrt", "deg2rad"}
DISPATCHED |= {"radians", "partition", "argpartition", "geomspace", "logspace"}
CHANCE = {"standard_normal", "normal", "exponential", "standard_exponential", "gamma", "multivariate_normal"}
CHANCE |= {
    "poisson",
    "binomial",
    "gumbel",
    "laplace",
    "logistic",
    "lognormal",
    "negative_binomial",
    "rayleigh",
    "standard_t",
}
FOREIGN = {"scipy", "filterpy", "math"}
LIBRARIES = {"scipy.optimize.linear_sum_assignment", "scipy.spatial.cKDTree", "scipy.interpolate.PchipInterpolator"}
# What checks planners, and metrics of finished recordings, compute nothing that a mission flies by.
BESIDE = {"planning/attempt.py", "planning/specimens.py", "planning/conformance.py"}


def path_of_a_mission() -> list[Path]:
    """Every module of ours that `sim.mission` imports, directly or not, as do planners and detectors by name."""
    names = {path: named(path).removesuffix(".py").replace("/", ".") for path in MODULES}
    modules = {name: path for path, name in names.items()}
    todo, found = ["sim.mission", *(n for n in modules if n.startswith("planning.")), "tracking.blob_detector"], set()
    while todo:
        name = todo.pop()
        if name in modules and name not in found:
            found.add(name)
            todo += imported(modules[name])
    return sorted(modules[name] for name in found)


def dispatched(tree: ast.AST) -> list[str]:
    """Names of what a module computes by code that is chosen by processor, with lines."""
    return [f"line {node.lineno}: {what}" for node in ast.walk(tree) if (what := _dispatched(node))]


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
        case ast.Name(id="pow"):
            return "pow"
    return ""


def _named(owner: str, name: str) -> str:
    exact = name in EXACT if owner == "math" else owner != "np" or name not in DISPATCHED
    method = owner != "np" and name in {"dot", "argsort", *CHANCE}
    return f"{owner}.{name}" if method or not exact else ""


def _whole(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


@pytest.mark.parametrize("path", path_of_a_mission(), ids=named)
def test_arithmetic_on_a_missions_path_is_the_same_on_every_processor(path):
    if named(path) not in BESIDE:
        assert dispatched(ast.parse(path.read_text(encoding="utf-8"))) == []


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
    ],
)
def test_the_rule_on_arithmetic_sees_what_depends_on_the_processor(line):
    assert len(dispatched(ast.parse(line))) == 1
