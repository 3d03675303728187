"""Cost of labelled images; docs/results/benchmarks.md says how to run this."""

import time

import pytest

import understory
from sim.exchange.export import write_labelled_images

MOST = 10.0  # s of one core for 1000 images


@pytest.mark.parametrize("target", ["coco", "yolo"])
def test_a_thousand_labelled_images(judged, tmp_path, target):
    """Of the default mission with three cameras of 128 pixels, in random appearance; the world is made, too."""
    settings = {"appearance.randomise": True, "sensing.mode": "ideal", "duration": 66.6 if judged else 0.4}
    recording = understory.run("forest", "greedy", seed=0, settings=settings).recording
    start = time.process_time()
    write_labelled_images([recording], target, tmp_path / "out", splits={})
    spent, count = time.process_time() - start, len(list((tmp_path / "out" / "images").rglob("*.png")))
    assert count == recording.frames_taken.sum()
    people = int((recording.visible > 0).sum())
    print(f"\n{target}: {count} images with {people} people in {spent:.1f} s, {1e3 * spent / count:.1f} ms each")
    assert not judged or (count >= 1000 and spent <= MOST)
