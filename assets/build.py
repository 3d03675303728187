"""Source of everything in `meshes`: run `python -m assets.build` after a change here."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from assets.models import canopy, person, quadrotor, trunk
from assets.shapes import PALETTE
from assets.textures import ground, leaves

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
