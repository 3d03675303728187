"""Results in COCO's format as detections of a flight."""

import json
import re

import numpy as np
import pytest

from sim.exchange.scanned_flight import read_flight
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT

IMAGES = [{"id": 7 - k, "time_s": 0.5 * k, "width": 640, "height": 480, "file_name": f"{k}.png"} for k in range(4)]


def write(folder, images, results):
    (folder / "poses.csv").write_text("time_s,x_m,y_m,z_m\n0,0,0,30\n2,0,0,30\n")
    (folder / "cameras.csv").write_text("fov_deg,pixels\n50,480\n")
    (folder / "images.json").write_text(json.dumps({"images": images, "categories": []}))
    (folder / "results.json").write_text(json.dumps(results))
    return folder


def test_boxes_become_places_in_the_frames_of_their_images(tmp_path):
    camera, pose = Camera(np.radians(50), 480), Pose.level(0.0, 0.0, 30.0)
    place = np.array([[4.0, -6.0]])
    u, v = camera.project(pose, np.column_stack([place, [[TARGET_HEIGHT]]]))[0][0].tolist()
    box = [u + 80 - 5, v - 15, 10, 30]  # the square begins at column 80
    log = read_flight(write(tmp_path, IMAGES, [{"image_id": 5, "category_id": 1, "bbox": box, "score": 0.9}]))
    assert log.setting.rates.sensing == 2 and log.frames.all() and len(log.frames) == 4
    assert [len(log.observed[k, 0].scan.measurements) for k in range(4)] == [0, 0, 1, 0]
    np.testing.assert_allclose(log.observed[2, 0].scan.measurements, place, atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_json_of_any_program_is_read(tmp_path, encoding):
    images = [{**image, "file_name": "Wäldchen.png"} for image in IMAGES]
    folder = write(tmp_path, images, [{"image_id": 5, "bbox": [300, 200, 10, 30]}])
    for name in ("images.json", "results.json"):
        path = folder / name
        text = json.dumps(json.loads(path.read_text()), ensure_ascii=False)
        path.write_bytes(text.encode(encoding))
    assert len(read_flight(folder).observed[2, 0].scan.measurements) == 1


WRONG = {
    "unknown image": (IMAGES, [{"image_id": 99, "bbox": [1, 2, 3, 4]}], "image_id 99 is not in images.json"),
    "no time": ([{"id": 1, "width": 9, "height": 9}], [], "images.json: Object missing required field `time_s`"),
    "not the camera's": ([{**IMAGES[0], "height": 500}], [], "images have 640 × 500 pixels, but the camera in cameras"),
}


@pytest.mark.parametrize(("images", "results", "complaint"), WRONG.values(), ids=WRONG)
def test_results_that_cannot_be_are_refused_in_one_line(tmp_path, images, results, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(write(tmp_path, images, results))
    assert "\n" not in str(told.value)
