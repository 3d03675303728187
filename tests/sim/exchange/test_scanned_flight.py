"""Flights from elsewhere: clocks, gaps, pixels, origins, and inputs that are refused in one line."""

import math
import re

import numpy as np
import pytest

from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.person import TARGET_HEIGHT

SPEED = np.array([1.2, 0.5])  # m/s, of the only person
CLOCKS = {0: np.arange(0, 10, 0.2).tolist(), 1: (0.07 + np.arange(0, 10, 0.5)).tolist()}  # s, of the frames
PLACES = ("time_s,x_m,y_m,z_m", "time_s,uav,x_m,y_m,z_m")
SEEN = "time_s,uav,x_m,y_m"


def walk(times, name, *more):
    """Rows of the person at these times: time, name, place, and more."""
    return [",".join(map(str, (t, name, *(SPEED * t).tolist(), *more))) for t in times]


@pytest.fixture
def flight(tmp_path):
    """Writes a flight, and returns its folder: lines of files by name, of a person below two UAVs unless changed."""

    def write(**changes):
        logged = np.arange(-1, 11, 0.37).tolist()
        files = {
            "poses": [PLACES[1], *(f"{t},{i},{2 * i + t},0,{20 + i}" for i in (0, 1) for t in logged)],
            "detections": [f"{SEEN},xx_m2,xy_m2,yy_m2"],
            "cameras": ["uav,fov_deg,pixels", "0,60,128", "1,60,128"],
        }
        for i, times in CLOCKS.items():
            files["detections"] += walk(times, i, 0.01, 0, 0.01)
        for name, lines in (files | changes).items():
            (tmp_path / (name.replace("_", ".") if "_" in name else f"{name}.csv")).write_text("\n".join(lines) + "\n")
        return tmp_path

    return write


def test_two_clocks_meet_on_scans_of_a_rate_that_fits_both(flight):
    log = read_flight(flight())
    times = np.array(log.setting.scan_times)
    assert log.setting.rates.sensing == 20 and len(times) == len(log.frames)
    for i, own in CLOCKS.items():
        np.testing.assert_allclose(times[log.frames[:, i]], own, rtol=0, atol=0.025 + 1e-9)
    # Poses are those of the frame's own time.
    k = int(np.flatnonzero(log.frames[:, 1])[3])
    np.testing.assert_allclose(log.poses[k, 1], [2 + 1.57, 0, 21, 0, 0, 0, 1], atol=1e-9)
    recording = track_flight(log).recording
    assert len({track.id for k in range(20, len(times)) for track in recording.tracks_at(k, 0)}) == 1
    (last,) = recording.tracks_at(len(times) - 1, 1)
    np.testing.assert_allclose(last.belief.mean, [*SPEED * times[-1], *SPEED], atol=0.2)
    assert any("frames are at scans of 20 Hz, 20 ms or less" in remark for remark in log.remarks)


def test_a_clock_that_is_wrong_by_a_known_time_is_set_right(flight):
    log = read_flight(flight(cameras=["uav,fov_deg,pixels,clock_offset_s", "0,60,128,", "1,60,128,-0.07"]))
    assert log.setting.rates.sensing == 10 and log.frames[::5, 1].sum() == 20
    np.testing.assert_allclose(log.poses[5, 1, 0], 2 + 0.5 + 0.07, atol=1e-9)


def test_pixels_become_places_on_the_ground_with_covariances_of_the_camera(flight):
    camera, pose = Camera(math.radians(60), 128), Pose.level(1.0, 2.0, 20.0)
    places = np.array([(2.0, 3.0), (-4.0, 6.0)])
    pixels = camera.project(pose, np.column_stack([places, np.full(2, TARGET_HEIGHT)]))[0].tolist()
    rows = ["time_s,u_px,v_px", *(f"{t},{u},{v}" for t in (0, 1) for u, v in pixels), "2,,"]
    poses = [PLACES[0], "0,1,2,20", "2,1,2,20"]
    folder = flight(detections=rows, poses=poses, cameras=["fov_deg,pixels", "60,128"])
    first, _, third = (scans[0] for scans in read_flight(folder).scans())
    np.testing.assert_allclose(first.measurements, places, atol=1e-9)
    assert (np.linalg.eigvalsh(first.covariances) > 1e-4).all() and len(third.measurements) == 0
    assert any(
        "get 0.0" in remark and "--sigma adds errors of poses" in remark for remark in read_flight(folder).remarks
    )
    wide = read_flight(folder, sigma=1.5)
    assert not any("--sigma" in remark for remark in wide.remarks)
    wider = next(wide.scans())[0]
    np.testing.assert_allclose(wider.covariances - first.covariances, np.tile(2.25 * np.eye(2), (2, 1, 1)), atol=1e-12)


