"""Detection of people hidden in part, of touching people and of people in front of a trunk."""

import math
from dataclasses import dataclass

import msgspec
import numpy as np
import pytest
from helpers.frames import WIDE, photographed, touching
from helpers.views import ALTITUDES, CAMERA, SCENARIO, random_forest

from sim.scenario.environment import Appearance
from sim.sensing.detection_truth import match_detections
from sim.sensing.renderer import Renderer
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree

RANDOMISED = msgspec.structs.replace(SCENARIO, appearance=Appearance(randomise=True))
PEOPLE = 8
TREES = ((90, 1.5), (20, 5.0), (60, 2.0), (120, 1.0))
# Points of a body, for its approximate visible share.
BODY = np.array([(x, y, z) for x in (-0.2, 0.0, 0.2) for y in (-0.2, 0.0, 0.2) for z in (0.1, 0.5, 0.9, 1.3, 1.6)])
LOOKS = pytest.mark.parametrize("scenario", [SCENARIO, RANDOMISED], ids=["plain", "randomised"])


@dataclass
class Score:
    """Numbers of selected people, of those found, and of false alarms."""

    people: int = 0
    found: int = 0
    false: int = 0

    def count(self, asked, pixels, mask):
        """Detections at pixels, by the mask of people, in a frame with some people (M,) selected."""
        matched = match_detections(pixels, mask, PEOPLE) >= 0
        self.people += int(asked.sum())
        self.found += int(matched[asked].sum())
        self.false += len(pixels) - int(matched.sum())

    @property
    def recall(self):
        return self.found / self.people

    @property
    def precision(self):
        """With every false detection of the frames held against the people asked for alone."""
        return self.found / (self.found + self.false)


def frames(scenario, worlds, each, place):
    """Detections and masks in frames, each world of another seed, and masks of the same people alone."""
    rng = np.random.default_rng(0)
    with World(SCENARIO, Forest(()), PEOPLE) as bare:
        alone = Renderer(bare)
        for seed in range(worlds):
            forest = random_forest(rng, *TREES[seed % len(TREES)])
            with World(scenario, forest, PEOPLE, seed) as world:
                renderer = Renderer(world)
                for k in range(each):
                    pose = Pose.level(*rng.uniform(-25, 25, 2), ALTITUDES[k % 3])
                    places, headings = place(rng, pose, forest), rng.uniform(-math.pi, math.pi, PEOPLE)
                    for one in (world, bare):
                        one.place_people(places, headings)
                    taken = renderer.take(0, k / 5, CAMERA, pose)
                    found = BlobDetector().detect(Frame(0, k / 5, CAMERA, pose, taken.image))
                    yield found.pixels, taken.people, alone.render(WIDE, pose).people


def shares(pose, forest, places):
    """Roughly how much of each person at places (N, 2) m shows (N,)."""
    points = (np.column_stack([places, np.zeros(len(places))])[:, None] + BODY).reshape(-1, 3)
    shown = CAMERA.sees(pose, points) & forest.visible(pose.position, points)[0]
    return shown.reshape(len(places), -1).mean(axis=1)


def apart(places, gap):
    """The first so many of places (N, 2) m that keep their distance from one another."""
    kept = []
    for place in places:
        if all(math.dist(place, other) > gap for other in kept):
            kept.append(place)
    return kept


def half_width(pose):
    return pose.position[2] * math.tan(CAMERA.fov / 2) + 0.3


def hidden_in_part(rng, pose, forest):
    """People mostly hidden in part by trees or by the edge of the image."""
    places = pose.position[:2] + rng.uniform(-half_width(pose), half_width(pose), (400, 2))
    share = shares(pose, forest, places)
    chosen = apart(places[(share > 0.2) & (share < 0.6)], 1.2)[:PEOPLE]
    return np.array(chosen + [[np.nan, np.nan]] * (PEOPLE - len(chosen)))


def in_pairs(rng, pose, forest):
    """Pairs in plain view, close together."""
    places = pose.position[:2] + rng.uniform(-half_width(pose), half_width(pose), (60, 2))
    bearing, gap = rng.uniform(-math.pi, math.pi, 60), rng.uniform(0.5, 0.9, 60)
    beside = places + gap[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    plain = (shares(pose, forest, places) == 1.0) & (shares(pose, forest, beside) == 1.0)
    pairs = {tuple(a): b for a, b in zip(places[plain].tolist(), beside[plain], strict=True)}
    chosen = [x for a in apart(pairs, 3.5)[: PEOPLE // 2] for x in (a, pairs[a])]
    return np.array(chosen + [[np.nan, np.nan]] * (PEOPLE - len(chosen)))


@LOOKS
@pytest.mark.parametrize(("worlds", "each"), [(4, 16), pytest.param(200, 20, marks=pytest.mark.slow)])
def test_people_visible_by_a_third_to_a_half_are_found(worlds, each, scenario):
    score = Score()
    for pixels, mask, whole in frames(scenario, worlds, each, hidden_in_part):
        visible, all_of = (np.bincount(m[m >= 0], minlength=PEOPLE) for m in (mask, whole))
        share = visible / np.maximum(all_of, 1)
        score.count((share >= 0.3) & (share <= 0.5), pixels, mask)
    assert score.people > 4 * worlds * each and score.recall >= 0.95 and score.precision >= 0.95


@LOOKS
@pytest.mark.parametrize(("worlds", "each"), [(5, 14), pytest.param(200, 20, marks=pytest.mark.slow)])
def test_touching_pairs_are_found_in_any_arrangement(worlds, each, scenario):
    score = Score()
    for pixels, mask, _ in frames(scenario, worlds, each, in_pairs):
        score.count(touching(mask, PEOPLE), pixels, mask)
    assert score.people > 4 * worlds * each and score.recall >= 0.95 and score.precision >= 0.95


def test_a_trunk_hides_no_person_nearer_to_the_camera():
    rng = np.random.default_rng(0)
    errors, nees = [], []
    for _ in range(30):
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(4.0, 9.0)
        away = np.array([math.cos(bearing), math.sin(bearing)])
        # A canopy as thin as the trunk, so that nothing else hides them.
        forest = Forest((Tree(*(distance * away), canopy_radius=0.2),))
        with photographed(1, forest) as shoot:
            for _ in range(10):
                place, heading = (distance - rng.uniform(0.35, 0.5)) * away, rng.uniform(-math.pi, math.pi)
                pose = Pose.level(0.0, 0.0, rng.uniform(17.0, 22.0))
                _, found = shoot(pose, place, heading, known=forest)
                assert len(found.ground) == 1
                error = found.ground[0] - place
                errors.append([error @ away, error @ [-away[1], away[0]]])
                nees.append(error @ np.linalg.solve(found.covariances[0], error))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.04 and 1.2 < np.mean(nees) < 2.8
