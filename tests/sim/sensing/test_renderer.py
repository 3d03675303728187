"""Rendered images: the same again, with every body where it is, and hiding what the line of sight hides."""

import itertools
import math

import cv2
import msgspec
import numpy as np
import pytest
from helpers.poses import tilted
from helpers.views import ALTITUDES, CAMERA, SCENARIO, random_forest

from sim.scenario.environment import Area, Trees
from sim.scenario.scenario import Scenario
from sim.sensing.culling import LEAST_FAR_PLANE, NEAR_PLANE
from sim.sensing.renderer import Renderer, capture
from sim.world.forest import grow
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

# Trees of 4 to 9 m, each with sizes of its own, whose crowns overlap.
MIXED = Trees(per_hectare=600, height=(4.0, 9.0), overlap=True)


def place_at_random(rng, world, people, *, around, half):
    positions = around + rng.uniform(-half, half, (people, 2))
    world.place_people(positions, rng.uniform(-math.pi, math.pi, people))
    return positions


def test_same_world_and_pose_give_the_same_bytes():
    rng = np.random.default_rng(0)
    forest = random_forest(rng, 15, 5.0)
    poses = [tilted(rng, [*rng.uniform(-30, 30, 2), 19.0], 0.4) for _ in range(10)]
    images = []
    for _ in range(2):
        with World(SCENARIO, forest, 6) as world:
            place_at_random(np.random.default_rng(1), world, 6, around=np.zeros(2), half=30.0)
            renderer = Renderer(world)
            images.append([renderer.render(CAMERA, pose).image.tobytes() for pose in poses])
            again = [renderer.render(CAMERA, pose).image.tobytes() for pose in reversed(poses)]
            assert again == images[-1][::-1]
    assert images[0] == images[1]


@pytest.mark.parametrize("trees", [None, MIXED, msgspec.structs.replace(MIXED, leaf_area_density=1.0)])
def test_hiding_what_is_out_of_view_changes_no_pixel(monkeypatch, trees):
    rng = np.random.default_rng(0)
    forest = grow(trees, Area(60.0, 60.0), rng) if trees else random_forest(rng, 40, 5.0)
    with World(Scenario(), forest, 12) as world:
        place_at_random(rng, world, 12, around=np.zeros(2), half=20.0)
        places = [[*rng.uniform(-20, 20, 2), rng.uniform(8, 22)] for _ in range(40)]
        # A camera aboard a UAV must not see its carrier; oblique ones may see far.
        places[0] = world.poses()[0].position
        poses = [tilted(rng, place, (0.0, 0.3, 1.5)[k % 3]) for k, place in enumerate(places)]
        culling = Renderer(world)
        seen = [culling.render(CAMERA, pose) for pose in poses]
        hidden = [np.mean(~culling.in_view(CAMERA, pose)) for pose in poses]
        everything = np.ones(len(world.bodies), dtype=bool)
        monkeypatch.setattr(Renderer, "in_view", lambda self, camera, pose: everything)
        culling.render(CAMERA, poses[0])
        for pose, culled in zip(poses, seen, strict=True):
            whole = culling.render(CAMERA, pose)
            assert culled.image.tobytes() == whole.image.tobytes()
            assert culled.people.tobytes() == whole.people.tobytes()
    assert np.median(hidden) > 0.7 and sum((frame.people >= 0).any() for frame in seen) > 13


def test_pixels_show_a_known_body_exactly_where_the_camera_model_projects_it():
    rng = np.random.default_rng(0)
    tree = Tree(2.0, -1.0, 2.0, 3.0, 3.05, 0.01)
    angle = np.linspace(0, 2 * math.pi, 720)
    rim = np.column_stack([tree.x + 2.0 * np.cos(angle), tree.y + 2.0 * np.sin(angle)])
    rims = np.vstack([np.column_stack([rim, np.full(720, z)]) for z in (3.0, 3.05)])
    decided = 0
    with World(SCENARIO, Forest((tree,)), 0) as world:
        canopy = world.bodies[0].id
        for _ in range(100):
            pose = tilted(rng, [*rng.uniform(-5, 5, 2), rng.uniform(12, 22)], 0.4)
            _, _, bodies = capture(world.client, CAMERA, pose)
            outline = cv2.convexHull(CAMERA.project(pose, rims)[0].astype(np.float32))
            shown = (bodies == canopy).astype(np.uint8)
            band = cv2.dilate(shown, np.ones((5, 5))) != cv2.erode(shown, np.ones((5, 5)))
            for row, column in np.argwhere(band).tolist():
                distance = cv2.pointPolygonTest(outline, (column + 0.5, row + 0.5), True)
                if abs(distance) > 0.05:
                    decided += 1
                    assert shown[row, column] == (distance > 0)
    assert decided > 20_000


