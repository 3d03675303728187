import itertools
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from assets.build import build
from sim.installation import ASSETS
from sim.world.quadrotor import INERTIA, MASS
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
