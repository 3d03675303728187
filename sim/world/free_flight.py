"""Motion of UAVs while none is near a body: compiled, and bit for bit as the engine would move them."""

import math

import numpy as np

from sim.world.quadrotor import DRAG, GRAVITY, INERTIA, MASS, ROTORS, rotor_thrusts, steady_thrusts
from tracking.geometry.quaternions import engine_rotation, level_attitude, rotate, settle
from tracking.numerics.arrays import Array
from tracking.numerics.compiled import compiled, merged
from tracking.numerics.trigonometry import arctan2

# m, of a sphere that touches nothing as long as a UAV does not: twice that around its body, for which a touch is a
# distance of 2 cm or less.
_REACH = 0.5


@compiled
def fly_while_clear(
    states: Array, targets: Array, memories: Array, winds: Array, calm: bool, dt: float, top: float
) -> int:
    """Fly quadrotors as long as all are clear, up to a step of dt s per wind; return the number of steps made.

    states (n, 13), targets (n, 3) as in `rotor_thrusts`; memories (n, 3) as in `steady_thrusts`; winds (steps, 2) m/s.
    States and memories are changed in place. calm: True without air resistance. top: height of all that stands, m.
    """
    for k in range(len(winds)):
        if not _are_clear(states, top):
            return k
        _move(states, wrenches(states, targets, memories, winds[k], calm, dt), dt)
    return len(winds)


@compiled
def glide_while_clear(states: Array, commands: Array, dt: float, steps: int, top: float) -> int:
    """Move kinematic UAVs as long as all are clear after a step, up to so many steps; return the number of steps made.

    states (n, 13), changed in place, dt and top as in `fly_while_clear`; commands (n, 2) m/s.
    """
    turned = True
    for k in range(steps):
        moved = move_kinematic(states, commands, dt, turned)
        if not _are_clear(moved, top):
            return k
        turned = turned and not np.array_equal(moved[:, 3:7], states[:, 3:7])
        for i in range(len(states)):
            for j in range(9):
                states[i, j] = moved[i, j]
    return steps


@merged
def move_kinematic(states: Array, commands: Array, dt: float, turns: bool) -> Array:
    """States (n, 13) after a step of [Li22] eq. (5) for dt s; commands (n, 2) m/s.

    UAVs face the direction of flight and keep their heading at zero velocity. At each step the engine settles
    quaternions; states have those that it is given. turns: False if the last step under these commands turned nobody.
    """
    moved = states.copy()
    for i in range(len(states)):
        moved[i, 0] += commands[i, 0] * dt
        moved[i, 1] += commands[i, 1] * dt
    if turns:
        turned = settle(states[:, 3:7])
        for i in range(len(states)):
            east, north = commands[i, 0], commands[i, 1]
            yaw = arctan2(north, east) if east != 0.0 or north != 0.0 else 2 * arctan2(turned[i, 2], turned[i, 3])
            moved[i, 3], moved[i, 4], moved[i, 5], moved[i, 6] = level_attitude(yaw)
            moved[i, 7], moved[i, 8] = east, north
    return moved


# Values are assigned one by one: to assign slices makes Numba compile the text of an error message, for seconds.
@merged
def wrenches(states: Array, targets: Array, memories: Array, wind: Array, calm: bool, dt: float) -> Array:
    """Forces N and torques N m (n, 6), in the world frame, of rotors and air on quadrotors.

    Arguments as in `fly_while_clear`, with one wind (2,) m/s; memories are changed in place.
    """
    out, known, undisturbed = np.zeros((len(states), 6)), states.copy(), np.zeros(3)
    settled = settle(states[:, 3:7])
    for i in range(len(states)):
        for j in range(4):
            known[i, 3 + j] = settled[i, j]
        if calm:
            thrusts = rotor_thrusts(known[i], targets[i], undisturbed)
        else:
            thrusts, memory = steady_thrusts(known[i], targets[i], memories[i], dt)
            for j in range(3):
                memories[i, j] = memory[j]
                out[i, j] = DRAG * ((wind[j] if j < 2 else 0.0) - known[i, 7 + j])
        turn = engine_rotation(states[i, 3], states[i, 4], states[i, 5], states[i, 6])
        for k in range(4):
            force = _turn(turn, (0.0, 0.0, thrusts[k]))
            torque = _cross(_turn(turn, (ROTORS[k, 0], ROTORS[k, 1], ROTORS[k, 2])), force)
            for j in range(3):
                out[i, j] += force[j]
                out[i, 3 + j] += torque[j]
        torque = _turn(turn, (0.0, 0.0, thrusts[4]))
        for j in range(3):
            out[i, 3 + j] += torque[j]
    return out


@compiled
def _move(states: Array, wrench: Array, dt: float) -> None:
    """Move rigid bodies for dt s under gravity and a wrench (n, 6), in place.

    Source: Featherstone's algorithm for a body without joints, in the order of Bullet's
    `btMultiBody::computeAccelerationsArticulatedBodyAlgorithmMultiDof` and `stepPositionsMultiDof`.
    """
    settled, linear, angular = settle(states[:, 3:7]), np.empty(3), np.empty(3)
    for i in range(len(states)):
        state = states[i]
        turn = engine_rotation(state[3], state[4], state[5], state[6])
        back = engine_rotation(-state[3], -state[4], -state[5], state[6])
        force = _turn(back, (wrench[i, 0], wrench[i, 1], wrench[i, 2] - GRAVITY * MASS))
        torque = _turn(back, (wrench[i, 3], wrench[i, 4], wrench[i, 5]))
        velocity = _turn(back, (state[7], state[8], state[9]))
        spin = _turn(back, (state[10], state[11], state[12]))
        turning = _cross(spin, velocity)
        gyration = _cross(spin, (INERTIA[0] * spin[0], INERTIA[1] * spin[1], INERTIA[2] * spin[2]))
        for j in range(3):
            linear[j] = -((-force[j] + MASS * turning[j]) / MASS) + turning[j]
            angular[j] = -((-torque[j] + gyration[j]) / INERTIA[j])
        rise, twist = _turn(turn, (linear[0], linear[1], linear[2])), _turn(turn, (angular[0], angular[1], angular[2]))
        for j in range(3):
            state[7 + j] += rise[j] * dt
            state[10 + j] += twist[j] * dt
            state[j] += state[7 + j] * dt
        turned = rotate(settled[i], state[10:13], dt)
        for j in range(4):
            state[3 + j] = turned[j]


@compiled
def _turn(matrix: Array, vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Product of a matrix (3, 3) and a vector."""
    x, y, z = vector
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@compiled
def _cross(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
    """Cross product of two vectors."""
    (a, b, c), (x, y, z) = one, other
    return b * z - c * y, c * x - a * z, a * y - b * x


@compiled
def _are_clear(states: Array, top: float) -> bool:
    """True if UAVs can touch neither one another nor what stands up to a height `top` m."""
    for i in range(len(states)):
        if states[i, 2] - _REACH <= top:
            return False
        for j in range(i):
            x, y, z = states[i, 0] - states[j, 0], states[i, 1] - states[j, 1], states[i, 2] - states[j, 2]
            if math.sqrt(x * x + y * y + z * z) <= 2 * _REACH:
                return False
    return True
