"""Settings of sensing."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct

from tracking.plugins.registry import Registry
from tracking.settings import Probability

SENSOR_MODES = Registry(
    "sensing.mode",
    {"camera": "sim.sensing.rendered_mode:RenderedMode", "ideal": "sim.sensing.sensor_mode:LineOfSightMode"},
    ("sense(shot)",),
)
DETECTORS = Registry(
    "sensing.detector",
    {
        "blob": "tracking.detection.blob_detector:BlobDetector",
        "segmentation": "sim.sensing.detection_truth:MaskDetector",
    },
    ("detect(frame)",),
)


def make_detectors(name: str, uavs: Iterable[int], rng: np.random.Generator) -> dict[int, Any]:
    """The detector of each UAV: one for all, or if it is stateful one each, reset with a seed that `rng` draws.

    InputError if a detector cannot be made or reset.
    """
    one, made = DETECTORS.make(name), dict[int, Any]()
    stateful = DETECTORS.is_stateful(name, one)
    for uav in uavs:
        made[uav] = DETECTORS.make(name) if stateful and made else one
        if stateful:
            DETECTORS.reset(name, made[uav], int(rng.integers(2**63)))
    return made


class Sensing(Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of sensing, which turns the world into measurements."""

    # `"camera"`: detections from rendered images; `"ideal"`: a measurement of every person in line of sight, without
    # rendering
    mode: str = "camera"
    # `"range_bearing"`: adds noise of [Li22] eq. (4) to each detection, and its covariance to the detection's own;
    # `"camera"`: adds none
    noise: Literal["range_bearing", "camera"] = "range_bearing"
    # occlusion that trackers and planners assume, and that ideal sensing obeys: `"line_of_sight"`: trunks and canopies
    # are cylinders that block the view; `"disc"`: the paper's
    occlusion: Literal["line_of_sight", "disc"] = "line_of_sight"
    # `"tiny"`: PyBullet's own renderer, on the CPU; `"egl"`: OpenGL without a display, for images of up to 768 pixels;
    # an error if it cannot start
    renderer: Literal["tiny", "egl"] = "tiny"
    # `"blob"`: finds people by their colour; `"segmentation"`: by the renderer's mask, all who show a pixel
    detector: str = "blob"
    # expected number of false detections per frame, anywhere in the image. Set `tracking.clutter_density` to this
    # number divided by the field of view in m²
    false_alarms: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    # probability that a detection is lost; set `tracking.detection_probability` to its complement
    miss_probability: Probability = 0.0
    # `"camera"`: that of the image; `"unlimited"`: everywhere that trees do not hide, which needs
    # `sensing.mode = "ideal"`
    field_of_view: Literal["camera", "unlimited"] = "camera"

    def __post_init__(self) -> None:
        if self.field_of_view == "unlimited":
            if self.renders:
                raise ValueError('field_of_view "unlimited" has no image; allowed with mode "ideal"')
            if self.false_alarms:
                raise ValueError('false_alarms are spread over an image; allowed with field_of_view "camera"')

    @property
    def renders(self) -> bool:
        """True if frames are rendered; films, pages and explanations then show them."""
        return self.mode == "camera"
