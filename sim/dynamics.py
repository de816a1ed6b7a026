"""How a multirotor moves: a point mass under a velocity loop, drag, wind and the ground.

The attitude loop is reduced to a limit of the jerk. What a position controller notices is there:
jerk, acceleration and speed are bounded, a moving target is followed with a small lag, wind
pushes, the ground stops. Everything is ENU and SI.
"""

from __future__ import annotations

import math

import msgspec

from sim.config import VehicleLimits
from swarmctl.units import Vector

GRAVITY_MPS2 = 9.80665
DRAG_PER_S = 0.3
"""Linear drag: deceleration per airspeed, 1/s. A wind of 8 m/s leans a hovering vehicle by 14°."""
UNREJECTED_DRAG = 0.2
"""Share of the drag that the velocity loop does not cancel.

At 4 m/s it leaves a following lag of 0.08 m, where ArduCopter shows 0.1 m.
"""
VELOCITY_GAIN_PER_S = 3.0
"""Acceleration per velocity error, 1/s."""
BRAKING_MARGIN = 0.5
"""Share of the greatest acceleration that the approach to a target counts on.

The rest covers the delay of the velocity loop, so that an approach does not overshoot.
"""


class State(msgspec.Struct, frozen=True, gc=False):
    """True state of a vehicle.

    Attributes:
        position_enu: Position, m.
        velocity_enu: Velocity, m/s.
        thrust_enu: Rotor thrust per unit of mass, m/s²; the airframe leans in its direction.
        on_ground: Whether it stands on the ground.
        acceleration_enu: Acceleration, m/s².
    """

    position_enu: Vector
    velocity_enu: Vector = (0.0, 0.0, 0.0)
    thrust_enu: Vector = (0.0, 0.0, GRAVITY_MPS2)
    on_ground: bool = True
    acceleration_enu: Vector = (0.0, 0.0, 0.0)


class Command(msgspec.Struct, frozen=True, gc=False):
    """The autopilot's command to the airframe.

    Attributes:
        error_enu: Vector to the position setpoint in the autopilot's own solution, m; zero on
            an axis where only the velocity is controlled.
        velocity_enu: Velocity of the setpoint, fed forward, m/s.
        gain_per_s: Approach speed per metre of position error, 1/s.
        speed_mps: Greatest horizontal speed the autopilot allows itself, m/s.
    """

    error_enu: Vector
    velocity_enu: Vector
    gain_per_s: float
    speed_mps: float = math.inf


def approach_speed(distance_m: float, gain_per_s: float, braking_mps2: float) -> float:
    """Speed towards a target (m/s): proportional near it, braking-limited far away.

    Beyond ``a/k²`` it is ``sqrt(2 a (d - a/2k²))``, from which a constant deceleration ``a``
    leads to rest; both value and slope are continuous there (ArduPilot's ``sqrt_controller``).

    Args:
        distance_m: Distance to go, not negative.
        gain_per_s: Slope k near the target.
        braking_mps2: Deceleration a to count on.
    """
    linear_m = braking_mps2 / (gain_per_s * gain_per_s)
    if distance_m <= linear_m:
        return gain_per_s * distance_m
    return math.sqrt(2.0 * braking_mps2 * (distance_m - 0.5 * linear_m))


