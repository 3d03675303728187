"""Cost of bags; docs/results/benchmarks.md says how to run this."""

import pytest
from helpers import timing

import understory
from sim.exchange.export import export

pytest.importorskip("rosbags")
LONGEST, LARGEST = 3.0, 10e6  # s of one core, bytes


def test_bag_of_a_mission_of_40_s_with_three_cameras(judged, tmp_path):
    recording = understory.run("forest", "greedy", seed=3, settings={"duration": 40.0 if judged else 0.4}).recording
    outs = iter(range(9))
    (spent,) = timing.least(lambda: export(recording, "rosbag", tmp_path / str(next(outs))), rounds=3 if judged else 1)
    size = sum(path.stat().st_size for path in (tmp_path / "0").rglob("*") if path.is_file())
    print(f"\nbag of {recording.times[-1]:g} s in {spent:.1f} s, {size / 1e6:.1f} MB")
    assert not judged or (spent <= LONGEST and size <= LARGEST)
