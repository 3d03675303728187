"""Motion models of people: their interface, and the models by name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from tracking.errors import InputError
from tracking.numerics.arrays import Array
from tracking.plugins.registry import Registry
from tracking.plugins.result_check import COVARIANCES, Form

# Each model is called with the scenario's keys dt [s], sigma_a [m/s²], max_speed and walking_speed [m/s], of which it
# may ignore some.
MOTION_MODELS = Registry(
    "tracking.motion",
    {
        "mean-reverting": "tracking.filter.mean_reverting:make_mean_reverting_model",
        "ncv": "tracking.filter.kalman:make_ncv_model",
    },
    ("predict_all(means, covariances)",),
)

_ROUNDING = 1e-3  # steps; times that are this near to a whole number of steps are meant to be there
_ONE_BY_ONE = 1000  # steps, the most between two frames of a camera in a mission; more are predicted at once


class MotionModel(Protocol):
    """Prediction of beliefs over one step of `dt`.

    A model may have the method `stretch(duration)`, which returns the same motion over one step of so many seconds; for
    others, times are rounded to whole steps. A built-in model may learn: `learn(velocities)` returns the model after a
    scan in which people of these velocities (N, 2) m/s were detected.

    Example:
        ```python
        import numpy as np

        class Standing:
            def __init__(self, dt, sigma_a, max_speed, walking_speed):
                self.dt = dt

            def predict_all(self, means, covariances):
                return means, covariances + 0.01 * np.eye(4)
        ```
    """

    @property
    def dt(self) -> float:
        """Duration of a step [s]."""

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict a stack of beliefs one step ahead: means (T, 4), covariances (T, 4, 4)."""


def count_steps(motion: MotionModel, duration: float) -> float:
    """Number of a model's steps in `duration` s, without errors of rounding; whole if the model has no other steps."""
    steps, whole = duration / motion.dt, float(round(duration / motion.dt))
    return steps if abs(steps - whole) > _ROUNDING and hasattr(motion, "stretch") else whole


def predict_steps(motion: MotionModel, means: Array, covariances: Array, steps: float) -> tuple[Array, Array]:
    """Predict a stack of beliefs, means (T, 4) and covariances (T, 4, 4), over a number of steps of the model.

    Up to a thousand whole steps are predicted one by one; others at once, if the model can.
    """
    if (steps > _ONE_BY_ONE or not float(steps).is_integer()) and hasattr(motion, "stretch"):
        motion, steps = motion.stretch(steps * motion.dt), 1
    for _ in range(round(steps)):
        means, covariances = motion.predict_all(means, covariances)
    return means, covariances


def make_motion_model(name: str, dt: float, sigma_a: float, max_speed: float, walking_speed: float) -> MotionModel:
    """The motion model of that name or import string.

    InputError if there is none, if its attribute `dt` differs from this one, or later if its predictions are wrong.
    dt: duration of a step [s]; sigma_a: standard deviation of the acceleration [m/s²]; max_speed: largest speed of
    people [m/s]; walking_speed: the speed that is expected at first [m/s].
    """
    model: MotionModel = MOTION_MODELS.make(name, dt, sigma_a, max_speed, walking_speed)
    with MOTION_MODELS.errors(name, "be made"):
        step = float(getattr(model, "dt", math.nan))
    if step != dt:
        raise InputError(f"tracking.motion: {name!r} must have the attribute dt = {dt:g}, has {step:g}")
    return model if name in MOTION_MODELS.built_in else _CheckedModel(name, model, dt)


@dataclass(frozen=True)
class _CheckedModel:
    """A motion model from outside; InputError if a prediction fails or is no belief."""

    name: str
    model: MotionModel
    dt: float

    def predict_all(self, means: Array, covariances: Array) -> tuple[Array, Array]:
        with MOTION_MODELS.errors(self.name, "predict", self.model, "predict_all"):
            moved, spread = self.model.predict_all(means, covariances)
            return Form((4,)).check("means", moved, len(means)), COVARIANCES.check("covariances", spread, len(means))
