"""Images vary with the seed within the limits of the scenario, and every frame can be rendered again."""

import colorsys
import math

import msgspec
import numpy as np
import pytest
from helpers.frames import Tally, survey
from helpers.views import CAMERA, SCENARIO, random_forest

from assets.shapes import PALETTE
from sim.scenario.environment import APPEARANCES, Appearance
from sim.scenario.loading import load_scenario
from sim.scenario.scenario import Scenario
from sim.sensing.renderer import Renderer
from sim.world.appearance import sample_appearance
from sim.world.world import World
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree

POSE = Pose.level(0.0, 0.0, 19.0)
TREES = Forest((Tree(5.0, 4.0, 3.0), Tree(-6.0, -5.0, 3.0)))
PARTS = {"light", "ambient", "ground_tint", "ground_place", "canopies", "clothes", "gains", "blur", "noise"}


def varied(**strengths):
    return msgspec.structs.replace(SCENARIO, appearance=Appearance(**strengths))


def style(seed=0, **strengths):
    return sample_appearance(varied(**strengths), seed, trees=2, people=3)


def different(one, other):
    names = set(type(one).__dataclass_fields__) - {"seed"}
    return {name for name in names if not np.array_equal(getattr(one, name), getattr(other, name))}


def shot(scenario, seed, time=0.4):
    with World(scenario, TREES, 2, seed) as world:
        world.place_people(np.array([[0.0, 3.0], [2.0, -4.0]]), np.zeros(2))
        return Renderer(world).take(0, time, CAMERA, POSE)


def test_by_default_the_seed_changes_no_pixel():
    one, other = shot(SCENARIO, 0), shot(SCENARIO, 5)
    assert one.image.tobytes() == other.image.tobytes()
    image = np.zeros((4, 4, 3), dtype=np.uint8)
    assert style().develop(image, 0, 0.0) is image


@pytest.mark.parametrize(("name", "value"), [("blur", 0.5), ("noise", 4.0)])
def test_each_strength_varies_its_own_part_and_shows(name, value):
    assert different(style(**{name: value}), style()) == {name}
    # What is given holds against full strength, which has the same.
    assert different(style(randomise=True, **{name: 0}), style(randomise=True)) == {name}
    assert different(style(randomise=True, **{name: value}), style(randomise=True)) == set()
    plain, changed = shot(SCENARIO, 3), shot(varied(**{name: value}), 3)
    assert np.array_equal(plain.people, changed.people) and not np.array_equal(plain.image, changed.image)


def test_presets_vary_nothing_half_or_all_of_the_same():
    none, mild, full = (
        sample_appearance(load_scenario("forest", [f"appearance={name}"]), 1, trees=2, people=3) for name in APPEARANCES
    )
    assert none.light == style(0).light and not none.noise and different(mild, none) == different(full, none) == PARTS
    assert mild.ambient - none.ambient == pytest.approx((full.ambient - none.ambient) / 2)
    assert (mild.blur, mild.noise) == (full.blur / 2, full.noise / 2) == (0.25, 2.0)
    np.testing.assert_allclose(mild.clothes[:, 0] - 1, (full.clothes[:, 0] - 1) / 2)
    louder = load_scenario("forest", ["appearance=full", "appearance.noise=12"]).appearance
    assert louder == Appearance(randomise=True, noise=12.0)


def test_draws_fill_their_ranges_and_clothes_keep_to_their_hues():
    styles = [style(seed, randomise=True) for seed in range(300)]
    zenith = [math.degrees(math.acos(s.light[2])) for s in styles]
    assert max(zenith) <= 60.0 and max(zenith) > 57 and min(zenith) < 3
    gains = np.concatenate([s.gains for s in styles])
    assert gains.max() <= 1.2 and gains.max() > 1.19 and gains.min() >= 1 / 1.2 and gains.min() < 0.845
    tints = np.concatenate([s.canopies for s in styles])
    assert tints.max() <= 1.44 and tints.min() >= 0.64
    # The engine wraps tones above 255, before it applies the light.
    brightest = np.array([122, 152, 76]) * tints.max()
    assert brightest.max() < 255
    tints = np.concatenate([s.clothes for s in styles])
    assert tints.max(axis=0) == pytest.approx([1.0, 1.35, 1.35], abs=0.05)
    for name in ("vest", "trousers", "boots", "hair"):
        tones = np.array(PALETTE[name]) * tints
        hues = np.array([360 * colorsys.rgb_to_hsv(*(tone / 255))[0] for tone in tones])
        assert hues.min() > 9.9 and hues.max() < 22.1 and tones.max() <= 255


def test_noise_blur_and_gain_are_as_strong_as_told_and_each_images_own():
    flat = np.full((128, 128, 3), 100, dtype=np.uint8)
    noisy = style(noise=4.0).develop(flat, 0, 0.2).astype(float) - 100
    assert abs(noisy.mean()) < 0.05 and noisy.std() == pytest.approx(math.sqrt(16 + 1 / 12), rel=0.01)
    gained = style(randomise=True, blur=0, noise=0)
    assert np.unique(gained.develop(flat, 0, 0.2)).tolist() == [round(100 * gained.gains[0])]
    square = np.zeros((33, 33, 3), dtype=np.uint8)
    square[12:21, 12:21] = 255
    spread = style(blur=1.0).develop(square, 0, 0.2)[..., 0].sum(axis=0, dtype=float)
    variance = (spread @ (np.arange(33) - 16) ** 2) / spread.sum() - (9**2 - 1) / 12
    assert variance == pytest.approx(1.0, abs=0.05)
    flat = np.full((16, 16, 3), 100, dtype=np.uint8)
    asked = ((0, 0, 0.2), (1, 0, 0.2), (0, 0, 0.4))
    taken = [style(seed, noise=4.0).develop(flat, uav, time).tobytes() for seed, uav, time in asked]
    assert len(set(taken)) == 3
    two = sample_appearance(Scenario(appearance=Appearance(noise=4.0)), 0, trees=9, people=0)
    two.develop(flat, 2, 7.0)
    assert two.develop(flat, 0, 0.2).tobytes() == taken[0] and two.develop(flat, 1, 0.2).tobytes() != taken[0]


@pytest.mark.parametrize(("worlds", "frames"), [(12, 4), pytest.param(150, 4, marks=pytest.mark.slow)])
def test_people_are_found_under_full_randomisation(worlds, frames):
    rng, tally = np.random.default_rng(0), Tally([], [])
    for seed in range(worlds):
        forest = random_forest(rng, *((20, 5.0), (60, 1.0), (28, 4.0))[seed % 3])
        survey(tally, rng, forest, frames, varied(randomise=True), seed)
    people, detections = np.array(tally.people, dtype=float), np.array(tally.detections)
    assert len(people) > 4 * worlds * frames and people[:, 0].mean() >= 0.98 and detections.mean() >= 0.98
    found = people[people[:, 0] == 1]
    assert np.abs(found[:, 2:].mean(axis=0)).max() < 0.02 and found[:, 2:].std(axis=0).max() < 0.1
