"""Description of the machine that computed a mission, which helps to explain differences between machines."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path


@cache
def describe_machine() -> dict[str, str]:
    """The processor, on which times depend and recordings do not."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {"processor": names[0] if names else platform.processor() or platform.machine()}


def list_versions() -> dict[str, str]:
    """Versions of Python and of the packages on which a result depends."""
    packages = ("understory", "pybullet", "numpy", "scipy", "numba", "opencv-python-headless")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}
