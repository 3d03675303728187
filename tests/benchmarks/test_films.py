"""Costs of the film beside its encoder's, and as fleets grow; docs/results/benchmarks.md says how to run this.

Times are those of the processor, and of several the least counts. In ordinary test runs each comparison runs once, on
little, and its ratio is not judged.
"""

from helpers import synthetic, timing

from sim.views.drawing.film import Film, Video


class Drawn:
    """Pictures in place of a film, so that a video encodes without drawing."""

    def __init__(self, pictures):
        self._pictures = iter(pictures)

    def draw(self, *_):
        return next(self._pictures)


class Mission:
    """Scans and camera images of a made-up mission, and the film of them."""

    def __init__(self, uavs, people, scans, **shape):
        self._setting = synthetic.scenario(uavs, people, **shape)
        self._trees = synthetic.forest(self._setting, 45)
        made = synthetic.snapshots(self._setting, self._trees, scans)
        self.scans = [(snapshot, synthetic.frames(self._setting, self._trees, snapshot)) for snapshot in made]

    def draw(self):
        film = Film(self._setting, self._trees, planner="hover")
        return [film.draw(*scan) for scan in self.scans]

    def write(self, path, film=None):
        with Video(path, film or Film(self._setting, self._trees, planner="hover"), fps=5) as video:
            for scan in self.scans:
                video.add(*scan)


def test_film_beside_the_encoding_of_its_pictures(judged, tmp_path):
    mission = Mission(3, 4, 60 if judged else 3)
    pictures = mission.draw()
    film, encoding = timing.least(
        lambda: mission.write(tmp_path / "film.mp4"),
        lambda: mission.write(tmp_path / "pictures.mp4", Drawn(pictures)),
        rounds=3 if judged else 1,
    )
    print(f"\nfilm {1e3 * film / len(pictures):.1f} ms a picture, {film / encoding:.2f} times its encoding, bound 2.5")
    assert (tmp_path / "film.mp4").read_bytes() == (tmp_path / "pictures.mp4").read_bytes()
    assert not judged or film <= 2.5 * encoding


def test_film_of_a_large_fleet_beside_that_of_a_small_one(judged, tmp_path):
    count = 20 if judged else 2
    small, large = Mission(3, 4, count), Mission(30, 100, count, area=(570.0, 400.0))
    rounds = 3 if judged else 1
    paths = tmp_path / "small.mp4", tmp_path / "large.mp4"
    one, other = timing.least(lambda: small.write(paths[0]), lambda: large.write(paths[1]), rounds=rounds)
    print(f"\nfilm of 30 UAVs and 100 people {1e3 * other / count:.1f} ms a picture, {other / one:.2f} times, bound 5")
    assert not judged or other <= 5.0 * one
