import itertools
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from assets.build import build
from sim.installation import ASSETS
from sim.world.quadrotor import INERTIA, MASS, ROTORS
from tracking.geometry.person import TARGET_HEIGHT

MESHES = ("canopy", "trunk", "person", "quadrotor")


def vertices(name):
    lines = (ASSETS / "meshes" / f"{name}.obj").read_text().splitlines()
    return np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)


def test_the_meshes_are_what_their_source_builds_and_small(tmp_path):
    build(tmp_path)
    for name in MESHES:
        assert (tmp_path / f"{name}.obj").read_text() == (ASSETS / "meshes" / f"{name}.obj").read_text()
    files = itertools.chain((ASSETS / "meshes").iterdir(), ASSETS.glob("*.urdf"))
    assert sum(file.stat().st_size for file in files) < 500_000


@pytest.mark.parametrize(("name", "sides"), [("canopy", 48), ("trunk", 16)])
def test_a_tree_prism_lies_as_far_outside_its_cylinder_as_inside(name, sides):
    corners = np.unique(vertices(name).round(4), axis=0)
    assert set(corners[:, 2]) == {0.0, 1.0}
    ring = corners[corners[:, 2] == 1.0]
    ring = ring[np.argsort(np.arctan2(ring[:, 1], ring[:, 0]))]
    middles = (ring + np.roll(ring, 1, axis=0)) / 2
    outside = np.hypot(ring[:, 0], ring[:, 1]) - 1
    inside = 1 - np.hypot(middles[:, 0], middles[:, 1])
    error = math.tan(math.pi / sides / 2) ** 2
    assert np.allclose(outside, error, atol=1e-4) and np.allclose(inside, error, atol=1e-4)


def test_people_are_as_tall_as_trackers_assume_and_faces_face_outwards():
    z = vertices("person")[:, 2]
    assert z.min() == 0.0 and z.max() == pytest.approx(2 * TARGET_HEIGHT, abs=1e-9)
    for name in MESHES[:2]:
        points = vertices(name)
        lines = (ASSETS / "meshes" / f"{name}.obj").read_text().splitlines()
        faces = [[int(c.split("/")[0]) - 1 for c in s.split()[1:]] for s in lines if s.startswith("f ")]
        volume = 0.0
        for a, b, c in (points[face] for face in faces):
            assert np.linalg.norm(np.cross(b - a, c - a)) > 0.0
            volume += np.dot(a, np.cross(b, c)) / 6
        assert volume == pytest.approx(math.pi, rel=0.01)


def test_the_quadrotor_is_the_one_that_the_controller_knows():
    inertial = ElementTree.parse(ASSETS / "quadrotor.urdf").getroot().find("link/inertial")
    assert float(inertial.find("mass").get("value")) == MASS
    inertia = inertial.find("inertia")
    assert [float(inertia.get(axis)) for axis in ("ixx", "iyy", "izz")] == INERTIA.tolist()
    assert [float(inertia.get(axis)) for axis in ("ixy", "ixz", "iyz")] == [0.0, 0.0, 0.0]
    blades = vertices("quadrotor")
    blades = blades[np.isclose(blades[:, 2], blades[:, 2].max())]
    for x, y in ROTORS[:, :2]:
        own = blades[np.hypot(blades[:, 0] - x, blades[:, 1] - y) < 0.13]
        assert own[:, :2].mean(axis=0) == pytest.approx([x, y], abs=1e-4)
