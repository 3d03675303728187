"""Triangle meshes, and their text as OBJ."""

import itertools
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
        lines += [f"vn {x:.12f} {y:.12f} {z:.12f}" for x, y, z in map(_steady, self.normals)]
        lines += ["f " + " ".join(f"{k + 1}/{k + 1}/{k + 1}" for k in face) for face in self.faces]
        return "\n".join(lines) + "\n"


def _steady(normal: Array) -> Array:
    """The direction (3,) as single precision numbers that the engine leaves as they are.

    TinyRenderer normalises a mesh's normals in place at every use. Most vectors never settle then: they alternate
    between two roundings, and with them, now and then, a pixel. Those with a length that comes out as exactly one stay.
    """
    rounded = np.round(normal, 4) + 0.0  # no negative zeros
    start = (rounded / np.linalg.norm(rounded)).astype(np.float32)
    steps = [(0,) if x == 0.0 else range(-3, 4) for x in start]
    near = [start + np.array(step) * np.spacing(np.abs(start)) for step in itertools.product(*steps)]
    near.sort(key=lambda x: float(np.sum((x.astype(float) - rounded / np.linalg.norm(rounded)) ** 2)))
    return next(x.astype(float) for x in near if _of_length_one(x))


def _of_length_one(x: NDArray[np.float32]) -> bool:
    """True if the length in single precision is exactly one, in whatever order and with however fused sums."""
    squares, wide = x * x, x.astype(float)
    for i, j, k in itertools.permutations(range(3)):
        fused = np.float32(wide[j] ** 2 + squares[i])
        sums = ((squares[i] + squares[j]) + squares[k], np.float32(wide[k] ** 2 + fused))
        if any(np.sqrt(np.float32(total)) != 1.0 for total in sums):
            return False
    return True
