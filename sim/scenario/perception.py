"""Settings of sensing and tracking."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from sim.scenario.quantities import Density, Expected, Probability, Scans, Speed, Time
from tracking.plugins.registry import Registry

SENSOR_MODES = Registry(
    "sensing.mode",
    {"camera": "sim.sensing.rendered_mode:RenderedMode", "ideal": "sim.sensing.sensor_mode:LineOfSightMode"},
    ("sense(uav, time, pose, people)",),
)
DETECTORS = Registry(
    "sensing.detector",
    {
        "blob": "tracking.detection.blob_detector:BlobDetector",
        "segmentation": "sim.sensing.detection_truth:MaskDetector",
    },
    ("detect(frame)",),
    bare=True,
)


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


class Tracking(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the trackers."""

    # m/s², standard deviation of the acceleration in the motion model, [Li22] eq. (1)
    sigma_a: Annotated[float, Meta(ge=1e-3, le=100)] = 0.75
    # `"known"`: UAVs have the tracks of all people at the start; `"none"`: people have to be found
    initial_tracks: Literal["known", "none"] = "known"
    # probability of detection of a person in plain view
    detection_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.99
    clutter_density: Density = 1e-6  # 1/m², expected false detections per scan and area
    # probability that a person's own measurement falls into the gate
    gate_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.9999
    confirm: tuple[Scans, Scans] = (2, 3)  # m and n: a new track needs m detections in n scans; n is at most 62
    # m and n: a track ends after m misses in n scans in which the person should have been seen; n is at most 62
    delete: tuple[Scans, Scans] = (5, 5)
    # exponent of the likelihood of negative information; 0 means that it is not used
    negative_information: Annotated[float, Meta(ge=0, le=100)] = 1.0
    # s, time without a detection after which a detection within the person's reach may re-acquire the track
    reacquire_after: Time = 0.2
    # m², trace of the position covariance above which a track ends; the default is the square of GOSPA's cut-off
    max_variance: Annotated[float, Meta(ge=1e-3, le=1e8)] = 100.0
    # m/s, largest speed of people, also of lost and undetected ones and of new tracks
    max_speed: Speed = 3.0
    # m/s, walking speed that `motion = "mean-reverting"` expects while few people have been seen
    walking_speed: Speed = 1.75
    # how tracks are initiated and deleted: `"existence"`: by each track's probability of existence, with
    # `confirmation_threshold` and `deletion_threshold`; `"m_of_n"`: by counting scans, as in the paper, with `confirm`
    # and `delete`
    management: Literal["m_of_n", "existence"] = "existence"
    # with `"existence"`: probability that a person is still in the area a second later
    survival: Annotated[float, Meta(gt=0, le=1)] = 0.999
    # 1/m², with `"existence"`: expected first detections of people per scan and area; its ratio to `clutter_density`
    # gives the existence probability of a new track
    birth_density: Density = 1e-5
    # with `"existence"`: probability of existence that confirms a new track
    confirmation_threshold: Annotated[float, Meta(gt=0, lt=1)] = 0.99
    # with `"existence"`: probability of existence below which a track is deleted
    deletion_threshold: Annotated[float, Meta(gt=0, lt=1)] = 0.001
    # motion model: `"mean-reverting"`: speeds return to the walking speed of the people seen; `"ncv"`: nearly constant
    # velocity, as in the paper, and what planners expect with a model of your own. `thompson` always expects it
    motion: str = "mean-reverting"
    # `"jpda"`: Bernoulli tracks with joint probabilistic data association
    tracker: str = "jpda"
    # expected number of undetected people at the start, for whom UAVs search if `initial_tracks` is `"none"`
    undetected: Expected = 4.0

    def __post_init__(self) -> None:
        for name, (m, n) in (("confirm", self.confirm), ("delete", self.delete)):
            if m > n:
                raise ValueError(f"{name} {m} of {n} can never happen")
            if n > _MOST_SCANS:
                raise ValueError(f"{name} {m} of {n} counts too many scans; at most {_MOST_SCANS} are allowed")
        if self.deletion_threshold >= self.confirmation_threshold:
            allowed = f"below confirmation_threshold {self.confirmation_threshold:g}"
            raise ValueError(f"deletion_threshold {self.deletion_threshold:g} must be {allowed}")


# Bounds are far beyond any mission, but below the values that overflow or take forever.
_MOST_SCANS = 62  # the tracker's own limit, repeated because importing its module takes a second
