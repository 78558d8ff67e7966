r"""The free flight of the ring up to the first touch, as an effect changes it.

Until dogs touch, ring and actuator move along the shaft alone, with the equations of
``sim.shift.mechanism`` without contact:

.. math:: m_s \ddot x = L - R_0 \sigma(\dot x) - D(x) - c \dot x, \qquad m_a \ddot y = F(t) - L.

The compiled engine integrates them with the other ring moved aside, so a flight costs less than a
shift, and every effect and pair can fly at many values. Simulated shifts in Drake have the same
flight (``tests/verification/test_flight.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import brentq

from dogshape.diagnosis.bench.flight_marks import FORCES, WAYS
from dogshape.diagnosis.terms import Array
from dogshape.sim.planar import kernel
from dogshape.sim.planar.plant import planar_clutch, surfaces_of
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.release import Release, release
from dogshape.sim.shift.trace import crossing

TIGHT, CLOSE = 1e-6, 1e-10  #: error of a speed in m/s and of a place in m that a step may have
FIRST, STEP = 1e-5, 5e-3  #: s, first and longest step
ROOM = 4096  #: steps that are recorded at once
ASIDE = 0.1  #: m by which the other ring stands aside, so that no dogs meet
RING, RING_RATE, ACTUATOR, ACTUATOR_RATE = 1, 4, 6, 7  #: places in a state of the compiled engine
CREEP = 2.0  #: error of a held start, over what a start without holding changes


@dataclass(frozen=True)
class Flight:
    """Marks of a flight from the start of the force, s, (SIZE,); those that do not come before
    the time-out have that.

    ``creep`` is the standard error from the law of friction near rest, s, one for all marks.
    ``margin`` is how far the ring still is from the first touch at each mark of the displacement,
    m. Behind the touch (negative) a mark depends on the relative angle.
    """

    times: Array
    creep: Array
    margin: Array


def fly(setting: Setting, gap: float, force: float) -> Flight:
    """Return the marks of a flight.

    Parameters
    ----------
    setting : the operating point with its effects; the delay is not part of the result.
    gap, force : nominal axial gap in m and final force in N, of which the marks are shares.
    """
    clutch, profile = setting.clutch, setting.point.profile
    levels = [share * gap for share in WAYS]
    times, margin = _way_marks(setting, levels, held=True)
    forces = [_force_mark(profile, share * force, clutch.timeout) for share in FORCES]
    none = np.zeros(len(forces))
    return Flight(
        np.array([*times, *forces]),
        np.concatenate([_creep(setting, levels), none]),
        np.concatenate([margin, none]),
    )


def touch_time(setting: Setting) -> float:
    """Compute when the ring has closed its axial gap, s from the start of the force.

    Where it never does, that is the time-out.
    """
    clutch = setting.clutch
    gap = clutch.dog.axial_gap
    time, (way, speed), _ = _motion(clutch, setting.point.profile, gap, held=True)
    found = crossing(time, way, speed, gap)
    return clutch.timeout if found is None else found


def _creep(setting: Setting, levels: list[float]) -> Array:
    """Estimate the error of the marks by the law of friction near rest, s.

    The linkage hardly matters for that.
    """
    if setting.clutch.mechanism.friction == 0.0:
        return np.zeros(len(levels))
    return _freed(setting.with_mechanism(compliance=0.0, free_play=0.0), tuple(levels))


@lru_cache(maxsize=4096)
def _freed(setting: Setting, levels: tuple[float, ...]) -> Array:
    free, held = (_way_marks(setting, levels, held=hold)[0] for hold in (False, True))
    return CREEP * (free - held)


def changes_flight(one: Setting, other: Setting) -> bool:
    """Test that two settings can differ in their flight; a delay alone does not count."""
    if one.clutch == other.clutch and one.point.profile == other.point.profile:
        return one.sensor != other.sensor
    return _moving(one) != _moving(other)


def flown(setting: Setting) -> dict[str, Any]:
    """Write the record of all that a flight meets: neither contact nor solver."""
    profile, mechanism, gap, mass, timeout, sensor = _moving(setting)
    return {
        **profile.record,
        **asdict(mechanism),
        "gap": gap,
        "mass": mass,
        "timeout": timeout,
        "sensor": sensor,
    }


def _moving(setting: Setting) -> tuple[ForceProfile, Mechanism, float, float, float, Sensor]:
    """Return all that a flight meets."""
    clutch = setting.clutch
    mechanism = replace(clutch.mechanism, drag_torque=0.0, spline_friction=0.0, spline_radius=0.02)
    if not mechanism.detent:
        mechanism = replace(mechanism, detent_position=0.0)
    gap, mass = clutch.dog.axial_gap, clutch.rings.mass
    return setting.point.profile, mechanism, gap, mass, clutch.timeout, setting.sensor


def _way_marks(setting: Setting, levels: Sequence[float], *, held: bool) -> tuple[Array, Array]:
    """Find the times at which the displacement at the sensor passes levels, s."""
    clutch = setting.clutch
    time, ring, actuator = _motion(clutch, setting.point.profile, levels[-1], held)
    way, speed = actuator if setting.sensor == "actuator" else ring
    found = [crossing(time, way, speed, level) for level in levels]
    times = np.array([clutch.timeout if mark is None else mark for mark in found])
    return times, clutch.dog.axial_gap - np.interp(times, time, ring[0])


def _motion(
    clutch: Clutch, profile: ForceProfile, way: float, held: bool
) -> tuple[Array, Array, Array]:
    """Return times (n,), way and speed of the ring and of the actuator, (2, n) each.

    Up to where both have made the ``way``, or the time-out. Unless ``held`` until friction lets it
    go, the ring creeps from the start as the smooth law has it.
    """
    rest = release(clutch, profile) if held else Release(*np.zeros((3, 1)))
    time, states = _advanced(clutch, profile, 1.02 * way, rest)
    still = np.zeros((2, rest.time.size - 1))
    ring = np.concatenate([still, states[:, [RING, RING_RATE]].T], axis=1)
    time = np.concatenate([rest.time[:-1], time])
    if not clutch.mechanism.has_linkage:
        return time, ring, ring
    loaded = np.array([rest.displacement[:-1], rest.speed[:-1]])
    return time, ring, np.concatenate([loaded, states[:, [ACTUATOR, ACTUATOR_RATE]].T], axis=1)


def _advanced(
    clutch: Clutch, profile: ForceProfile, way: float, rest: Release
) -> tuple[Array, Array]:
    """Integrate from the end of ``rest`` by the compiled engine, without dogs: times and states."""
    plant = planar_clutch(clutch)
    *solid, gap, travel = surfaces_of(clutch.dog)
    numbers = plant.numbers.copy()
    numbers[kernel.WAY] = way
    state = np.zeros(kernel.SIZE)
    now, state[ACTUATOR], state[ACTUATOR_RATE] = (
        float(part[-1]) for part in (rest.time, rest.displacement, rest.speed)
    )
    parts, why = [(np.array([now]), state[None].copy())], kernel.FULL
    mode, step = np.zeros(2), FIRST
    while why == kernel.FULL:
        times, states = np.empty(ROOM), np.empty((ROOM, kernel.SIZE))
        why, now, step, made, _ = kernel.advance(
            now, step, state, clutch.timeout, numbers, np.array(profile.knots()),
            (*solid, gap + ASIDE, travel + ASIDE), plant.law, np.array([TIGHT, CLOSE]), STEP, mode,
            times, states,
        )  # fmt: skip
        parts.append((times[:made], states[:made]))
    return np.concatenate([one for one, _ in parts]), np.concatenate([one for _, one in parts])


def _force_mark(profile: ForceProfile, level: float, timeout: float) -> float:
    """Find the time at which the force passes a level, s; the time-out without one."""
    if float(profile.at(timeout)) <= level:
        return timeout
    return float(brentq(lambda t: float(profile.at(t)) - level, 0.0, timeout, xtol=1e-8))