def step(
    state: State,
    command: Command | None,
    wind_enu: Vector,
    limits: VehicleLimits,
    ground_up_m: float,
    dt_s: float,
) -> State:
    """The state one time step later.

    Args:
        state: State now.
        command: Command of the autopilot; None with the rotors idle.
        wind_enu: Velocity of the air, m/s.
        limits: Performance.
        ground_up_m: Up coordinate of the ground below, m.
        dt_s: Time step, s; well below the velocity loop's 1/3 s.
    """
    if command is None:
        if state.on_ground:
            return state
        return _fall(state, wind_enu, ground_up_m, dt_s)
    vx, vy, vz = state.velocity_enu
    want_x, want_y, want_z = _wanted_velocity(command, limits)
    drag_x = DRAG_PER_S * (wind_enu[0] - vx)
    drag_y = DRAG_PER_S * (wind_enu[1] - vy)
    drag_z = DRAG_PER_S * (wind_enu[2] - vz)
    ax = VELOCITY_GAIN_PER_S * (want_x - vx) + UNREJECTED_DRAG * drag_x
    ay = VELOCITY_GAIN_PER_S * (want_y - vy) + UNREJECTED_DRAG * drag_y
    az = VELOCITY_GAIN_PER_S * (want_z - vz) + UNREJECTED_DRAG * drag_z
    horizontal = math.hypot(ax, ay)
    if horizontal > limits.acceleration_mps2:
        scale = limits.acceleration_mps2 / horizontal
        ax, ay = ax * scale, ay * scale
    az = max(-limits.climb_acceleration_mps2, min(limits.climb_acceleration_mps2, az))
    # The limits are convex: an acceleration between two permitted ones is permitted.
    (was_x, was_y, was_z), change = state.acceleration_enu, limits.jerk_mps3 * dt_s
    horizontal = math.hypot(ax - was_x, ay - was_y)
    if horizontal > change:
        scale = change / horizontal
        ax, ay = was_x + (ax - was_x) * scale, was_y + (ay - was_y) * scale
    az = max(was_z - change, min(was_z + change, az))

    # Projecting onto the permitted speeds never lengthens the step from a permitted velocity,
    # so the acceleration limits hold as well.
    new_x, new_y, new_z = vx + ax * dt_s, vy + ay * dt_s, vz + az * dt_s
    speed = math.hypot(new_x, new_y)
    if speed > limits.speed_mps:
        scale = limits.speed_mps / speed
        new_x, new_y = new_x * scale, new_y * scale
    new_z = max(-limits.climb_mps, min(limits.climb_mps, new_z))

    x, y, z = state.position_enu
    up = z + 0.5 * (vz + new_z) * dt_s
    if up <= ground_up_m:
        # Standing on the ground it does not slide, whatever the wind.
        return State((x, y, ground_up_m))
    return State(
        (x + 0.5 * (vx + new_x) * dt_s, y + 0.5 * (vy + new_y) * dt_s, up),
        (new_x, new_y, new_z),
        (ax - drag_x, ay - drag_y, az - drag_z + GRAVITY_MPS2),
        False,
        (ax, ay, az),
    )


def _wanted_velocity(command: Command, limits: VehicleLimits) -> Vector:
    """Velocity that leads to the setpoint and follows it, within the limits, m/s."""
    ex, ey, ez = command.error_enu
    x, y, z = command.velocity_enu
    distance = math.hypot(ex, ey)
    if distance > 0.0:
        closing = approach_speed(
            distance, command.gain_per_s, BRAKING_MARGIN * limits.acceleration_mps2
        )
        x += closing * ex / distance
        y += closing * ey / distance
    if ez != 0.0:
        closing = approach_speed(
            abs(ez), command.gain_per_s, BRAKING_MARGIN * limits.climb_acceleration_mps2
        )
        z += math.copysign(closing, ez)
    speed, greatest = math.hypot(x, y), min(limits.speed_mps, command.speed_mps)
    if speed > greatest:
        scale = greatest / speed
        x, y = x * scale, y * scale
    return x, y, max(-limits.climb_mps, min(limits.climb_mps, z))


def _fall(state: State, wind_enu: Vector, ground_up_m: float, dt_s: float) -> State:
    """The state one step later with the rotors stopped in the air: gravity and drag."""
    vx, vy, vz = state.velocity_enu
    new_x = vx + DRAG_PER_S * (wind_enu[0] - vx) * dt_s
    new_y = vy + DRAG_PER_S * (wind_enu[1] - vy) * dt_s
    new_z = vz + (DRAG_PER_S * (wind_enu[2] - vz) - GRAVITY_MPS2) * dt_s
    x, y, z = state.position_enu
    x, y = x + 0.5 * (vx + new_x) * dt_s, y + 0.5 * (vy + new_y) * dt_s
    up = z + 0.5 * (vz + new_z) * dt_s
    if up <= ground_up_m:
        return State((x, y, ground_up_m))
    return State((x, y, up), (new_x, new_y, new_z), (0.0, 0.0, 0.0), False)
