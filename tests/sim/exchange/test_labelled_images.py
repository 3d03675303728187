"""Labelled images: COCO by its own tools, masks by the renderer, shares by a world with one person, YOLO by COCO."""

import dataclasses
import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml
from helpers.flights import filmed, recorded

from sim.exchange.export import write_labelled_images
from sim.exchange.image_labels import read_coco, write_yolo
from sim.exchange.values import SPLITS
from sim.facts.rerender import Rerenderer
from sim.scenario.uavs import Uav
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.distortion import Distortion
from tracking.geometry.visibility import Forest

runs = pytest.importorskip("pycocotools.mask")
COCO = pytest.importorskip("pycocotools.coco").COCO
COCOeval = pytest.importorskip("pycocotools.cocoeval").COCOeval
BELOW = "uavs=[{start=[-28,-2],footprint=30},{start=[-28,1],footprint=20}]"
TILTED = "uavs=[{start=[-40,-8],tilt_deg=25},{start=[-40,8],pixels=96,rate=1}]"


@pytest.fixture(scope="module")
def flights():
    """Two flights of different seeds, and the images of the first, some of them with blur and noise."""
    first, images = filmed("trees.density=75", "appearance.randomise=true", "people.count=12", duration=3)
    return [first, recorded(TILTED, seed=5, duration=2)], images


@pytest.fixture(scope="module")
def out(flights, tmp_path_factory):
    out = tmp_path_factory.mktemp("labels")
    for target in ("coco", "yolo"):
        write_labelled_images(flights[0], target, out / target, splits={5: "test"})
    return out


def load(path):
    return COCO(str(path))


def test_coco_has_the_images_of_the_flight_and_masks_equal_the_renderers(flights, out):
    (first, second), images = flights
    seen = 0
    for flight, split in ((first, "train"), (second, "test")):
        coco = load(out / "coco" / "annotations" / f"instances_{split}.json")
        frames = {(image["time_s"], image["uav"]): image for image in coco.imgs.values()}
        taken = np.argwhere(flight.frames_taken).tolist()
        assert sorted(frames) == sorted((flight.times[k], i) for k, i in taken)
        with Rerenderer(flight) as again:
            for k, i in taken:
                image, rendered = frames[flight.times[k], i], again.rendered(k, i)
                path = out / "coco" / "images" / split / image["file_name"]
                stored = cv2.imread(str(path))[..., ::-1]
                assert (image["height"], image["width"]) == stored.shape[:2] == rendered.people.shape
                assert stored.tobytes() == (images[k][i] if flight is first else rendered.image).tobytes()
                people = np.full(rendered.people.shape, -1)
                for annotation in coco.imgToAnns[image["id"]]:
                    mask = coco.annToMask(annotation) == 1
                    assert np.all(people[mask] == -1)
                    people[mask] = annotation["person"]
                    assert annotation["area"] == mask.sum() == flight.visible[k, i, annotation["person"]]
                    seen += 1
                np.testing.assert_array_equal(people, rendered.people)
    assert seen > 80


def test_boxes_and_areas_are_those_of_the_masks_by_pycocotools(out):
    coco = load(out / "coco" / "annotations" / "instances_train.json")
    for annotation in coco.anns.values():
        code = coco.annToRLE(annotation)
        assert annotation["bbox"] == runs.toBbox(code).tolist() and annotation["area"] == runs.area(code)
        assert annotation["iscrowd"] == 0 and coco.cats[annotation["category_id"]]["name"] == "person"


@pytest.mark.parametrize("split", SPLITS)
def test_labels_of_a_single_split_have_what_their_tools_want(flights, tmp_path, split):
    for target in ("yolo", "coco"):
        write_labelled_images(flights[0][1:], target, tmp_path / target, splits={5: split}, every=5)
    data = yaml.safe_load((tmp_path / "yolo" / "data.yaml").read_text())
    assert data == {"names": {0: "person"}, **dict.fromkeys({"train", "val", split}, f"images/{split}")}
    load(tmp_path / "coco" / "annotations" / f"instances_{split}.json").info()


