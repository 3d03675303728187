"""Costs of rendering, detection and line of sight beside their floors; docs/results/benchmarks.md says how to run this.

What is compared runs in turn, so that the load of the machine falls on all of it; of several times the least counts.
In ordinary test runs each comparison runs once, on little, and its ratio is not judged.
"""

import time
from dataclasses import dataclass
from functools import partial
from itertools import islice, product

import numpy as np
import pytest
from helpers import timing

from planning.planner_loading import load_planner
from sim.mission.mission import Mission
from sim.scenario.environment import Trees
from sim.scenario.scenario import Scenario
from sim.scenario.sensing import Sensing
from sim.scenario.uavs import Uav
from sim.sensing.culling import find_in_frustum
from sim.sensing.renderer import Renderer, capture
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree

SCENARIO = Scenario(trees=Trees(density=75.0), sensing=Sensing(mode="ideal"))
least = partial(timing.least, clock=time.perf_counter)
ALONE = Scenario(uavs=(Uav(start=(74.0, 49.0)),))


@dataclass(frozen=True, eq=False)
class View:
    """One look of a camera during a mission."""

    uav: int
    pose: Pose
    people: np.ndarray
    headings: np.ndarray

    @property
    def camera(self):
        return SCENARIO.uavs[self.uav].true_camera


@pytest.fixture(scope="module")
def flown(judged):
    """The forest of a mission among 75 trees, and views of it by its three cameras, every two seconds."""
    mission = Mission(SCENARIO, load_planner("sma-nbo-mwtp"), 0)
    snapshots = list(islice(mission.fly(), 0, 101 if judged else 6, 10 if judged else 5))
    views = [View(i, pose, s.people, s.headings) for s in snapshots for i, pose in enumerate(s.cameras)]
    return mission.forest, views


def in_field_of_view(world, view):
    """Bodies that touch the pyramid that a camera sees, as flags."""
    radii = np.array([body.radius for body in world.bodies])
    return find_in_frustum(world.centres, radii, view.pose.position, view.pose.rotation, view.camera.fov)


def only(world, bodies):
    """A renderer that shows these bodies, and hides the others, whatever the view."""
    renderer = Renderer(world)
    renderer.in_view = lambda camera, pose: bodies
    return renderer


def report(what, seconds, floor, bound, judged):
    print(f"\n{what}: {1e3 * seconds:.2f} ms against {1e3 * floor:.2f} ms, ratio {seconds / floor:.2f}, bound {bound}")
    assert not judged or seconds <= bound * floor


@pytest.mark.parametrize("located", ["without the map", "with the map"])
def test_camera_step_against_the_bare_engine_on_what_is_in_view(flown, judged, located):
    """From rendering to detections, against the engine's call alone in a client with nothing but the bodies in view."""
    forest, views = flown
    detect, known = BlobDetector().detect, forest if located == "with the map" else None
    trees, times = len(forest.trees), []
    with World(SCENARIO, forest, len(views[0].people)) as world:
        renderer = Renderer(world)
        for view in views:
            world.place_people(view.people, view.headings)
            seen = in_field_of_view(world, view)
            near = [tree for k, tree in enumerate(forest.trees) if seen[k] or seen[trees + k]]
            people = np.flatnonzero(seen[2 * trees : 2 * trees + len(view.people)])
            with World(ALONE, Forest(tuple(near)), len(people)) as bare:
                bare.place_people(view.people[people], view.headings[people])
                alone = only(bare, in_field_of_view(bare, view)).render(view.camera, view.pose)
                shown = renderer.render(view.camera, view.pose)
                assert np.array_equal(alone.people >= 0, shown.people >= 0)
                times.append(
                    least(
                        lambda v=view: detect(
                            Frame(v.uav, 0.0, v.camera, v.pose, renderer.render(v.camera, v.pose).image, known)
                        ),
                        lambda v=view, client=bare.client: capture(client, v.camera, v.pose),
                        rounds=10 if judged else 1,
                    )
                )
    report(f"camera step, {located}", *np.mean(times, axis=0), 1.25, judged)


def test_frames_among_750_trees_against_75(judged):
    """With the same trees in view."""
    near = [Tree(10.0 * i - 70, 20.0 * j - 40, 4.5) for i in range(15) for j in range(5)]
    far = [Tree(10.0 * i + 150, 20.0 * j, 4.5) for i in range(27) for j in range(25)]
    pose, camera = Pose.level(0.0, 10.0, 19.0), SCENARIO.uavs[0].true_camera
    with World(SCENARIO, Forest(tuple(near)), 0) as few, World(SCENARIO, Forest((*near, *far)), 0) as many:
        a, b = Renderer(few), Renderer(many)
        assert a.render(camera, pose).image.tobytes() == b.render(camera, pose).image.tobytes()
        rounds = 100 if judged else 1
        dense, sparse = least(lambda: b.render(camera, pose), lambda: a.render(camera, pose), rounds=rounds)
    report("frame, 750 trees against 75", dense, sparse, 1.3, judged)


