"""Fly the same missions as other processors would and print their hashes: `python tests/helpers/reproducibility.py`.

Environment variables make BLAS, NumPy, OpenCV, numba and the C library choose the code that they keep for other
processors. `--short` flies one short mission; further interpreters, each with understory installed with other versions
of its dependencies, are named by `--python PATH`.
"""

import argparse
import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KERNELS = ("Haswell", "Zen", "SkylakeX", "SandyBridge", "Nehalem", "Prescott")
# Groups have had several names.
_NUMPY = "AVX512F AVX512CD AVX512_KNL AVX512_KNM AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4"
_OPENCV = "AVX512-SKX,AVX512-COMMON,AVX512-CNL,AVX512-CLX,AVX512-ICL,AVX2,FMA3,AVX,FP16"
_GLIBC = "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-AVX2,-AVX2_Usable,-FMA,-FMA_Usable,-FMA4"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
_OTHER = {"PYTHONHASHSEED": "7", "LC_ALL": "C.UTF-8", "LANG": "tr_TR.UTF-8", "TZ": "Pacific/Apia"}

VARIANTS: dict[str, dict[str, str]] = {
    "this processor": {},
    **{f"OpenBLAS for {kernel}": {"OPENBLAS_CORETYPE": kernel} for kernel in KERNELS},
    "NumPy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": _NUMPY},
    "NumPy without AVX-512 and AVX2": {"NPY_DISABLE_CPU_FEATURES": f"{_NUMPY} AVX2 FMA3 X86_V3 AVX F16C"},
    "OpenCV without AVX-512 and AVX2": {"OPENCV_CPU_DISABLE": _OPENCV},
    "C library without AVX2 and FMA": {"GLIBC_TUNABLES": _GLIBC},
    "numba for any x86-64": {"NUMBA_CPU_NAME": "generic"},
    **{f"{count} threads": dict.fromkeys(_THREADS, str(count)) for count in (1, 2, 8)},
    "other hash seed, locale and time zone": _OTHER,
}
# Lenses that bend, one of them believed to be another, with rolling shutters, one on a body that turns.
_LENSES = (
    *("uavs.0.camera=mavic-3e", "uavs.0.camera.scale=0.04", "uavs.0.camera.readout=0.03", "uavs.0.mount=body"),
    *(
        "uavs.0.camera.believed.distortion=[-0.1, 0.01, 0.001, -0.001, -0.02]",
        "uavs.0.camera.believed.focal=[3700, 3720]",
    ),
    *("uavs.1.camera=thermal-640", "uavs.1.camera.scale=0.25", "uavs.1.camera.readout=0.05", "uavs.1.tilt_deg=20"),
)
_ERRORS = (
    *(f"uavs.{i}.navigation={name}" for i, name in enumerate(("consumer", "gnss", "rtk"))),
    *("sensing.noise=camera", "sensing.false_alarms=0.2", "wind.gust=1.5"),
)
_SETTINGS: dict[str, tuple[int, tuple[str, ...]]] = {
    "seed 0": (0, ()),
    "seed 1": (1, ()),
    "seed 2": (2, ()),
    "camera noise": (3, ("sensing.noise=camera",)),
    "m of n": (4, ("tracking.management=m_of_n",)),
    "kla": (5, ("network.fusion=kla",)),
    "unknown tracks": (6, ("tracking.initial_tracks=none",)),
    "body-fixed, wind": (7, ("wind.gust=1.5", "wind.velocity=[3, 1]", "uavs.0.mount=body")),
    "late messages": (
        8,
        ("network.delay=0.3", "network.jitter=0.5", "network.rate=3000", "network.loss=0.2", "network.hold=1.5"),
    ),
    "all that errs": (9, (*_LENSES, *_ERRORS, "network.delay=0.2", "network.jitter=0.3", "network.rate=5000")),
}
SHORT = ("seed 0", 6.0)  # mission and its duration [s]
IMAGES = {
    "images": ("duration=2", "appearance=full"),
    "images through lenses": ("duration=2", "appearance=full", *_LENSES),
}
# Last come the images themselves, of short missions.
_FLY = """
import hashlib, json, sys
from planning.planner_loading import load_planner
from planning.catalogue import DEFAULT_PLANNER
from sim.scenario.loading import load_scenario
from sim.mission.mission import Mission
from sim.study.trials import StudyTrial, get_release
from sim.study.trial_flight import fly_trial
missions, images = json.loads(sys.argv[1])
for seed, overrides in missions:
    setting = load_scenario("forest", overrides)
    row = fly_trial(StudyTrial(key="", setting=setting, planner=DEFAULT_PLANNER, seed=seed, version=get_release())).row
    print(row.recording or sys.exit(row.error))
for overrides in images:
    mission = Mission(load_scenario("forest", overrides), load_planner(DEFAULT_PLANNER))
    digest = hashlib.sha256()
    for _ in mission.fly():
        for frame in mission.images:
            digest.update(frame)
    print(digest.hexdigest())
"""


def hashes(python: str, missions: Sequence[str], *, duration: float = 40.0, **environment: str) -> list[str]:
    """SHA-256 of missions' recordings, then those of images, by an interpreter in its own environment and folder."""
    paths = {"PYTHONPATH": str(ROOT)} if python == sys.executable else {}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [python, "-c", _FLY, _wanted(missions, duration)],
            cwd=folder,
            env={**os.environ, **paths, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        raise RuntimeError(f"{python} in {environment} did not fly:\n{done.stderr[-2000:]}")
    return done.stdout.split()


def hashes_here(missions: Sequence[str], *, duration: float = 40.0) -> list[str]:
    """The same in this process, which has imported and compiled all that flies."""
    before, said = sys.argv, io.StringIO()
    sys.argv = ["", _wanted(missions, duration)]
    try:
        with redirect_stdout(said):
            exec(_FLY, {})
    finally:
        sys.argv = before
    return said.getvalue().split()


def _wanted(missions: Sequence[str], duration: float) -> str:
    """Seeds and settings of missions, and settings of those whose images count, as JSON."""
    found = (_SETTINGS[name] for name in missions)
    flown = [(seed, [f"duration={duration}", *overrides]) for seed, overrides in found]
    return json.dumps([flown, list(IMAGES.values())])


def main() -> int:
    """Print a table of hashes, a row a variant; 0 if each column has one hash."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--python", action="append", default=[])
    parser.add_argument("--only", action="append", choices=VARIANTS, default=[])
    arguments = parser.parse_args()
    missions = [SHORT[0]] if arguments.short else list(_SETTINGS)
    duration = SHORT[1] if arguments.short else 40.0
    rows = {name: (sys.executable, VARIANTS[name]) for name in arguments.only or VARIANTS}
    rows |= {python: (python, {}) for python in arguments.python}
    columns = [*missions, *IMAGES]
    print(f"| variant | {' | '.join(columns)} |\n|{'---|' * (len(columns) + 1)}")
    seen: dict[str, set[str]] = {column: set() for column in columns}
    for name, (python, environment) in rows.items():
        flown = hashes(python, missions, duration=duration, **environment)
        for column, found in zip(columns, flown, strict=True):
            seen[column].add(found)
        shown = [found if arguments.short else found[:12] for found in flown]
        print(f"| {name} | {' | '.join(f'`{found}`' for found in shown)} |", flush=True)
    return int(any(len(found) > 1 for found in seen.values()))


if __name__ == "__main__":
    sys.exit(main())
