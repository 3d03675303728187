"""Stone Soup's JPDA keeps to what trackers must, and keeps all people of an open scene."""

import understory


def test_it_conforms() -> None:
    """As `understory check-tracker soup:SoupJPDA` says."""
    for finding in understory.check_tracker("soup:SoupJPDA"):
        assert finding.passed, finding


def test_all_people_of_an_open_scene_are_kept() -> None:
    """Without trees each of four people has a track of one id, within a metre, from the start to the end."""
    settings = {"tracking.tracker": "soup:SoupJPDA", "sensing.mode": "ideal", "trees.density": 0, "duration": 10}
    flight = understory.run("forest", "greedy", settings=settings)
    recording = flight.recording
    assert set(recording.track_ids.tolist()) == {0, 1, 2, 3}
    assert recording.ospa[..., 0].max() < 1.0