def test_mission_views_against_the_same_without_culling(flown, judged):
    forest, views = flown
    count = len(views[0].people)
    with World(SCENARIO, forest, count) as culled, World(SCENARIO, forest, count) as whole:
        a, b = Renderer(culled), only(whole, np.ones(len(whole.bodies), dtype=bool))
        times = []
        for view in views:
            for world in (culled, whole):
                world.place_people(view.people, view.headings)
            assert np.array_equal(a.render(view.camera, view.pose).people, b.render(view.camera, view.pose).people)
            times.append(
                least(
                    lambda v=view: a.render(v.camera, v.pose),
                    lambda v=view: b.render(v.camera, v.pose),
                    rounds=10 if judged else 1,
                )
            )
    report("mission's views, culled against whole", *np.mean(times, axis=0), 0.5, judged)


def test_resolutions_in_turn_against_one_at_a_time(flown, judged):
    """In one client, which makes its buffers anew at each change of size; the same views in the same order."""
    forest, views = flown
    views = views[:15]
    cameras = [Camera(views[0].camera.fov, pixels) for pixels in (96, 128, 256)]
    times = np.full((2, 3, len(views)), np.inf)  # one at a time, in turn; resolution; view
    with World(SCENARIO, forest, len(views[0].people)) as world:
        renderer = Renderer(world)
        world.place_people(views[0].people, views[0].headings)
        for _, k, turns in product(range(20 if judged else 1), range(3), range(2)):
            for i, view in enumerate(views):
                j = (k + i * turns) % 3
                start = time.perf_counter()
                renderer.render(cameras[j], view.pose)
                times[turns, j, i] = min(times[turns, j, i], time.perf_counter() - start)
    alone, mixed = times.mean(axis=(1, 2))
    report("frames of 96, 128 and 256 pixels in turn", mixed, alone, 1.05, judged)


@pytest.mark.parametrize(("width", "straight_width", "bound"), [(256, 148, 9.0), (640, 640, 4.0)])
def test_frames_through_a_lens_against_straight_ones(flown, judged, width, straight_width, bound):
    """With the same angle of view, and the same views in turn; the smaller straight ones have a third of the pixels."""
    forest, views = flown
    straight, bent = (
        Camera.calibrated(w, w * 3 // 4, (0.86 * w, 0.86 * w), (w / 2, w * 3 / 8), distortion)
        for w, distortion in ((straight_width, ()), (width, (-0.2, 0.03)))
    )
    times = []
    with World(SCENARIO, forest, len(views[0].people)) as world:
        renderer = Renderer(world)
        for view in views[::6]:
            world.place_people(view.people, view.headings)
            shown = np.unique(renderer.render(bent, view.pose).people)
            assert np.isin(renderer.render(straight, view.pose).people, shown).all()
            times.append(
                timing.least(
                    lambda v=view: renderer.render(bent, v.pose),
                    lambda v=view: renderer.render(straight, v.pose),
                    rounds=10 if judged else 1,
                )
            )
    report(
        f"frame {width} pixels wide through a lens, against {straight_width} straight ones",
        *np.mean(times, axis=0),
        bound,
        judged,
    )


def lines(trees, judged):
    """Forest of 75 trees per 150 x 100 m, cameras above it, and 1000 points in view of each."""
    rng = np.random.default_rng(0)
    half = np.array([75.0, 50.0]) * np.sqrt(trees / 75)
    forest = Forest(tuple(Tree(*rng.uniform(-half, half)) for _ in range(trees)))
    cameras = np.column_stack([rng.uniform(-half, half, (50, 2)), rng.uniform(17, 22, 50)])[: None if judged else 2]
    offsets = rng.uniform(-12, 12, (len(cameras), 1000, 2))
    return forest, [
        (camera, np.column_stack([camera[:2] + o, np.full(1000, TARGET_HEIGHT)]))
        for camera, o in zip(cameras, offsets, strict=True)
    ]


def test_lines_of_sight_a_second(judged):
    """At least 5 million among 75 trees; growing slower than the number of trees."""
    work = {trees: lines(trees, judged) for trees in (75, 300, 1200)}

    def look(trees):
        forest, pairs = work[trees]
        for camera, points in pairs:
            forest.visible(camera, points)

    look(75)
    few, some, many = least(*(lambda n=n: look(n) for n in work), rounds=20 if judged else 1)
    rates = [1e-6 * 1000 * len(work[75][1]) / seconds for seconds in (few, some, many)]
    print("\nmillion lines of sight a second among 75, 300, 1200 trees: {:.1f}, {:.1f}, {:.1f}".format(*rates))
    assert not judged or (rates[0] >= 5.0 and many < 2 * few)


def test_lines_of_sight_among_1500_trees_take_as_long_as_among_the_75_in_reach(judged):
    few, pairs = lines(75, judged)
    rng = np.random.default_rng(1)
    places = rng.uniform([-335.0, -224.0], [335.0, 224.0], (4000, 2))
    far = places[(np.abs(places) > np.array([100.0, 75.0])).any(axis=1)][:1425]
    many = Forest((*few.trees, *(Tree(*place) for place in far)))

    def look(forest):
        for camera, points in pairs:
            forest.free_shares(camera, points)

    for camera, points in pairs[:2]:
        np.testing.assert_array_equal(few.free_shares(camera, points), many.free_shares(camera, points))
    times = least(partial(look, many), partial(look, few), rounds=20 if judged else 1)
    report("lines of sight among 1500 trees, 75 of them in reach", *times, 1.3, judged)