def test_the_ground_stays_put_when_the_camera_moves_or_turns():
    altitude = 19.0
    pixel = altitude / CAMERA.focal
    with World(SCENARIO, Forest(()), 0) as world:
        renderer = Renderer(world)
        for east, north in ((0.0, 0.0), (31.9, -15.9), (-48.3, 47.7)):
            here = renderer.render(CAMERA, Pose.level(east, north, altitude)).image.astype(int)
            there = renderer.render(CAMERA, Pose.level(east + 20 * pixel, north + 7 * pixel, altitude)).image
            # The camera went right and up, so the scene goes left and down.
            assert np.abs(here[:-7, 20:] - there[7:, :-20]).max() <= 2 and here.std(axis=(0, 1)).min() > 2.0
            half_turn = Pose(np.array([east, north, altitude]), np.array([0.0, 0.0, 1.0, 0.0]))
            turned = renderer.render(CAMERA, half_turn).image
            assert np.abs(here - turned[::-1, ::-1]).max() <= 2


def test_a_level_view_shows_sky_above_the_horizon_and_ground_below():
    forward = Pose(np.array([0.0, 0.0, 10.0]), np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]))
    with World(SCENARIO, Forest(()), 0) as world:
        image = Renderer(world).render(CAMERA, forward).image
    assert len(np.unique(image[:64].reshape(-1, 3), axis=0)) == 1 and image[0, 0, 2] > image[0, 0, 0] > 150
    assert (image[70:].reshape(-1, 3).std(axis=0) > 2).all()
    assert not (image[70:] == image[0, 0]).all(axis=-1).any()


def test_people_are_labelled_by_their_index_and_the_absent_are_not_seen():
    places = np.array([[3.0, -4.0], [np.nan, np.nan], [-5.0, 2.0]])
    pose = Pose.level(0.0, 0.0, 19.0)
    with World(SCENARIO, Forest(()), 3) as world:
        renderer = Renderer(world)
        assert (renderer.render(CAMERA, pose).people == -1).all()
        world.place_people(places, np.zeros(3))
        people = renderer.render(CAMERA, pose).people
        assert np.unique(people).tolist() == [-1, 0, 2]
        for k in (0, 2):
            rows, columns = np.nonzero(people == k)
            expected = CAMERA.project(pose, np.array([[*places[k], TARGET_HEIGHT]]))[0][0]
            assert [columns.mean() + 0.5, rows.mean() + 0.5] == pytest.approx(expected, abs=0.7)
        world.place_people(places[[1, 0, 2]], np.zeros(3))
        assert np.unique(renderer.render(CAMERA, pose).people).tolist() == [-1, 1, 2]


def surface(pose, depth, rows, columns):
    """Points (N, 3) that pixels show."""
    z = (
        LEAST_FAR_PLANE
        * NEAR_PLANE
        / (LEAST_FAR_PLANE - (LEAST_FAR_PLANE - NEAR_PLANE) * depth[rows, columns].astype(float))
    )
    return pose.position + z[:, None] * CAMERA.rays(pose, np.column_stack([columns + 0.5, rows + 0.5]))


@pytest.mark.parametrize("altitude", [260.0, 600.0, 1146.0, 10_000.0])
def test_a_camera_at_any_height_shows_people_and_canopies_hide_them(altitude):
    camera = Camera(2 * math.atan(10 / altitude), 128)
    places = np.array([[3.0, -4.0], [-5.0, 2.0]])
    with World(SCENARIO, Forest((Tree(-5.0, 2.0, 2.0),)), 2) as world:
        world.place_people(places, np.zeros(2))
        people = Renderer(world).render(camera, Pose.level(0.0, 0.0, altitude)).people
    assert np.unique(people).tolist() == [-1, 0]
    rows, columns = np.nonzero(people == 0)
    assert [columns.mean() / 6.4 - 10, 10 - rows.mean() / 6.4] == pytest.approx(places[0], abs=0.2)


