"""Source of everything in `meshes`: run `python -m assets.build` after a change here."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MESHES = Path(__file__).parent / "meshes"

# RGB cells of palette.png. The person's tones share one hue, that of hi-vis orange, which nothing else has.
PALETTE = {
    "bark": (104, 88, 74),
    "carbon": (38, 40, 44),
    "metal": (96, 100, 106),
    "front": (235, 238, 240),
    "blade": (112, 116, 122),
    "vest": (255, 68, 0),
    "trousers": (196, 52, 0),
    "boots": (150, 40, 0),
    "skin": (230, 110, 66),
    "hair": (128, 34, 0),
}
CANOPY_SIDES = 48
TRUNK_SIDES = 16


@dataclass
class Mesh:
    """Triangles with normals and texture coordinates, one set per vertex."""

    vertices: list[Array] = field(default_factory=list)
    normals: list[Array] = field(default_factory=list)
    uvs: list[Array] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)

    def grid(self, vertices: Array, normals: Array, uvs: Array) -> None:
        """Add a surface over a grid (I, J, 3), its outside where I x J points."""
        rows, columns = vertices.shape[:2]
        corners = self._add(vertices, normals, uvs).reshape(rows, columns)
        for i in range(rows - 1):
            for j in range(columns - 1):
                (a, d), (b, c) = corners[i : i + 2, j : j + 2]
                self.triangle(a, b, c)
                self.triangle(a, c, d)

    def polygon(self, vertices: Array, uvs: Array, *, normal: tuple[float, float, float]) -> None:
        """Add a flat convex polygon (K, 3) by halving, since a fan of slivers is slow to rasterise."""
        corners = self._add(vertices, np.broadcast_to(normal, vertices.shape), uvs)
        arcs = [(0, len(corners) - 1)]
        for first, last in arcs:
            middle = (first + last) // 2
            self.triangle(corners[first], corners[middle], corners[last])
            if last - first > 1:
                arcs += [(first, middle), (middle, last)]

    def triangle(self, a: int, b: int, c: int) -> None:
        """Add a triangle unless two of its corners coincide."""
        normal = np.cross(self.vertices[b] - self.vertices[a], self.vertices[c] - self.vertices[b])
        if float(np.linalg.norm(normal)) > 1e-9:
            self.faces.append((int(a), int(b), int(c)))

    def _add(self, vertices: Array, normals: Array, uvs: Array) -> NDArray[np.int64]:
        start = len(self.vertices)
        self.vertices += list(vertices.reshape(-1, 3))
        self.normals += list(normals.reshape(-1, 3))
        self.uvs += list(np.broadcast_to(uvs, (*vertices.shape[:-1], 2)).reshape(-1, 2))
        return np.arange(start, len(self.vertices))

    def text(self, texture: str) -> str:
        """The mesh as OBJ, textured through a material file."""
        lines = [f"mtllib {texture}.mtl", f"usemtl {texture}"]
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in self.vertices]
        lines += [f"vt {u:.4f} {v:.4f}" for u, v in self.uvs]
        lines += [f"vn {x:.12f} {y:.12f} {z:.12f}" for x, y, z in map(steady, self.normals)]
        lines += ["f " + " ".join(f"{k + 1}/{k + 1}/{k + 1}" for k in face) for face in self.faces]
        return "\n".join(lines) + "\n"


def steady(normal: Array) -> Array:
    """The direction (3,) as single precision numbers that the engine leaves as they are.

    TinyRenderer normalises a mesh's normals in place at every use. Most vectors never settle then: they alternate
    between two roundings, and with them, now and then, a pixel. Those whose length comes out as exactly one stay.
    """
    rounded = np.round(normal, 4) + 0.0  # no negative zeros
    start = (rounded / np.linalg.norm(rounded)).astype(np.float32)
    steps = [(0,) if x == 0.0 else range(-3, 4) for x in start]
    near = [start + np.array(step) * np.spacing(np.abs(start)) for step in itertools.product(*steps)]
    near.sort(key=lambda x: float(np.sum((x.astype(float) - rounded / np.linalg.norm(rounded)) ** 2)))
    return next(x.astype(float) for x in near if _of_length_one(x))


def _of_length_one(x: NDArray[np.float32]) -> bool:
    """Whether the length in single precision is exactly one, in whatever order and with however fused sums."""
    squares, wide = x * x, x.astype(float)
    for i, j, k in itertools.permutations(range(3)):
        fused = np.float32(wide[j] ** 2 + squares[i])
        sums = ((squares[i] + squares[j]) + squares[k], np.float32(wide[k] ** 2 + fused))
        if any(np.sqrt(np.float32(total)) != 1.0 for total in sums):
            return False
    return True


def cell(name: str) -> Array:
    """Texture coordinates (2,) of a colour in palette.png."""
    return np.array([(list(PALETTE).index(name) + 0.5) / len(PALETTE), 0.5])


def disc(mesh: Mesh, centre: Array, radius: float, *, sides: int, uvs: Array, up: bool = True) -> None:
    """Add a horizontal polygon that faces up or down; uvs (2,) of one colour or (sides, 2)."""
    angle = np.arange(sides) * 2 * math.pi / sides * (1 if up else -1)
    ring = centre + radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    mesh.polygon(ring, uvs, normal=(0.0, 0.0, 1.0 if up else -1.0))


def prism(mesh: Mesh, *, sides: int, side_uvs: Array, top_uvs: Array) -> None:
    """Add the unit cylinder on z in [0, 1] as a prism whose faces cross the circle: inside by what corners are out."""
    angle = np.linspace(0.0, 2 * math.pi, sides + 1)
    radius = 2 / (1 + math.cos(math.pi / sides))
    round_ = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)])
    vertices = np.stack([radius * round_ + [0.0, 0.0, z] for z in (1.0, 0.0)])
    mesh.grid(vertices, np.stack([round_, round_]), side_uvs)
    disc(mesh, np.array([0.0, 0.0, 1.0]), radius, sides=sides, uvs=top_uvs)
    disc(mesh, np.zeros(3), radius, sides=sides, uvs=side_uvs[-1, 0], up=False)


def limb(mesh: Mesh, ends: list[tuple[float, ...]], colour: str, *, sides: int = 6) -> None:
    """Add a tube with closed ends through rows (x, y, z, half width along x, half width along y)."""
    angle = np.linspace(0.0, 2 * math.pi, sides + 1)
    round_ = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)])
    rows = np.array([(*ends[0][:3], 0.0, 0.0), *ends, (*ends[-1][:3], 0.0, 0.0)])
    vertices = np.stack([row[:3] + round_ * [row[3], row[4], 0.0] for row in rows])
    normals = np.broadcast_to(round_, vertices.shape).copy()
    normals[0], normals[-1] = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]
    mesh.grid(vertices, normals, cell(colour))


def ball(mesh: Mesh, centre: Array, radii: Array, colour: str, *, span: tuple[float, float] = (0.0, 1.0)) -> None:
    """Add an ellipsoid, or its slice from `span` of the way down from the pole."""
    theta = np.linspace(span[0] * math.pi, span[1] * math.pi, 5)[:, None]
    phi = np.linspace(0.0, 2 * math.pi, 9)[None, :]
    unit = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
    mesh.grid(centre + unit * radii, unit, cell(colour))


def canopy() -> Mesh:
    """Unit cylinder; the left half of leaves.png lies on its top, the right half goes round its side."""
    mesh = Mesh()
    angle = np.linspace(0.0, 2 * math.pi, CANOPY_SIDES + 1)
    around = 0.51 + 0.48 * np.abs(np.linspace(-4, 4, CANOPY_SIDES + 1) % 2 - 1)
    side = np.stack([np.column_stack([around, np.full(CANOPY_SIDES + 1, v)]) for v in (0.98, 0.02)])
    top = np.column_stack([0.25 + 0.245 * np.cos(angle), 0.5 + 0.49 * np.sin(angle)])[:-1]
    prism(mesh, sides=CANOPY_SIDES, side_uvs=side, top_uvs=top)
    return mesh


def trunk() -> Mesh:
    """Unit cylinder."""
    mesh = Mesh()
    bark = np.broadcast_to(cell("bark"), (2, TRUNK_SIDES + 1, 2))
    prism(mesh, sides=TRUNK_SIDES, side_uvs=bark, top_uvs=cell("bark"))
    return mesh


def person() -> Mesh:
    """A person of 1.7 m in mid-stride towards +x.

    Stride and girth are chosen so that what the legs show beyond the trunk balances head and shoulders: the centroid
    of its silhouette then stays at mid-height from nadir to oblique views.
    """
    mesh = Mesh()
    limb(mesh, [(0, 0, 1.45, 0.11, 0.19), (0, 0, 1.38, 0.145, 0.25), (0, 0, 0.88, 0.12, 0.17)], "vest", sides=8)
    limb(mesh, [(0.02, 0, 1.52, 0.06, 0.06), (0, 0, 1.42, 0.065, 0.065)], "skin")
    ball(mesh, np.array([0.025, 0, 1.58]), np.array([0.10, 0.085, 0.115]), "skin", span=(0.3, 1.0))
    ball(mesh, np.array([0.01, 0, 1.585]), np.array([0.11, 0.093, 0.115]), "hair", span=(0.0, 0.5))
    for side in (1, -1):
        swing = -side  # an arm swings with the other side's leg
        shoulder = (0.0, 0.24 * side, 1.40, 0.078, 0.078)
        elbow = (0.03 * swing, 0.265 * side, 1.14, 0.065, 0.065)
        hand = np.array([0.20 * swing + 0.03, 0.25 * side, 0.93])
        limb(mesh, [shoulder, elbow, (*hand, 0.05, 0.05)], "vest")
        ball(mesh, hand, np.full(3, 0.06), "skin")
        hip = (0.02 * side, 0.08 * side, 0.92, 0.09, 0.085)
        knee = (0.17 * side + 0.02, 0.09 * side, 0.50, 0.083, 0.075)
        ankle = (0.30 * side - 0.01, 0.10 * side, 0.10, 0.07, 0.07)
        heel = 0.31 * side
        limb(mesh, [hip, knee, ankle], "trousers")
        limb(
            mesh,
            [(heel, 0.10 * side, 0.14, 0.08, 0.075), (heel + 0.04, 0.10 * side, 0.0, 0.13, 0.075)],
            "boots",
        )
    return mesh


def quadrotor() -> Mesh:
    """A quadrotor 0.48 m between opposite rotors, nose towards +x, its front arms white."""
    mesh = Mesh()
    limb(mesh, [(0, 0, 0.045, 0.07, 0.05), (0, 0, 0.02, 0.11, 0.08), (0, 0, -0.035, 0.09, 0.06)], "carbon")
    ball(mesh, np.array([0.02, 0, -0.05]), np.full(3, 0.035), "metal")
    for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        tip = 0.17 * np.array([x, y, 0.0])
        across = np.array([y, -x, 0.0]) * 0.012
        rise = np.array([0.0, 0.0, 0.012])
        section = np.stack([across + rise, across - rise, -across - rise, -across + rise, across + rise])
        if x * y < 0:
            across = -across
        arm = np.stack([section, tip + section])
        mesh.grid(arm, np.broadcast_to(section / 0.02, arm.shape), cell("front" if x > 0 else "carbon"))
        limb(mesh, [(*tip[:2], 0.05, 0.025, 0.025), (*tip[:2], -0.02, 0.025, 0.025)], "metal")
        for up in (True, False):
            hub = tip + np.array([0.0, 0.0, 0.055])
            disc(mesh, hub, 0.12, sides=16, uvs=cell("blade"), up=up)
    return mesh


def noise(rng: np.random.Generator, size: int, *, exponent: float, lowest: float = 1.0) -> Array:
    """Seamless noise (size, size) of unit variance; power falls with frequency above `lowest` cycles per edge."""
    fx, fy = np.meshgrid(np.fft.fftfreq(size, 1 / size), np.fft.fftfreq(size, 1 / size))
    frequency = np.hypot(fx, fy)
    gain = np.where(frequency < lowest, 0.0, np.maximum(frequency, 1.0) ** -exponent)
    field_ = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * gain).real
    return np.asarray(field_ / field_.std())


def shaded(tones: list[tuple[int, int, int]], value: Array) -> NDArray[np.uint8]:
    """Image (H, W, 3) RGB whose pixels take the tones in turn as `value` goes from 0 to 1."""
    index = np.clip((value * len(tones)).astype(int), 0, len(tones) - 1)
    return np.asarray(np.array(tones, dtype=np.uint8)[index])


def ramp(start: tuple[int, ...], end: tuple[int, ...], steps: int) -> list[tuple[int, int, int]]:
    """Tones from start to end."""
    rows = np.linspace(start, end, steps).round().astype(int)
    return [(int(r), int(g), int(b)) for r, g, b in rows]


def leaves(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Foliage from above, darker towards the rim, beside foliage from the side, darker towards the ground."""
    size = 192
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size * 2 - 1
    clumps = noise(rng, size, exponent=1.0, lowest=6.0)
    side_clumps = noise(rng, size, exponent=1.0, lowest=6.0)
    above = 0.62 + 0.16 * clumps - 0.25 * np.hypot(x, y) ** 3
    beside = 0.42 + 0.16 * side_clumps - 0.25 * y
    return shaded(ramp((30, 52, 22), (122, 152, 76), 16), np.hstack([above, beside]))


def ground(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Seamless grass with bare patches of soil, for a square of 32 m."""
    size = 320
    grass = shaded(ramp((88, 104, 66), (124, 138, 92), 8), 0.5 + 0.2 * noise(rng, size, exponent=0.6, lowest=3.0))
    soil = shaded(ramp((112, 104, 86), (142, 134, 114), 6), 0.5 + 0.2 * noise(rng, size, exponent=0.5))
    patches = noise(rng, size, exponent=2.2) + 0.25 * noise(rng, size, exponent=0.5)
    return np.where((patches > 1.0)[..., None], soil, grass)


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
