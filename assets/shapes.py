"""Shapes that meshes are made of, and the colours of palette.png."""

import math

import numpy as np

from assets.mesh import Array, Mesh

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


def cell(name: str) -> Array:
    """Texture coordinates (2,) of a colour in palette.png."""
    return np.array([(list(PALETTE).index(name) + 0.5) / len(PALETTE), 0.5])


def disc(mesh: Mesh, centre: Array, radius: float, *, sides: int, uvs: Array, up: bool = True) -> None:
    """Add a horizontal regular polygon with corners `radius` m from a centre (3,) m; uvs: (2,) or (sides, 2)."""
    angle = np.arange(sides) * 2 * math.pi / sides * (1 if up else -1)
    ring = centre + radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    mesh.polygon(ring, uvs, normal=(0.0, 0.0, 1.0 if up else -1.0))


def prism(mesh: Mesh, *, sides: int, side_uvs: Array, top_uvs: Array) -> None:
    """Add the unit cylinder on z in [0, 1] as a prism with faces across the circle: inside by what corners are out."""
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
    """Add an ellipsoid with radii (3,) m about a centre (3,) m, or the slice at a span of shares of the way down."""
    theta = np.linspace(span[0] * math.pi, span[1] * math.pi, 5)[:, None]
    phi = np.linspace(0.0, 2 * math.pi, 9)[None, :]
    unit = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
    mesh.grid(centre + unit * radii, unit, cell(colour))
