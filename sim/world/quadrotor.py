"""Quadrotor: constants and the controller that turns velocity commands into rotor thrusts."""

import math

import numpy as np

from tracking.geometry.quaternions import rotation
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, inlined, merged
from tracking.numerics.exponential import exp
from tracking.numerics.trigonometry import hypot, tan

GRAVITY = 9.81  # m/s²
MASS = 1.2  # kg
INERTIA = np.array([0.012, 0.012, 0.02])  # kg m², about the body axes
ARM = 0.17  # m
# Rotors in the body frame, x forward and y left: front left, front right, rear right, rear left.
ROTORS = ARM * np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]])  # (4, 3) m
MAX_ROTOR_THRUST = 7.0  # N
MAX_YAW_TORQUE = 0.3  # N m
MAX_TILT = math.radians(35.0)
_STEEPEST = tan(MAX_TILT)
MAX_ACCELERATION = 6.0  # m/s², horizontal
MAX_CLIMB_ACCELERATION = 4.0  # m/s²
# Drag of rotors and body: hovering takes a tilt of 9 degrees in a wind of 5 m/s, and of 20 degrees in one of 12 m/s.
DRAG = 0.36  # N s/m

# s, time constant of the first-order lag with which planners predict how velocities follow commands; longer than that
# of the control loops, because accelerations are limited.
COMMAND_LAG = 0.65
_VELOCITY_GAIN = 5.0  # 1/s
_ALTITUDE_GAINS = (9.0, 6.0)  # 1/s², 1/s: critically damped
_ATTITUDE_GAINS = (400.0, 36.0)  # 1/s², 1/s: 20 rad/s, damping ratio 0.9
_ATTITUDE_LAG = _ATTITUDE_GAINS[1] / _ATTITUDE_GAINS[0]  # s
_DISTURBANCE_RATE = 5.0  # 1/s, rate at which the estimate of a disturbance converges


@compiled
def rotor_thrusts(state: Array, target: Array, disturbance: Array) -> Array:
    """Thrusts of the four rotors [N] and the yaw torque about the body's z axis [N m], together (5,).

    state (13,): position m, quaternion xyzw, velocity m/s and angular velocity rad/s, all in the world frame.
    target (3,): velocity east and north m/s, altitude m. disturbance (3,) m/s²: acceleration by other forces, such as
    air resistance. The controller is a cascade from velocity to acceleration, attitude (yaw 0), torque and rotors; it
    has to run at the physics rate.
    Source: attitude control of Lee, Leok and McClamroch, CDC 2010.
    """
    R = rotation(state[3:7])
    acceleration = _command_acceleration(state, target, R, disturbance)
    # Divided by the cosine of the tilt, so that altitude does not depend on the attitude loop.
    lift = MASS * (GRAVITY + acceleration[2]) / max(R[2, 2], 0.5)
    return _mix(lift, _command_torque(R, state[10:13], acceleration))


@merged
def steady_thrusts(state: Array, target: Array, memory: Array, dt: float) -> tuple[Array, Array]:
    """`rotor_thrusts` (5,) that hold velocity and altitude in wind, and the memory (3,) m/s² for the next step.

    memory: zeros for a body at rest, later the memory that the last call returned. dt: time between two calls, s. The
    disturbance is estimated from the change of velocity that the applied thrusts do not explain. This is integral
    action without wind-up: it uses the thrusts after all limits, not the commanded ones.
    Source: reduced-order disturbance observer, Chen et al., IEEE Trans. Industrial Electronics 63(2), 2016.
    """
    share = 1.0 - exp(-_DISTURBANCE_RATE * dt)
    gain = share / dt
    disturbance = memory + gain * state[7:10]
    thrusts = rotor_thrusts(state, target, disturbance)
    R, lift, kept = rotation(state[3:7]), 0.0, np.empty(3)
    for k in range(4):
        lift += thrusts[k]
    for i in range(3):
        applied = lift / MASS * R[i, 2] - (GRAVITY if i == 2 else 0.0)
        kept[i] = (1.0 - share) * disturbance[i] - gain * state[7 + i] - share * applied
    return thrusts, kept


