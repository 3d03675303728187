"""Meshes of trees, persons and quadrotors."""

import math

import numpy as np

from assets.mesh import Mesh
from assets.shapes import ball, cell, disc, limb, prism

_CANOPY_SIDES = 48
_TRUNK_SIDES = 16


def canopy() -> Mesh:
    """Unit cylinder; the left half of leaves.png lies on its top, the right half goes round its side."""
    mesh = Mesh()
    angle = np.linspace(0.0, 2 * math.pi, _CANOPY_SIDES + 1)
    around = 0.51 + 0.48 * np.abs(np.linspace(-4, 4, _CANOPY_SIDES + 1) % 2 - 1)
    side = np.stack([np.column_stack([around, np.full(_CANOPY_SIDES + 1, v)]) for v in (0.98, 0.02)])
    top = np.column_stack([0.25 + 0.245 * np.cos(angle), 0.5 + 0.49 * np.sin(angle)])[:-1]
    prism(mesh, sides=_CANOPY_SIDES, side_uvs=side, top_uvs=top)
    return mesh


def trunk() -> Mesh:
    """Unit cylinder."""
    mesh = Mesh()
    bark = np.broadcast_to(cell("bark"), (2, _TRUNK_SIDES + 1, 2))
    prism(mesh, sides=_TRUNK_SIDES, side_uvs=bark, top_uvs=cell("bark"))
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
        limb(mesh, [(heel, 0.10 * side, 0.14, 0.08, 0.075), (heel + 0.04, 0.10 * side, 0.0, 0.13, 0.075)], "boots")
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
