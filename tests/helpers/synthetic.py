"""A made-up mission with all that a recording and a video can hold, without physics, rendering or tracking."""

import math
from dataclasses import replace

import cv2
import numpy as np

from planning.planner import Plan
from sim.mission.snapshot import FlownPlans, Snapshot
from sim.scenario.environment import Area, People
from sim.scenario.scenario import Rates, Scenario
from sim.scenario.sensing import Sensing
from sim.scenario.uavs import Uav
from sim.world.contacts import Contact
from tracking.filter.kalman import Gaussian
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT
from tracking.geometry.visibility import Forest, Tree
from tracking.track import Scan, Track


def scenario(uavs=3, people=4, mode="camera", area=(150.0, 100.0)):
    places, edges = [(1.0 * (i // 3), 0.0) for i in range(uavs)], [20.0 + 3.0 * (i % 3) for i in range(uavs)]
    fleet = [Uav(start=x, footprint=e, alpha=0.1, pixels=128) for x, e in zip(places, edges, strict=True)]
    shape = {"area": Area(*area), "people": People(count=people), "uavs": tuple(fleet)}
    return Scenario(**shape, rates=Rates(), sensing=Sensing(mode=mode))


def forest(setting, count=45, seed=0):
    rng = np.random.default_rng(seed)
    half = np.array([setting.area.width, setting.area.height]) / 2 - 5
    places = []
    for place in rng.uniform(-half, half, (5000, 2)).tolist():
        if len(places) == count:
            break
        if all(math.dist(place, other) > 10 for other in places):
            places.append(place)
    return Forest(tuple(Tree(x, y) for x, y in places))


def snapshots(setting, trees, scans=21, seed=0):
    rng = np.random.default_rng(seed)
    doubt, made = np.ones(setting.people.count), []
    for k in range(scans):
        snapshot = _snapshot(setting, trees, k, rng, doubt)
        made += [] if snapshot.plans is None else [FlownPlans(snapshot.time, snapshot.plans)]
        (n,) = setting.find_flown([plans.made for plans in made], [snapshot.time])
        yield replace(snapshot, flown=made[n] if n >= 0 else None)


def _snapshot(setting, trees, k, rng, doubt):
    n, count, time = len(setting.uavs), setting.people.count, k / setting.rates.sensing
    people, headings = _people(setting, time)
    cameras = [_camera_pose(setting, i, people, time) for i in range(n)]
    points = np.column_stack([people, np.full(count, TARGET_HEIGHT)])
    lenses = [Camera(math.radians(uav.fov_deg), uav.pixels) for uav in setting.uavs]
    seen = np.array([lens.sees(pose, points) for lens, pose in zip(lenses, cameras, strict=True)]).reshape(n, count)
    if count:
        seen &= trees.visible(np.array([pose.position for pose in cameras]), points)
    scans, pixels = [], []
    for i, (lens, pose) in enumerate(zip(lenses, cameras, strict=True)):
        ground = people[seen[i]] + rng.normal(0, 0.3, (int(seen[i].sum()), 2))
        scans.append(Scan(i, time, pose, ground, np.tile(np.eye(2) * 0.1, (len(ground), 1, 1)), trees))
        shown = lens.project(pose, points[seen[i]])[0] if setting.sensing.mode == "camera" else np.zeros((0, 2))
        pixels.append(shown)
    doubt[:] = np.where(seen.any(axis=0), 0.2, doubt + 0.1)
    tracks = _tracks(people, headings, doubt, rng)
    localisation = rng.gamma(2.0, 0.3, n)
    cardinality = np.where((time > 2) & (time < 3), 25.0, 0.0) * np.ones(n)
    plan = [Plan(rng.uniform(-4, 4, 2) + rng.normal(0, 1.0, (5, 2))) for _ in range(n)]
    return Snapshot(
        time=time,
        people=np.where((np.arange(count) == 3)[:, None] & (time < 1), np.nan, people),
        headings=headings,
        poses=cameras,
        cameras=cameras,
        working=list(range(n)),
        frames_taken=np.array([setting.has_frame(i, k) for i in range(n)]),
        commands=rng.uniform(-4, 4, (n, 2)),
        scans=scans,
        pixels=pixels,
        tracks=[tracks] * n,
        plans=plan if k % (setting.rates.plan_scans) == 0 else None,
        known_ospa=np.column_stack([np.hypot(localisation, cardinality), localisation, cardinality]),
        visible=seen.astype(np.int64) * 9,
        matched=seen,
        contacts=(Contact(0, "canopy", 4), Contact(n - 1, "ground", 0)) if 3 <= k <= 5 else (),
        bytes_sent=100 * k + np.arange(n),
        plan_bytes=(7 * k + np.arange(n)) * (k % 5 == 0),
        plan_rounds=1 - min(k % 5, 1),
    )


def _people(setting, time):
    angles = 0.8 * np.arange(setting.people.count) + 0.05 * time
    reach = np.array([setting.area.width, setting.area.height]) * 0.3
    people = reach * np.column_stack([np.cos(angles), np.sin(2 * angles)]).reshape(-1, 2)
    velocity = reach * np.column_stack([-np.sin(angles), 2 * np.cos(2 * angles)]).reshape(-1, 2)
    return people, np.arctan2(velocity[:, 1], velocity[:, 0])


def _camera_pose(setting, i, people, time):
    near = people[i % len(people)] if len(people) else np.zeros(2)
    offset = (3.0 + 2 * (i // 4)) * np.array([math.cos(time + 2 * i), math.sin(time + 2 * i)])
    return Pose.level(*(near + offset), setting.uavs[i].altitude)


def _tracks(people, headings, doubt, rng):
    tracks = []
    for j in range(len(people)):
        heading = np.array([np.cos(headings[j]), np.sin(headings[j])])
        mean = np.concatenate([people[j] + rng.normal(0, 0.3, 2), 2 * heading])
        spread = np.diag([1.0, 0.4, 0.5, 0.5]) * doubt[j] ** 2
        turn = np.array([[np.cos(headings[j]), -np.sin(headings[j])], [np.sin(headings[j]), np.cos(headings[j])]])
        spread[:2, :2] = turn @ spread[:2, :2] @ turn.T
        tracks.append(Track(j + 1, Gaussian(mean, spread)))
    return tuple(tracks)


def frames(setting, trees, snapshot):
    return [
        _frame(Camera(math.radians(uav.fov_deg), uav.pixels), pose, trees, snapshot.people)
        for uav, pose in zip(setting.uavs, snapshot.cameras, strict=True)
    ]


def _frame(lens, pose, trees, people):
    image = np.full((lens.pixels, lens.pixels, 3), (150, 132, 104), np.uint8)
    for person in people[~np.isnan(people[:, 0])]:
        uv, _ = lens.project(pose, np.array([[*person, TARGET_HEIGHT]]))
        cv2.circle(image, tuple(int(c) for c in uv[0]), 2, (220, 60, 40), -1)
    for tree in trees.trees:
        uv, _ = lens.project(pose, np.array([[tree.x, tree.y, tree.canopy_top]]))
        radius = lens.focal * tree.canopy_radius / (pose.position[2] - tree.canopy_top)
        cv2.circle(image, tuple(int(c) for c in uv[0]), int(radius), (52, 96, 48), -1)
    return image