@merged
def _command_acceleration(state: Array, target: Array, R: Array, disturbance: Array) -> Array:
    """Commanded acceleration of the body (3,) m/s², within the limits of acceleration and tilt."""
    climb = _ALTITUDE_GAINS[0] * (target[2] - state[2]) - _ALTITUDE_GAINS[1] * state[9] - disturbance[2]
    climb = min(max(climb, -MAX_CLIMB_ACCELERATION), MAX_CLIMB_ACCELERATION)
    # The present tilt accelerates the body until the attitude has followed. This gain of velocity counts as already
    # made, which makes both poles of the velocity loop real, so that velocity does not overshoot.
    coasting = _ATTITUDE_LAG * GRAVITY / max(R[2, 2], 0.5)
    gained_east = coasting * R[0, 2] + _ATTITUDE_LAG * disturbance[0]
    gained_north = coasting * R[1, 2] + _ATTITUDE_LAG * disturbance[1]
    east = _VELOCITY_GAIN * (target[0] - state[7] - gained_east) - disturbance[0]
    north = _VELOCITY_GAIN * (target[1] - state[8] - gained_north) - disturbance[1]
    limit = min(MAX_ACCELERATION, _STEEPEST * (GRAVITY + climb))
    scale = min(1.0, limit / max(hypot(east, north), 1e-9))
    return np.array([scale * east, scale * north, climb])


@merged
def _command_torque(R: Array, omega: Array, acceleration: Array) -> Array:
    """Body torque (3,) N m that turns the body's z axis to the thrust for an acceleration, and its x axis east."""
    up = acceleration + np.array([0.0, 0.0, GRAVITY])
    up /= math.sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2])
    left = np.array([0.0, up[2], -up[1]])
    left /= math.sqrt(left[1] * left[1] + left[2] * left[2])
    forward = np.array([_cross(left, up, i) for i in range(3)])
    body_alpha, body_omega = np.zeros(3), np.zeros(3)
    for j in range(3):
        error = 0.5 * (_cross(forward, R[:, 0], j) + _cross(left, R[:, 1], j) + _cross(up, R[:, 2], j))
        alpha = -_ATTITUDE_GAINS[0] * error - _ATTITUDE_GAINS[1] * omega[j]
        for i in range(3):
            body_alpha[i] += R[j, i] * alpha
            body_omega[i] += R[j, i] * omega[j]
    momentum = INERTIA * body_omega
    return np.array([INERTIA[i] * body_alpha[i] + _cross(body_omega, momentum, i) for i in range(3)])


@inlined
def _cross(one: Array, other: Array, i: int) -> float:
    """Component i of the cross product of two vectors (3,)."""
    j, k = (i + 1) % 3, (i + 2) % 3
    return float(one[j] * other[k] - one[k] * other[j])


@compiled
def _mix(lift: float, torque: Array) -> Array:
    """Four thrusts and the yaw torque (5,); if rotors saturate, lift is kept and the tilting torque is reduced."""
    mean = min(max(lift / 4, 0.0), MAX_ROTOR_THRUST)
    room = min(mean, MAX_ROTOR_THRUST - mean)
    out, most = np.empty(5), 1e-9
    for k in range(4):
        out[k] = (torque[0] / ROTORS[k, 1] - torque[1] / ROTORS[k, 0]) / 4
        most = max(most, abs(out[k]))
    scale = min(1.0, room / most)
    for k in range(4):
        out[k] = min(max(mean + scale * out[k], 0.0), MAX_ROTOR_THRUST)
    out[4] = min(max(torque[2], -MAX_YAW_TORQUE), MAX_YAW_TORQUE)
    return out
