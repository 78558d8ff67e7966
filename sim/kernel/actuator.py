r"""Laws of the actuators: force on the fork, and rates of the actuator's own states.

Travel *x* and speed *v* of the fork, *k* and *d* of the coupling, a level *l* for the own state.

- Spring: :math:`F = (F_0 - c x)_+`. Cam: :math:`F = k (s(t) - x) + d (\dot s - v)` within
  :math:`\pm F_0`, with *s* a cubic step in time over the ramp. Through a lag
  :math:`\tau \dot l = F/F_0 - l` the spring's is :math:`l F_0`.
- Motor of the mass *m* at its spindle's travel *s*: :math:`F = k (s - x) + d (\dot s - v)`,
  :math:`m \ddot s = F_s (1 - \dot s/v_0) - F`, the first term within :math:`\pm F_0`.
- Pneumatic: :math:`F = A (p - p_0) - F_b - F_r - c x` with :math:`p = l p_s`, isothermal,
  :math:`(V_0 + A x) \dot p = C p_n p_s \omega(p/p_s) - p A v`, :math:`\omega(r) = 1` up to the
  critical ratio *b* and :math:`\sqrt{1 - ((r - b)/(1 - b))^2}` above (ISO 6358-1), linear in the
  last thousandth. Above the supply the flow turns round.
- Hydraulic: :math:`(V_0 + A x) \dot p = \beta (Q_s \sqrt{1 - l} - A v)`, linear near 0.
- Solenoid: :math:`F = F_s g_s^2/g^2 \, l^2 - F_r - c x` with :math:`l = i R/U`, gap *g* with its
  residual part, :math:`L = L_s g_s/g`, :math:`L \dot i = u U - R i - i v L/g`.

Behind the start of the fork a return spring stands on its stop: there *F* is 0 or more.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math

from dogshape.sim.kernel.compiler import compiled
from dogshape.sim.kernel_layout import (
    AMBIENT_PA,
    CAM,
    HYDRAULIC,
    MOTOR,
    PNEUMATIC,
    SOLENOID,
    SPRING,
)

LAMINAR_RATIO = 0.999  #: of pressures, above which the flow of air is linear in it
LAMINAR_SHARE = 0.01  #: pressure drop over the supply, below which the flow of oil is linear


@compiled
def cam_motion(time, numbers):
    """Compute travel, m, and speed, m/s, of the fork that a cam prescribes."""
    share = (time - numbers.dwell_time) / numbers.ramp_time
    if share <= 0.0:
        return 0.0, 0.0
    if share >= 1.0:
        return numbers.stroke, 0.0
    mean_speed = numbers.stroke / numbers.ramp_time
    travel = numbers.stroke * share * share * (3.0 - 2.0 * share)
    return travel, 6.0 * mean_speed * share * (1.0 - share)


@compiled
def air_flow(ratio, critical_ratio):
    """Compute the flow of air over the choked one from the ratio of pressures, up to 1."""
    if ratio <= critical_ratio:
        return 1.0
    limited_ratio = min(ratio, LAMINAR_RATIO)
    subsonic = (limited_ratio - critical_ratio) / (1.0 - critical_ratio)
    flow = math.sqrt(1.0 - subsonic * subsonic)
    if ratio > LAMINAR_RATIO:
        flow *= (1.0 - ratio) / (1.0 - LAMINAR_RATIO)
    return flow


@compiled
def oil_flow(drop):
    """Compute the flow of oil over that at the whole supply from the drop over the supply."""
    return drop / (drop * drop + LAMINAR_SHARE * LAMINAR_SHARE) ** 0.25


@compiled
def armature_gap(travel, numbers):
    """Compute the gap of a solenoid with its residual part, m."""
    return numbers.residual_gap + numbers.stroke - min(max(travel, 0.0), numbers.stroke)


@compiled
def _direct_force(time, travel, speed, spindle_travel, level, numbers):
    """Compute the force of an actuator without a lag, N."""
    if numbers.kind == SPRING:
        return max(numbers.command - numbers.rate * travel, 0.0)
    if numbers.kind == CAM:
        cam_travel, cam_speed = cam_motion(time, numbers)
        force = numbers.stiffness * (cam_travel - travel) + numbers.damping * (cam_speed - speed)
        return min(max(force, -numbers.command), numbers.command)
    if numbers.kind == MOTOR:
        lead = spindle_travel - travel
        return numbers.stiffness * lead + numbers.damping * (level - speed)
    if numbers.kind == SOLENOID:
        gap_ratio = (numbers.residual_gap + numbers.stroke) / armature_gap(travel, numbers)
        force = numbers.start_force * (gap_ratio * level) ** 2
    else:
        pressure = numbers.supply * level
        if numbers.kind == PNEUMATIC:
            pressure -= AMBIENT_PA
        force = numbers.area * pressure - numbers.back_force
    force -= numbers.preload + numbers.rate * travel
    return max(force, 0.0) if travel <= 0.0 else force


@compiled
def actuator_force(time, travel, speed, spindle_travel, level, numbers):
    """Compute the force that reaches the fork, N.

    Parameters
    ----------
    time : from the command, s.
    travel, speed : of the fork, m and m/s.
    spindle_travel, level : own states, as ``sim.kernel_layout`` has them.
    numbers : a record of ``ACTUATOR_NUMBERS``.
    """
    if numbers.lag > 0.0:
        return numbers.force_share * numbers.command * level
    force = _direct_force(time, travel, speed, spindle_travel, level, numbers)
    return numbers.force_share * force


@compiled
def _pressure_rate(travel, speed, level, numbers):
    """Compute the rate of a cylinder's pressure over its supply, 1/s."""
    volume = numbers.dead_volume + numbers.area * max(travel, 0.0)
    displaced = numbers.area * speed if travel > 0.0 else 0.0
    if numbers.kind == HYDRAULIC:
        inflow = numbers.valve_flow * oil_flow(1.0 - level) - displaced
        return numbers.bulk_modulus / numbers.supply * inflow / volume
    if level <= 1.0:
        flow = air_flow(level, numbers.critical_ratio)
    else:
        flow = -level * air_flow(1.0 / level, numbers.critical_ratio)
    return (numbers.valve_flow * flow - level * displaced) / volume


@compiled
def _current_rate(travel, speed, level, numbers):
    """Compute the rate of a solenoid's current over the rated one, 1/s."""
    gap = armature_gap(travel, numbers)
    time_constant = numbers.time_constant * (numbers.residual_gap + numbers.stroke) / gap
    motion = 0.0
    if 0.0 < travel < numbers.stroke:
        motion = level * speed * time_constant / gap
    return (numbers.voltage_share - level - motion) / time_constant


@compiled
def actuator_rates(time, travel, speed, spindle_travel, level, numbers):
    """Compute the rates of spindle travel, m/s, and level, 1/s or m/s2; as ``actuator_force``."""
    if numbers.kind == MOTOR:
        drive = numbers.stall_force * (1.0 - level / numbers.no_load_speed)
        drive = min(max(drive, -numbers.command), numbers.command)
        load = _direct_force(time, travel, speed, spindle_travel, level, numbers)
        return level, (drive - load) / numbers.drive_mass
    if numbers.kind in (PNEUMATIC, HYDRAULIC):
        return 0.0, _pressure_rate(travel, speed, level, numbers)
    if numbers.kind == SOLENOID:
        return 0.0, _current_rate(travel, speed, level, numbers)
    if numbers.lag > 0.0:
        force = _direct_force(time, travel, speed, spindle_travel, level, numbers)
        return 0.0, (force / numbers.command - level) / numbers.lag
    return 0.0, 0.0
