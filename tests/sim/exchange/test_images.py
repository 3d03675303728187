"""Images of a flight through a detector, built-in or a plug-in."""

import re
import shutil
import sys

import cv2
import numpy as np
import pytest

from sim.exchange.export import export
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.facts.rerender import Rerenderer
from sim.mission.archive import load_recording
from sim.mission.trial import Trial
from sim.running.results import run_mission
from sim.scenario.loading import load_scenario
from tracking.detection.blob_detector import BlobDetector
from tracking.errors import InputError

LENS = "{width = 192, height = 128, hfov_deg = 60, distortion = [-0.2, 0.05]}"
SETTINGS = [
    "duration=3",
    "tracking.initial_tracks=none",
    "sensing.noise=camera",
    "uavs.1.rate=1",
    f"uavs.2.camera={LENS}",
]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A mission whose frames are files in place of detections; one camera has wide images, bent by its lens."""
    out = tmp_path_factory.mktemp("images")
    run_mission(Trial(load_scenario("forest", SETTINGS), "greedy", 0), out / "run", video=False)
    recording = load_recording(out / "run" / "mission.npz")
    export(recording, "csv", out / "flight")
    rows = ["time_s,uav,file"]
    with Rerenderer(recording) as again:
        for k, i in np.argwhere(recording.frames_taken).tolist():
            cv2.imwrite(str(out / "flight" / f"{i}-{k}.png"), again.image(k, i)[..., ::-1])
            rows.append(f"{recording.times[k]},{i},{i}-{k}.png")
    for name in ("truth.csv", "tracks.csv", "detections.csv"):
        (out / "flight" / name).unlink()
    (out / "flight" / "images.csv").write_text("\n".join(rows) + "\n")
    return recording, out / "flight"


def test_frames_of_a_mission_as_files_give_its_tracks_byte_for_byte(flight):
    recording, folder = flight
    again = track_flight(read_flight(folder)).recording
    names = ["measurements", "measurement_covariances", "track_ids", "track_means", "track_covariances"]
    assert len(recording.track_ids) > 50
    for name in names:
        assert getattr(recording, name).tobytes() == getattr(again, name).tobytes(), name
    np.testing.assert_array_equal(again.frames_taken, recording.frames_taken)


def test_a_detector_of_ones_own_gets_the_images_and_its_errors_are_one_line(flight, tmp_path, monkeypatch):
    _, folder = flight
    (tmp_path / "mine.py").write_text(
        "import numpy as np\nfrom tracking.detection.detector import Detections\n"
        "class One:\n    def detect(self, frame):\n        assert frame.image.shape[1] == 128 + 64 * (frame.uav == 2)\n"
        "        return Detections(np.array([[64.0, 64.0]]), np.array([[1.0, 2.0]]), np.eye(2)[None])\n"
        "class Bad:\n    def detect(self, frame):\n        raise RuntimeError('no')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)  # another test may have one of this name
    log = read_flight(folder, detector="mine:One")
    scan, pixels = log.observed[0, 0]
    assert scan.measurements.tolist() == [[1.0, 2.0]] and pixels.tolist() == [[64.0, 64.0]]
    with pytest.raises(ValueError, match=r"mine:Bad.* cannot detect people in an image: RuntimeError: no"):
        read_flight(folder, detector="mine:Bad")
    with pytest.raises(InputError, match="'blobb' is unknown"):
        read_flight(folder, detector="blobb")
    sys.modules.pop("mine")


@pytest.mark.parametrize("kind", [np.uint16, np.float32])
def test_images_of_more_than_eight_bits_keep_their_contrast_and_that_is_said(flight, tmp_path, monkeypatch, kind):
    folder, detect, taken, dim = shutil.copytree(flight[1], tmp_path / "flight"), BlobDetector.detect, [], []
    for row in (folder / "images.csv").read_text().splitlines()[1:]:
        path = folder / row.split(",")[2]
        dim.append(7300 + (cv2.imread(str(path)).astype(kind) // 2))
        cv2.imwrite(str(path.with_suffix(".tiff")), dim[-1])
    (folder / "images.csv").write_text((folder / "images.csv").read_text().replace(".png", ".tiff"))
    monkeypatch.setattr(BlobDetector, "detect", lambda self, frame: taken.append(frame.image) or detect(self, frame))
    log = read_flight(folder)
    for image, values in zip(taken, dim, strict=True):
        share = (values - values.min()) / (values.max() - values.min())
        assert image.dtype == np.uint8
        np.testing.assert_allclose(image, 255.0 * share[..., ::-1], atol=0.51)
    (said,) = [text for text in log.remarks if "bits" in text]
    assert said.startswith("images: those of UAVs 0, 1 and 2 have more than 8 bits: in each, the darkest value ")


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("0,0,none.png", "none.png cannot be read: No such file"),
        ("0,0,poses.csv", "column file: "),
        ("0,9,0-0.png", "column uav: UAV 9 has no camera, or no poses"),
        ("0,0,small.png", "images have 50 × 40 pixels, but the camera in cameras.csv has 128; give it 40"),
    ],
)
def test_an_image_that_cannot_be_is_named_in_one_line(flight, tmp_path, row, complaint):
    folder = shutil.copytree(flight[1], tmp_path / "flight")
    cv2.imwrite(str(folder / "small.png"), np.zeros((40, 50, 3), dtype=np.uint8))
    (folder / "images.csv").write_text(f"time_s,uav,file\n{row}\n")
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(folder)
    assert "images.csv, line 2" in str(told.value) and "\n" not in str(told.value)


def test_a_detector_with_a_memory_gets_each_cameras_images_in_order_of_time(flight, tmp_path, monkeypatch):
    _, folder = flight
    (tmp_path / "heeding.py").write_text(
        "from tracking.detection.blob_detector import BlobDetector\n"
        "class Heeding:\n    stateful = True\n"
        "    def reset(self, seed):\n        self.last = None\n"
        "    def detect(self, frame):\n        assert self.last is None or self.last[0] == frame.uav\n"
        "        assert self.last is None or self.last[1] < frame.time\n"
        "        self.last = frame.uav, frame.time\n        return BlobDetector().detect(frame)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    copy = tmp_path / "flight"
    shutil.copytree(folder, copy)
    head, *rows = (copy / "images.csv").read_text().splitlines()
    (copy / "images.csv").write_text("\n".join([head, *reversed(rows)]) + "\n")
    found = read_flight(copy, detector="heeding:Heeding").observed
    assert found.keys() == read_flight(folder, detector="blob").observed.keys()
    assert any(len(scan.measurements) for scan, _ in found.values())
