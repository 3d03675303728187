"""Settings of sensing and tracking."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from sim.scenario.bounds import (
    Density,
    Expected,
    Probability,
    Scans,
    Speed,
    Time,
    Variance,
    Weight,
)


class Sensing(Struct, frozen=True, forbid_unknown_fields=True):
    """From world to measurements."""

    mode: Literal["camera", "ideal"] = "camera"
    noise: Literal["range_bearing", "camera"] = "range_bearing"
    # Model of occlusion of tracker and planner, and of ideal sensing.
    occlusion: Literal["line_of_sight", "disc"] = "line_of_sight"
    renderer: Literal["tiny", "egl"] = "tiny"  # PyBullet's own on the CPU, or OpenGL without a display
    detector: str = "blob"  # "blob", "segmentation" or "package.module:Class"
    false_alarms: Annotated[float, Meta(ge=0, le=1000)] = 0.0  # expected number per frame, Poisson
    miss_probability: Probability = 0.0  # of a detection that is dropped
    field_of_view: Literal["camera", "unlimited"] = "camera"  # "unlimited": only in ideal sensing; trees still hide

    def __post_init__(self) -> None:
        if self.field_of_view == "unlimited":
            if self.mode == "camera":
                raise ValueError('field_of_view "unlimited" has no image; allowed with mode "ideal"')
            if self.false_alarms:
                raise ValueError('false_alarms are spread over an image; allowed with field_of_view "camera"')


class Tracking(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the trackers."""

    sigma_a: Annotated[float, Meta(ge=1e-3, le=100)] = 0.5  # m/s², of the NCV model
    initial_tracks: Literal["known", "none"] = "known"
    detection_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.99  # of a person in plain view
    clutter_density: Density = 1e-6  # false alarms per m²
    gate_probability: Annotated[float, Meta(gt=0, lt=1)] = 0.9999
    confirm: tuple[Scans, Scans] = (2, 3)  # m of n scans
    delete: tuple[Scans, Scans] = (5, 5)  # misses in m of n scans with a view of the person
    absence_weight: Weight = 1.0  # exponent of the likelihood of negative information; 0: none is used
    recovery_after: Time = 1.0  # s without detection, after which a new detection may re-acquire the track
    max_variance: Variance = 400.0  # m², trace of the position's covariance at which a track is deleted
    max_speed: Speed = 3.0  # m/s, of people
    life: Literal["m_of_n", "existence"] = "m_of_n"  # rule of initiation and deletion of tracks
    survival: Annotated[float, Meta(gt=0, le=1)] = 0.999  # probability per second that a person stays
    birth_density: Density = 1e-5  # new targets per m² and scan
    sure: Annotated[float, Meta(gt=0, lt=1)] = 0.99  # existence probability that confirms a track
    doubt: Annotated[float, Meta(gt=0, lt=1)] = 0.001  # existence probability below which a track is deleted
    motion: Literal["ncv", "bounded"] = "ncv"  # motion model of the trackers
    unseen: Expected = 4.0  # undetected people expected at the start with initial_tracks "none"

    def __post_init__(self) -> None:
        for name, (m, n) in (("confirm", self.confirm), ("delete", self.delete)):
            if m > n:
                raise ValueError(f"{name} {m} of {n} can never happen")
            if n > _MOST_SCANS:
                raise ValueError(f"{name} {m} of {n} counts too many scans; at most {_MOST_SCANS} are allowed")
        if self.doubt >= self.sure:
            raise ValueError(f"doubt {self.doubt:g} must be below sure {self.sure:g}")


# Bounds are far beyond any mission, and short of what overflows or ends no more.
_MOST_SCANS = 62  # as in the tracker; importing its module takes a second