@pytest.mark.parametrize("size", [(128, 128), (640, 480), (333, 1001), (4000, 3000)])
def test_boxes_of_yolo_stay_inside_the_image(tmp_path, size):
    width, height = size
    spans = [[(0, n) for n in (1, 2, 5, 7)] + [(edge - n, n) for n in (1, 3, 7)] + [(0, edge)] for edge in size]
    boxes = [(left, top, w, h) for left, w in spans[0] for top, h in spans[1]]
    people = [SimpleNamespace(box=box) for box in boxes]
    camera = SimpleNamespace(size=np.array(size))
    write_yolo([SimpleNamespace(split="train", name="a", people=people, camera=camera)], tmp_path)
    rows = [line.split()[1:] for line in (tmp_path / "labels" / "train" / "a.txt").read_text().splitlines()]
    for kind in (np.float64, np.float32):
        middles, halves = np.array(rows, dtype=kind)[:, :2], np.array(rows, dtype=kind)[:, 2:] / 2
        assert (middles - halves).min() >= 0 and (middles + halves).max() <= 1
        pixels = np.hstack([middles - halves, 2 * halves]) * np.array([width, height] * 2)
        np.testing.assert_allclose(pixels, boxes, atol=0.01)


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_the_labels_as_results_have_a_precision_of_one(out, kind):
    coco = load(out / "coco" / "annotations" / "instances_train.json")
    of_kind = {"bbox": lambda a: {"bbox": a["bbox"]}, "segm": lambda a: {"segmentation": coco.annToRLE(a)}}[kind]
    results = [
        {**{key: a[key] for key in ("image_id", "category_id")}, "score": 1.0, **of_kind(a)} for a in coco.anns.values()
    ]
    judged = COCOeval(coco, coco.loadRes(results), kind)
    judged.evaluate()
    judged.accumulate()
    judged.summarize()
    assert judged.stats[0] == 1.0 and judged.stats[8] == 1.0


def test_the_visible_share_is_that_of_the_person_alone_in_the_world(flights, out):
    (first, _), _ = flights
    coco = load(out / "coco" / "annotations" / "instances_train.json")
    shares = []
    for annotation in list(coco.anns.values())[::7]:
        image, m = coco.imgs[annotation["image_id"]], annotation["person"]
        k, i = int(np.flatnonzero(first.times == image["time_s"])[0]), image["uav"]
        with World(first.setting, Forest(()), 1, first.seed) as world:
            world.place_people(first.people[k, [m]], first.headings[k, [m]])
            world.place_uavs([Pose.level(1000.0 + 10 * j, 0.0, 20.0) for j in range(len(first.setting.uavs))])
            alone = Renderer(world).render(first.setting.uavs[i].true_camera, first.camera_at(k, i)).people
        assert annotation["visible_share"] == annotation["area"] / np.sum(alone == 0)
        shares.append(annotation["visible_share"])
    assert len(shares) > 10 and min(shares) < 0.9 and max(shares) == 1.0


def test_the_whole_of_a_person_behind_another_is_what_it_shows_alone(flights):
    (_, tilted), _ = flights
    pose, people = tilted.camera_at(0, 0), np.full_like(tilted.people, np.nan)
    towards = tilted.setting.uavs[0].true_camera.ground_points(pose, np.array([[64.0, 64.0]]))[0]
    people[:, 0], people[:, 1] = towards, towards + np.array([0.4, 0.0])  # the camera looks east
    one = np.where([[False], [True], [False], [False]], people, np.nan)
    both, alone = (dataclasses.replace(tilted, people=p) for p in (people, one))
    with Rerenderer(both) as again, Rerenderer(alone) as single:
        shown, whole = (np.sum(r.rendered(0, 0).people == 1) for r in (again, single))
        assert 0 < shown < whole == again.count_whole(0, 0, 1)


def test_the_whole_of_a_person_below_another_uav_is_what_it_shows_without_it():
    recording = recorded(BELOW, "trees.density=0", duration=1)
    pose, camera = recording.camera_at(0, 0), recording.setting.uavs[0].true_camera
    people = np.full_like(recording.people, np.nan)
    people[:, 0] = camera.ground_points(pose, camera.project(pose, recording.poses[0, 1, :3])[0], 1.0)[0]
    covered = dataclasses.replace(recording, people=people)
    with Rerenderer(covered) as again:
        shown, whole = np.sum(again.rendered(0, 0).people == 0), again.count_whole(0, 0, 0)
        assert shown < whole and whole > 5