def test_projected_coordinates_have_an_origin(flight):
    far = flight(
        poses=[PLACES[0], "0,457100,5428300,30", "3,457100,5428300,30"],
        detections=["time_s,x_m,y_m", "0,457101,5428302", "1,,"],
        cameras=["fov_deg,pixels", "60,512"],
        trees=["x,y,crown_radius,crown_base,height,trunk_radius", "457110,5428310,3,2,9,0.2"],
    )
    with pytest.raises(InputError, match=r"9000 m or more from the origin; .* --origin 457100,5428300"):
        read_flight(far)
    log = read_flight(far, origin=(457100, 5428300))
    assert log.observed[0, 0].scan.measurements.tolist() == [[1, 2]]
    assert log.forest.table[:, :2].tolist() == [[10, 10]]
    assert (log.setting.area.width, log.setting.area.height) == (40, 40)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "cp1252"])
def test_files_are_read_in_the_encodings_of_spreadsheets(flight, encoding):
    folder = flight(cameras=["uav,fov_deg,pixels,Größe", "0,60,128,1 Stück", "1,60,128,"])
    plain = read_flight(folder)
    for path in folder.glob("*.csv"):
        path.write_text(path.read_text(), encoding=encoding)
    np.testing.assert_array_equal(read_flight(folder).poses, plain.poses)


def test_labels_give_metrics_and_may_begin_tracks(flight):
    folder = flight(truth=["time_s,id,x_m,y_m", *walk(np.arange(0, 10.5, 0.5).tolist(), "a")])
    outcome = track_flight(read_flight(folder))
    recording = outcome.recording
    assert recording.labelled and recording.people.shape[1] == 1
    assert recording.matched[recording.frames_taken].mean() > 0.95 and outcome.scores[0].held.mean() > 0.95
    assert 0 < np.nanmedian(recording.ospa[..., 0]) < 0.2
    known = track_flight(read_flight(folder, overrides=["tracking.initial_tracks=known"])).recording
    assert len(known.tracks_at(0, 0)) == 1 and len(recording.tracks_at(0, 0)) == 0


STILL = {"poses": [PLACES[0], "0,1,2,20"], "cameras": ["fov_deg,pixels", "60,128"]}
TIMES = [0.0, 0.1, 3.0, 4.0, 6.0, 7.0]  # s
# Lines of poses.csv, and where its camera is at `TIMES`.
LOGS = {
    "a still camera": (["0,1,2,20"], [1] * 6),
    "equal rows": (
        ["0,1,2,20", "0,1,2,20", "0.0,1.0,2,20", "7,8,2,20", "4,5,2,20", "4,5,2,20", "2,3,2,20"],
        [1, 1.1, 4, 5, 7, 8],
    ),
    "a hover": (["0,1,2,20", "6,1,2,20", "7,2,2,20"], [1, 1, 1, 1, 1, 2]),
    "a hover with rounding": (["0,1,2,20", "6,1.0002,2,20", "7,1,2,20"], [1] * 6),
}


@pytest.mark.parametrize("name", LOGS)
def test_equal_poses_are_one_and_a_camera_may_stand_still(flight, name):
    lines, east = LOGS[name]
    seen = ["time_s,x_m,y_m", *(f"{t},1,2" for t in TIMES)]
    log = read_flight(flight(**STILL | {"poses": [PLACES[0], *lines], "detections": seen}))
    np.testing.assert_allclose(log.poses[log.frames[:, 0], 0, 0], east, atol=2e-4)


