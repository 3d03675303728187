"""Description of the machine that computed a mission, which helps to explain differences between machines."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from threadpoolctl import threadpool_info


@cache
def machine() -> dict[str, str]:
    """The processor, and NumPy's BLAS with its chosen kernels; recordings depend on neither."""
    return {"processor": _processor(), "blas": _blas()}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _blas() -> str:
    every = [library for library in threadpool_info() if library["user_api"] == "blas"]
    # SciPy and OpenCV may each bring their own BLAS.
    found = [library for library in every if "numpy" in library["filepath"]] or every
    names = {f"{b['internal_api']} {b.get('version') or ''} {b.get('architecture') or ''}".strip() for b in found}
    return " and ".join(sorted(names)) or "unknown"


def versions() -> dict[str, str]:
    """Versions of Python and of the packages on which a result depends."""
    packages = ("understory", "pybullet", "numpy", "scipy", "numba", "opencv-python-headless")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}