@pytest.mark.parametrize(
    "lens",
    [
        Distortion.of("plumb_bob", (-0.3, 0.08, 0.001, -0.002, 0.0)),
        Distortion.of("rational_polynomial", (0.4, -0.3, 0.001, -0.002, 0.1, 0.6, -0.2, 0.05)),
        Distortion.of("equidistant", (0.05, -0.02, 0.01, 0.0)),
    ],
)
def test_labels_of_a_lens_that_bends_agree_with_opencv(flights, tmp_path, monkeypatch, lens):
    camera = Camera.calibrated(160, 120, (130.0, 128.0), (82.0, 58.0), lens)
    monkeypatch.setattr(Uav, "true_camera", camera)
    write_labelled_images(flights[0][:1], "coco", tmp_path / "coco", splits={}, every=0.4)
    coco, checked = load(tmp_path / "coco" / "annotations" / "instances_train.json"), 0
    for annotation in coco.anns.values():
        image = coco.imgs[annotation["image_id"]]
        assert (image["width"], image["height"]) == (160, 120) and coco.annToMask(annotation).shape == (120, 160)
        left, top, width, height = annotation["bbox"]
        if annotation["visible_share"] < 1.0 or left * top == 0 or left + width == 160 or top + height == 120:
            continue
        lens = image["intrinsics"]
        K = np.array([[lens["fx"], 0, lens["cx"] - 0.5], [0, lens["fy"], lens["cy"] - 0.5], [0, 0, 1]])
        position, quaternion = (np.array(part) for part in image["pose"].values())
        body = Pose(position, quaternion).rotation.T @ (np.array([*annotation["place_m"], 0.85]) - position)
        project = cv2.fisheye.projectPoints if lens.get("distortion_model") == "equidistant" else cv2.projectPoints
        (((u, v),),), _ = project(
            (body * (1, -1, -1))[None, None], np.zeros(3), np.zeros(3), K, np.array(lens["distortion"])
        )
        assert left - 1 <= u + 0.5 <= left + width + 1 and top - 1 <= v + 0.5 <= top + height + 1
        checked += 1
    assert checked > 10


def test_the_labels_of_a_flight_are_read_as_detections(flights, out, tmp_path):
    dataset = json.loads((out / "coco" / "annotations" / "instances_train.json").read_text())
    (tmp_path / "images.json").write_text(json.dumps(dataset))
    (tmp_path / "results.json").write_text(json.dumps(dataset["annotations"]))
    read, (first, _) = read_coco(tmp_path), flights[0]
    frames = {uav: camera.frames for uav, camera in read.items()}
    assert {uav: len(found) for uav, found in frames.items()} == {i: len(first.times) for i in range(3)}
    for uav, found in frames.items():
        assert [len(frame.detections) for frame in found] == np.sum(first.visible[:, uav] > 0, axis=1).tolist()


def test_equal_flights_give_equal_bytes_with_images_as_far_apart_as_asked(flights, tmp_path):
    for name in ("one", "two"):
        write_labelled_images(flights[0][1:], "coco", tmp_path / name, splits={5: "val"}, every=0.5)
    files = [path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*")]
    assert len(files) == 1 + 4 + 3  # of two cameras, the second of which takes a frame each second
    assert all((tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes() for file in files)


def test_each_file_lists_its_flights(flights, out):
    for n, (flight, split) in enumerate(zip(flights[0], ("train", "test"), strict=True)):
        dataset = json.loads((out / "coco" / "annotations" / f"instances_{split}.json").read_text())
        (listed,) = dataset["flights"]
        assert listed["id"] == n and listed["seed"] == flight.seed and listed["planner"] == flight.planner
        assert listed["scenario"] == json.loads(flight.scenario)
        assert {image["flight"] for image in dataset["images"]} == {n}
    assert len([*(out / "coco" / "annotations").iterdir()]) == 2


def test_yolo_has_the_boxes_of_coco_in_shares_of_the_image(out):
    data = yaml.safe_load((out / "yolo" / "data.yaml").read_text())
    splits = {"train": "images/train", "test": "images/test", "val": "images/train"}  # its tools want one for `val`
    assert data == {**splits, "names": {0: "person"}}
    for split in ("train", "test"):
        coco = load(out / "coco" / "annotations" / f"instances_{split}.json")
        folder = out / "yolo" / "labels" / split
        assert len(list(folder.iterdir())) == len(coco.imgs)
        for image in coco.imgs.values():
            name, size = image["file_name"], np.array([image["width"], image["height"]] * 2)
            assert (out / "yolo" / "images" / split / name).read_bytes() == (
                out / "coco" / "images" / split / name
            ).read_bytes()
            rows = [line.split() for line in (folder / f"{name[:-4]}.txt").read_text().splitlines()]
            boxes = np.array([[float(part) for part in row[1:]] for row in rows]).reshape(-1, 4) * size
            boxes[:, :2] -= boxes[:, 2:] / 2
            expected = np.array([a["bbox"] for a in coco.imgToAnns[image["id"]]]).reshape(-1, 4)
            np.testing.assert_allclose(boxes, expected, atol=1e-3)
            assert {row[0] for row in rows} <= {"0"}