CAMERAS = {
    "the shorter edge": ("fov_deg,pixels,width_px,height_px", "40,1080,1920,1080", 1920, 1080, "span 65.8 × 40.0 deg"),
    "a crop": (
        "fov_deg,pixels,width_px,height_px",
        "40,540,1920,1080",
        1920,
        1080,
        "40 is over 540 pixels in the middle",
    ),
    "upright": ("fov_deg,pixels,width_px,height_px", "40,1080,1080,1920", 1080, 1920, "span 40.0 × 65.8 deg"),
    "the width": ("hfov_deg,width_px,height_px", "65.8,1920,1080", 1920, 1080, ""),
    "the height": ("vfov_deg,width_px,height_px", "39.99,1920,1080", 1920, 1080, ""),
    "the diagonal": ("dfov_deg,width_px,height_px", "73.17,1920,1080", 1920, 1080, ""),
    "a sensor": ("focal_mm,sensor_width_mm,width_px,height_px", "8.5016,11,1920,1080", 1920, 1080, ""),
    "square": ("fov_deg,pixels,width_px,height_px", "40,1080,,", 1080, 1080, ""),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_says_which_edge_its_angle_is_over(flight, name):
    header, row, width, height, remark = CAMERAS[name]
    log = read_flight(flight(**STILL | {"cameras": [header, row], "detections": ["time_s,x_m,y_m", "0,1,2"]}))
    (camera,) = log.cameras
    slopes = camera.slopes(np.array([[0.0, height / 2], [width / 2, 0.0]]))
    spans = 2 * np.degrees(np.arctan(-slopes[[0, 1], [0, 1]]))
    focal = 1920 / 2 / math.tan(math.radians(65.8 / 2)) if name != "a crop" else 270 / math.tan(math.radians(20))
    np.testing.assert_allclose(spans, [2 * math.degrees(math.atan(e / 2 / focal)) for e in (width, height)], atol=0.02)
    told = [text for text in log.remarks if text.startswith("cameras: UAV 0: fov_deg")]
    assert remark in told[0] if remark else not told


LENS = "width = 1920\nheight = 1080\nhfov_deg = 65.8"
BESIDE = {  # columns beside that of the camera's file, which has 1080 pixels over 40 degrees, and what contradicts it
    ("fov_deg", "pixels"): [
        "40,1080,",
        "66,1920,",
        "65.8,,",
        ",,",
        "40,,fov_deg",
        "84,1920,fov_deg",
        "65.8,4000,pixels",
    ],
    ("width_px", "height_px"): ["1920,1080,", "1280,720,width_px", "1920,1200,height_px"],
    ("hfov_deg", "width_px"): ["65.8,1920,", "40,,hfov_deg"],
}


@pytest.mark.parametrize("columns", BESIDE)
def test_columns_beside_a_camera_of_a_file_agree_with_it_or_are_refused(flight, columns):
    seen = {**STILL, "detections": ["time_s,x_m,y_m", "0,1,2"], "lens_toml": [LENS]}
    plain = read_flight(flight(**seen | {"cameras": ["camera", "lens.toml"]}))
    for *entries, wrong in (row.split(",") for row in BESIDE[columns]):
        folder = flight(**seen | {"cameras": [",".join([*columns, "camera"]), ",".join([*entries, "lens.toml"])]})
        if wrong:
            with pytest.raises(InputError, match=rf"line 2, column {wrong}: .* is not that of the camera, which has"):
                read_flight(folder)
        else:
            log = read_flight(folder)
            assert log.cameras == plain.cameras and log.remarks == plain.remarks


def test_what_is_given_and_not_used_is_told(flight):
    exact = [f"{SEEN},xx_m2,xy_m2,yy_m2", *walk(CLOCKS[0], 0, 0.01, 0, 0.01), *walk(CLOCKS[1], 1, 0.01, 0, 0.01)]
    told = read_flight(flight(detections=exact), sigma=1.5).remarks
    assert "--sigma: not used: all detections have covariances of their own" in told
    some = [line.replace(",0.01,0,0.01", ",,,") if k % 7 else line for k, line in enumerate(exact)]
    assert not any("--sigma" in line for line in read_flight(flight(detections=some), sigma=1.5).remarks)
    told = read_flight(flight(images=["time_s,uav,file", "0,0,a.png"])).remarks
    assert "detections: not used: images.csv, as there is detections.csv" in told


def above(row, header=PLACES[1]):
    """Lines of two poses of each UAV, from a row with the time {t} and the UAV {i}."""
    return {"poses": [header, *(row.format(t=t, i=i) for t in (0, 9) for i in (0, 1))]}


TURNED = above("{t},{i},0,0,20,1,0,0,0", f"{PLACES[1]},qx,qy,qz,qw")
REFUSED = {
    "are these nanoseconds?": {"detections": [SEEN, "0,0,1,1", "200000000,0,1,1", "0,1,1,1"]},
    "16.7 s apart, and begin at 1764376351000 s; are these milliseconds?": {
        "detections": [SEEN, *(f"{1764376351000 + k / 0.06},{i},1,1" for k in range(9) for i in (0, 1))]
    },
    "no pose within 2 s; its poses are from 1700000000 to 1700000009 s": above("170000000{t},{i},0,0,20"),
    "poses.csv, line 4, column uav: UAV 0 has another pose at 0 s in line 2; number the UAVs apart": {
        "poses": [PLACES[1], "0,0,0,0,20", "9,0,0,0,20", "0,0,9,0,20"]
    },
    "only one of its poses and its cameras has UAV 1": {"poses": [PLACES[1], "0,0,0,0,20"]},
    "line 3: pixel (600, 64) of UAV 1 is outside its image of 128 × 128 pixels; does cameras.csv": {
        "detections": ["time_s,uav,u_px,v_px", "0,0,64,64", "0,1,600,64"]
    },
    "UAV 0 has two frames 0.2 s apart, at 0 s, in one scan of 2 Hz": {"scenario_toml": ["rates.sensing = 2"]},
    "UAV 0 has a frame at 4 s, but no pose within 2 s, and moves there; give a pose every 2 s": {
        **STILL,
        "poses": [PLACES[0], "0,1,2,20", "8,2,2,20"],
        "detections": ["time_s,x_m,y_m", "0,1,2", "4,1,2", "8,1,2"],
    },
    "all 3 are above the horizon, or where a lens shows nothing; pitch_deg is -90 straight down, and": {
        **STILL,
        "poses": [f"{PLACES[0]},pitch_deg", "0,1,2,20,0"],
        "detections": ["time_s,u_px,v_px", "0,64,10", "0,64,20", "0.5,64,5"],
    },
    "line 2: pixels: 1920 is more than an edge of the images of 1920 × 1080 pixels; fov_deg is over a square of "
    "this edge in their middle; if 84 is over the width, call it hfov_deg": {
        **STILL,
        "cameras": ["fov_deg,pixels,width_px,height_px", "84,1920,1920,1080"],
    },
    "columns qx, qy, qz, qw belong together; one": {**STILL, "poses": [f"{PLACES[0]},qx,qy", "0,1,2,20,0,0"]},
    "column height_px is missing": {**STILL, "cameras": ["hfov_deg,width_px", "60,1920"]},
    "line 2: fov_deg: 0.0 is not allowed": {**STILL, "cameras": ["fov_deg,pixels,width_px,height_px", "0,9,18,9"]},
    "line 2, column pixels: 4000 is not that of the camera, which has 1920; leave it out": {
        **STILL,
        "cameras": ["hfov_deg,pixels,width_px,height_px", "65,4000,1920,1080"],
    },
    "scale: 1 gives images of 12000 pixels": {
        **STILL,
        "cameras": ["fov_deg,pixels,width_px,height_px", "60,4000,12000,4000"],
    },
    "hfov_deg: fov_deg is given as well; allowed is one of them": {
        **STILL,
        "cameras": ["fov_deg,pixels,hfov_deg,width_px,height_px", "60,1080,90,1920,1080"],
    },
    "line 2: hfov_deg: 200.0 is not allowed": {
        **STILL,
        "cameras": ["hfov_deg,width_px,height_px", "200,1920,1080"],
    },
    "UAV 0, column z_m: is 0 m in the median": above("{t},{i},0,0,0"),
    "UAV 0, column z_m: is 20000 m in the median; heights are in metres": above("{t},{i},0,0,20000"),
    "one frame of a UAV; are times in seconds?": {**STILL, "detections": [SEEN, "45000.1,0,1,1", "45000.100001,0,1,1"]},
    "line 2: fov_deg: 180.0 is not allowed": {**STILL, "cameras": ["fov_deg,pixels", "180,128"]},
    "looks above the horizon in each of its 2 frames; quaternions are xyzw": {
        **TURNED,
        "detections": [SEEN, "0,0,,", "0,1,,", "0.2,0,,"],
    },
}


@pytest.mark.parametrize("complaint", REFUSED)
def test_a_flight_that_cannot_be_is_refused_in_one_line(flight, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(flight(**REFUSED[complaint]))
    assert "\n" not in str(told.value)


def test_a_folder_without_a_flight_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"^FLIGHT: .*nowhere is not a folder; expected one with poses.csv"):
        read_flight(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"^cameras: .*cameras.csv cannot be read: No such file"):
        read_flight(tmp_path)
