"""An episode shows the last frame of each camera, and leaves no world behind if it cannot begin."""

import numpy as np
import pytest
from helpers.clients import open_clients
from helpers.flights import fly

from sim.environments.episode import Episode
from sim.scenario.loading import load_scenario
from sim.views.drawing.film import Film, lay_out_parts


def test_an_episode_closes_its_world_if_its_first_scan_fails(monkeypatch):
    def failing(self):
        raise MemoryError

    monkeypatch.setattr(Episode, "_keep_frames", failing)
    before = open_clients()
    with pytest.raises(MemoryError):
        Episode(load_scenario("forest", ["duration=2", "sensing.mode=ideal"]), 0, 0)
    assert open_clients() == before


@pytest.mark.parametrize("drawn", [(0, 2, 4, 6), (4, 6), (6,)])
def test_a_slow_camera_shows_the_frame_it_took_between_two_decisions(drawn):
    """As the film of the mission does, whichever decisions are drawn."""
    options = ["duration=1", "rates.sensing=6", "rates.planning=3", "uavs.0.rate=2"]
    options.append("dynamics=kinematic")
    frames, tiles = [], []
    mission, snapshots = fly(*options, see=lambda mission: frames.append(list(mission.images)))
    film = Film(mission.scenario, mission.forest, planner="hover")
    boxes = lay_out_parts(mission.scenario).tiles.values()
    for snapshot, images in zip(snapshots, frames, strict=True):
        image = film.draw(snapshot, images)
        tiles.append([image[box.slices] for box in boxes])
    episode = Episode(load_scenario("forest", options), 0, 0)
    for k in range(0, 7, 2):
        assert round(6 * episode.now.time) == k
        if k in drawn:
            image = episode.draw()
            for box, tile in zip(boxes, tiles[k], strict=True):
                np.testing.assert_array_equal(image[box.slices], tile)
        if k < 6:
            episode.step(dict.fromkeys(range(3), np.zeros(2)))
    episode.close()
    assert np.any(tiles[4][0] != tiles[0][0])