def test_from_the_least_height_above_canopies_that_is_allowed_they_hide_people():
    rng = np.random.default_rng(0)
    tree = Tree(0.0, 0.0, 5.0)
    least = msgspec.structs.replace(SCENARIO.uavs[0], footprint=2 * (tree.canopy_top + 1.001) * math.tan(math.pi / 6))
    scenario = Scenario(uavs=(least,))
    with World(scenario, Forest((tree,)), 2) as world:
        world.place_people(np.array([[0.5, 0.5], [-1.0, 0.0]]), np.zeros(2))
        renderer = Renderer(world)
        for k in range(20):
            pose = tilted(rng, [*rng.uniform(-1, 1, 2), least.altitude], 0.6 * (k > 0))
            assert (renderer.render(CAMERA, pose).people == -1).all()


def near_silhouettes(trees):
    """Pixels within one pixel of where another tree or the ground begins."""
    padded = np.pad(trees, 1, mode="edge")
    n = len(trees)
    shifted = [padded[i : i + n, j : j + n] for i in range(3) for j in range(3)]
    return np.any([s != trees for s in shifted], axis=0)


def compare_sight(rng, bare, full, forest, pose):
    """For each person's pixel without trees: person, shown with trees, line of sight free, near a silhouette."""
    people = sum(body.kind == "person" for body in bare.bodies)
    half = pose.position[2] * math.tan(CAMERA.fov / 2) + 0.5
    places = pose.position[:2] + rng.uniform(-half, half, (people, 2))
    headings = rng.uniform(-math.pi, math.pi, people)
    bare.place_people(places, headings)
    _, depth, alone = capture(bare.client, CAMERA, pose)
    full.place_people(places, headings)
    _, _, scene = capture(full.client, CAMERA, pose)
    full.place_people(np.full((people, 2), np.nan), headings)
    _, _, trees = capture(full.client, CAMERA, pose)

    index = {body.id: k for k, body in enumerate(b for b in bare.bodies if b.kind == "person")}
    ids = [body.id for body in full.bodies if body.kind == "person"]
    rows, columns = np.nonzero(alone >= 0)
    person = np.array([index[k] for k in alone[rows, columns].tolist()], dtype=int)
    shown = scene[rows, columns] == np.array(ids)[person]
    free = forest.visible(pose.position, surface(pose, depth, rows, columns))[0]
    return np.column_stack([person, shown, free, near_silhouettes(trees)[rows, columns]])


@pytest.mark.parametrize("views", [10, pytest.param(60, marks=pytest.mark.slow)])
def test_line_of_sight_agrees_with_the_rendered_segmentation(views):
    """Away from silhouettes to the last pixel, of which 10 views of each forest have thousands."""
    rng = np.random.default_rng(0)
    pairs, rows = 0, []
    forests = [random_forest(rng, count, radius) for count, radius in ((28, 5.0), (100, 1.0), (55, 3.0), (36, 4.0))]
    for forest in (*forests, grow(MIXED, Area(70.0, 70.0), rng)):
        with World(SCENARIO, Forest(()), 12) as bare, World(SCENARIO, forest, 12) as full:
            for k in range(views):
                place = [*rng.uniform(-30, 30, 2), rng.choice(ALTITUDES)]
                pose = Pose.level(*place) if k % 2 else tilted(rng, place, 0.3)
                found = compare_sight(rng, bare, full, forest, pose)
                pairs += len(np.unique(found[:, 0]))
                rows.append(found[:, 1:].astype(bool))
    shown, free, near = np.vstack(rows).T
    assert pairs >= 40 * views and np.array_equal(shown[~near], free[~near]) and near.mean() < 0.1
    assert 0.2 < free.mean() < 0.8


def test_images_do_not_depend_on_sizes_rendered_before():
    rng = np.random.default_rng(0)
    forest, places = random_forest(rng, 24, 5.0), rng.uniform(-15, 15, (12, 2))
    cameras = [Camera(math.radians(60), n) for n in (16, 97, 128, 512)]
    poses = [Pose.level(*rng.uniform(-15, 15, 2), 19.0) for _ in range(4)]

    def shots(order):
        with World(SCENARIO, forest, 12) as world:
            world.place_people(places, np.zeros(12))
            renderer = Renderer(world)
            views = {(i, j): renderer.render(cameras[i], poses[j]) for i, j in order}
        return {key: (view.image.tobytes(), view.people.tobytes()) for key, view in views.items()}

    sorted_by_size = list(itertools.product(range(4), range(4)))
    expected = shots(sorted_by_size)
    assert len(set(expected.values())) == 16
    assert shots([(i, j) for j in range(4) for i in (3, 0, 2, 1)]) == expected
    assert shots([sorted_by_size[k] for k in rng.permutation(16)]) == expected
