"""Source of everything in `meshes`: run `python -m assets.build` after a change here."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from assets.mesh import Array
from assets.models import canopy, person, quadrotor, trunk
from assets.shapes import PALETTE


def _noise(rng: np.random.Generator, size: int, *, exponent: float, lowest: float = 1.0) -> Array:
    """Seamless noise (size, size) of unit variance; power falls with frequency above `lowest` cycles per edge."""
    fx, fy = np.meshgrid(np.fft.fftfreq(size, 1 / size), np.fft.fftfreq(size, 1 / size))
    frequency = np.hypot(fx, fy)
    gain = np.where(frequency < lowest, 0.0, np.maximum(frequency, 1.0) ** -exponent)
    field_ = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * gain).real
    return np.asarray(field_ / field_.std())


def _shaded(tones: list[tuple[int, int, int]], value: Array) -> NDArray[np.uint8]:
    """Image (H, W, 3) RGB: its pixels take the tones in turn as `value` goes from 0 to 1."""
    index = np.clip((value * len(tones)).astype(int), 0, len(tones) - 1)
    return np.asarray(np.array(tones, dtype=np.uint8)[index])


def _ramp(start: tuple[int, ...], end: tuple[int, ...], steps: int) -> list[tuple[int, int, int]]:
    """Tones from start to end."""
    rows = np.linspace(start, end, steps).round().astype(int)
    return [(int(r), int(g), int(b)) for r, g, b in rows]


def leaves(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Foliage from above, darker towards the rim, beside foliage from the side, darker towards the ground."""
    size = 192
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size * 2 - 1
    clumps = _noise(rng, size, exponent=1.0, lowest=6.0)
    side_clumps = _noise(rng, size, exponent=1.0, lowest=6.0)
    above = 0.62 + 0.16 * clumps - 0.25 * np.hypot(x, y) ** 3
    beside = 0.42 + 0.16 * side_clumps - 0.25 * y
    return _shaded(_ramp((30, 52, 22), (122, 152, 76), 16), np.hstack([above, beside]))


def ground(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Seamless grass with bare patches of soil, for a square of 32 m."""
    size = 320
    grass = _shaded(_ramp((88, 104, 66), (124, 138, 92), 8), 0.5 + 0.2 * _noise(rng, size, exponent=0.6, lowest=3.0))
    soil = _shaded(_ramp((112, 104, 86), (142, 134, 114), 6), 0.5 + 0.2 * _noise(rng, size, exponent=0.5))
    patches = _noise(rng, size, exponent=2.2) + 0.25 * _noise(rng, size, exponent=0.5)
    return np.where((patches > 1.0)[..., None], soil, grass)


MESHES = Path(__file__).parent / "meshes"


def build(folder: Path) -> None:
    """Write all meshes, materials and textures into a folder."""
    rng = np.random.default_rng(0)
    palette = np.array([list(PALETTE.values())], dtype=np.uint8)
    for name, image in {"palette": palette, "leaves": leaves(rng), "ground": ground(rng)}.items():
        cv2.imwrite(str(folder / f"{name}.png"), image[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    for texture in ("leaves", "palette"):
        (folder / f"{texture}.mtl").write_text(f"newmtl {texture}\nKd 1 1 1\nmap_Kd {texture}.png\n")
    for mesh in (canopy, trunk, person, quadrotor):
        texture = "leaves" if mesh is canopy else "palette"
        (folder / f"{mesh.__name__}.obj").write_text(mesh().text(texture))


if __name__ == "__main__":
    build(MESHES)
