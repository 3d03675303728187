"""Motion models of people: their interface, and the models by name."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from tracking.plugins.containment import ForeignError, contained
from tracking.plugins.importing import imported
from tracking.plugins.spelling import did_you_mean

if TYPE_CHECKING:  # checking a name needs no arithmetic
    from tracking.filter.kalman import Gaussian
    from tracking.numerics.arrays import Array

# Each is called with dt [s], sigma_a [m/s²] and max_speed [m/s], the scenario's keys, whether or not it needs them all.
MOTION_MODELS = {
    "ncv": "tracking.filter.kalman:nearly_constant_velocity",
    "bounded": "tracking.filter.bounded_speed:BoundedSpeed",
}


class MotionModel(Protocol):
    """Prediction of beliefs over one step of `dt`."""

    @property
    def dt(self) -> float:
        """Duration of a step [s]."""
        ...

    def predict(self, belief: Gaussian) -> Gaussian:
        """Predict a belief one step ahead."""
        ...

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict a stack of beliefs one step ahead: means (T, 4), covariances (T, 4, 4)."""
        ...


def check_motion_model(name: str, field: str = "motion") -> None:
    """ValueError unless a model is built in or may be an import string, "package.module:Class"."""
    if name not in MOTION_MODELS and ":" not in name:
        raise ValueError(f"{field}: {name!r} is unknown; {did_you_mean(name, MOTION_MODELS)} (or package.module:Class)")


def motion_model(name: str, dt: float, sigma_a: float, max_speed: float) -> MotionModel:
    """The model of that name or import string; ValueError says what is wrong."""
    check_motion_model(name)
    try:
        make = imported(MOTION_MODELS.get(name, name))
        with contained():
            model = make(dt, sigma_a, max_speed)
            missing = [n for n in ("predict", "predict_all") if not callable(getattr(model, n, None))]
            step = float(getattr(model, "dt", math.nan))
    except ImportError as error:
        raise ValueError(f"tracking.motion: {name!r} cannot be imported: {error}") from error
    except ForeignError as error:
        raise ValueError(f"tracking.motion: {name!r} cannot be made: {error.explained}") from error
    if missing:
        raise ValueError(f"tracking.motion: {name!r} has no method {missing[0]}")
    if step != dt:
        raise ValueError(f"tracking.motion: {name!r} must have the attribute dt = {dt:g}, has {step:g}")
    return model  # type: ignore[no-any-return]
