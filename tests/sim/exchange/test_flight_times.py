"""No frame of a flight is lost without a word, at any epoch and rate; people are there at each frame with a label."""

import numpy as np
import pytest

from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight

POSIX = 1_764_376_351.0
STEPS = np.random.default_rng(0).uniform(0.05, 1.3, 40)
# Times of frames [s], from the first one on.
TIMES = {
    **{f"{rate} Hz": np.arange(20) / rate for rate in (0.3, 1, 5, 9.7, 10, 29.97, 30, 59.94, 120)},
    "uneven": np.cumsum(STEPS),
    "six frames": 0.517 * np.arange(6),
    "in whole milliseconds": (np.arange(60) / 30).round(3),
    "with a gap": np.array([0.0, 0.2, 0.4, 7.31, 7.51]),
    "one": np.zeros(1),
}


def write(folder, times, truth=True):
    """A camera that stands still above somebody who walks, with labels at the times of frames."""
    places = [f"{t!r},{t % 7},1" for t in times.tolist()]
    files = {
        "poses": ["time_s,x_m,y_m,z_m", f"{times[0]},3,0,25"],
        "detections": ["time_s,x_m,y_m", *places],
        "cameras": ["fov_deg,pixels", "60,128"],
    }
    if truth and len(times) > 1:
        files["truth"] = ["time_s,id,x_m,y_m", *(f"{t!r},a,{0.5 * (t - times[0])},1" for t in times.tolist())]
        files["detections"][1:] = [f"{t!r},{0.5 * (t - times[0])},1" for t in times.tolist()]
    for name, lines in files.items():
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize("epoch", [0.0, 1e5 + 1 / 3, POSIX])
@pytest.mark.parametrize("name", TIMES)
def test_each_frame_has_a_scan(tmp_path, name, epoch):
    log = read_flight(write(tmp_path, epoch + TIMES[name]))
    scans = np.flatnonzero(log.frames[:, 0])
    assert len(scans) == len(TIMES[name])
    np.testing.assert_allclose(scans / log.setting.rates.sensing, TIMES[name] - TIMES[name][0], atol=0.0251, rtol=0)
    assert len(log.frames) in (scans[-1] + 1, 2) and not any("duration" in remark for remark in log.remarks)
    if log.people:
        recording = track_flight(log).recording
        assert recording.matched[scans, 0, 0].all() and not np.isnan(recording.people[scans]).any()


def test_frames_after_a_given_end_are_counted_in_a_remark(tmp_path):
    folder = write(tmp_path, POSIX + np.arange(20) / 5)
    log = read_flight(folder, overrides=["duration=3"])
    assert log.frames.sum() == 16 and "duration: left out: 4 frames after 3 s" in log.remarks
    log = read_flight(folder, overrides=["duration=3.6"])
    assert log.frames.sum() == 19 and "duration: left out: 1 frame after 3.6 s" in log.remarks
