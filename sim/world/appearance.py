"""Random appearance of a mission: light, ground, leaves, clothes and camera, within the scenario's strengths."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.scenario.random_streams import stream
from sim.scenario.scenario import Scenario
from tracking.numerics.arrays import Array
from tracking.numerics.distances import length
from tracking.numerics.exponential import power_each
from tracking.numerics.normal import standard_normal
from tracking.numerics.trigonometry import cos, sin

# Strengths of `appearance = "full"`.
FULL = {
    "light_deg": 60.0,
    "ambient": 0.15,
    "ground_tint": 0.1,
    "ground_moved": 1.0,
    "canopy_tint": 0.2,
    "clothing_hue_deg": 6.0,
    "clothing_shade": 0.3,
    "exposure": 0.2,
    "blur": 0.5,
    "noise": 4.0,
}
PERSON_HUE = 16.0  # deg, hue of all tones of the model of a person; the detector is made for 10 to 22
LIGHT = (0.35, 0.25, 1.0)  # direction towards the light
AMBIENT = 0.75  # share of the light on a surface that faces it, as is the next
DIFFUSE = 0.6
_TILE = 32.0  # m, edge of the ground's texture


@dataclass(frozen=True, eq=False)
class AppearanceSample:
    """Sampled appearance of a mission of T trees, M people and n UAVs.

    Tints multiply red, green and blue. The engine wraps values above 255, so tints of people and canopies stay below
    1.5, at which their textures do not yet reach it.
    """

    seed: int
    repeat: int  # affects only the noise
    light: tuple[float, float, float]  # direction towards the light
    ambient: float
    ground_tint: Array  # (3,), includes the brightness that the light gives
    ground_place: Array  # (2, 3) maps (x, y, 1) [m] to the texture
    clothes: Array  # (M, 3) tints
    canopies: Array  # (T, 3) tints
    gains: Array  # (n,)
    blur: float  # pixels, standard deviation
    noise: float  # grey levels, standard deviation

    def develop(self, image: NDArray[np.uint8], uav: int, time: float) -> NDArray[np.uint8]:
        """The image (H, W, 3) as a UAV's camera delivers it at a time [s]: with blur, exposure and noise.

        The noise depends only on seed, repeat, UAV and time, so that a frame can be made again from a recording.
        """
        gain = float(self.gains[uav])
        if self.blur > 0.0:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), self.blur), dtype=np.uint8)
        if gain == 1.0 and self.noise == 0.0:
            return image
        exposed = np.float32(gain) * image.astype(np.float32)
        if self.noise > 0.0:
            rng = stream(self.seed, "appearance", uav, round(1e6 * time), repeat=self.repeat)
            exposed += np.float32(self.noise) * standard_normal(rng, image.shape).astype(np.float32)
        return np.asarray(np.clip(np.rint(exposed), 0, 255), dtype=np.uint8)


def sample_appearance(scenario: Scenario, seed: int, *, trees: int, people: int, repeat: int = 0) -> AppearanceSample:
    """Sample the appearance of a map, such that the strength of one variation does not change the others.

    The seed decides everything but the noise, which seed and repeat decide; trees T, people M.
    """
    wanted = scenario.appearance
    strength = {name: full * float(wanted.randomise) for name, full in FULL.items()}
    blur = strength["blur"] if wanted.blur is None else wanted.blur
    noise = strength["noise"] if wanted.noise is None else wanted.noise
    scene, clothing, leaves, cameras = stream(seed, "appearance").spawn(4)
    zenith = math.radians(strength["light_deg"] * scene.random())
    azimuth = math.radians(scene.uniform(-180.0, 180.0))
    ambient = AMBIENT + strength["ambient"] * scene.uniform(-1, 1)
    tint = 1 + strength["ground_tint"] * scene.uniform(-1, 1, 3)
    place = strength["ground_moved"] * scene.uniform(-1, 1, 3) * [math.pi, _TILE / 2, _TILE / 2]
    turn, east, north = place.tolist()
    towards = sin(zenith) * cos(azimuth), sin(zenith) * sin(azimuth), cos(zenith)
    light = towards if strength["light_deg"] else LIGHT
    hue = strength["clothing_hue_deg"] * clothing.uniform(-1, 1, people)
    shade = 1 - strength["clothing_shade"] * clothing.random(people)
    season = strength["canopy_tint"] * leaves.uniform(-1, 1, 3)
    each = strength["canopy_tint"] * leaves.uniform(-1, 1, (trees, 1))
    return AppearanceSample(
        seed=seed,
        repeat=repeat,
        light=light,
        ambient=ambient,
        ground_tint=tint * _light_the_ground(light, ambient) / _light_the_ground(LIGHT, AMBIENT),
        ground_place=np.array([[cos(turn), -sin(turn), east], [sin(turn), cos(turn), north]]),
        clothes=shade[:, None] * np.column_stack([np.ones(people), *[1 + hue / PERSON_HUE] * 2]),
        canopies=(1 + season) * (1 + each),
        gains=power_each(1 + strength["exposure"], cameras.uniform(-1, 1, len(scenario.uavs))),
        blur=blur,
        noise=noise,
    )


def _light_the_ground(light: tuple[float, float, float], ambient: float) -> float:
    """Brightness of a level surface under a light."""
    return ambient + DIFFUSE * light[2] / float(length(np.array(light)))
