r"""The free flight of the ring up to the first touch, as an effect changes it.

Until dogs touch, ring and actuator move along the shaft alone, with the equations of
``sim.shift.mechanism`` without contact:

.. math:: m_s \ddot x = L - R_0 \sigma(\dot x) - D(x) - c \dot x, \qquad m_a \ddot y = F(t) - L.

So a flight costs an integration in one or two degrees of freedom instead of a simulated shift.
Every effect and pair can therefore fly at many values. Simulated shifts in Drake have the same
flight (``tests/verification/test_flight.py``).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from dogshape.diagnosis.bench.flight_marks import FORCES, WAYS
from dogshape.diagnosis.terms import Array
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.release import Release, release
from dogshape.sim.shift.trace import crossing

TIGHT = 1e-5  #: relative tolerance of the integration
STEP = 5e-3  #: s, longest step
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
    linked = clutch.mechanism.has_linkage

    def done(_: float, state: Array) -> float:
        return float(state[::2].min()) - 1.02 * way

    done.terminal = True  # type: ignore[attr-defined]
    begin, stretch, speed = (float(s[-1]) for s in (rest.time, rest.displacement, rest.speed))
    run = solve_ivp(
        _rates(clutch, profile),
        (begin, clutch.timeout),
        np.array([0.0, 0.0, stretch, speed][: 4 if linked else 2]),
        method="LSODA",
        events=done,
        rtol=TIGHT,
        atol=1e-10,
        max_step=STEP,
    )
    time = np.concatenate([rest.time[:-1], run.t])
    still = np.zeros((2, rest.time.size - 1))
    ring = np.concatenate([still, run.y[:2]], axis=1)
    if not linked:
        return time, ring, ring
    loaded = np.array([rest.displacement[:-1], rest.speed[:-1]])
    return time, ring, np.concatenate([loaded, run.y[2:]], axis=1)


def _rates(clutch: Clutch, profile: ForceProfile) -> Callable[[float, Array], list[float]]:
    """Return the rates of way and speed of the ring, and with a linkage of the actuator."""
    mechanism, mass = clutch.mechanism, clutch.rings.mass
    near, far = mechanism.sleeve_mass(mass), mechanism.actuator_mass(mass)
    force = _course(profile)

    def alone(time: float, state: Array) -> list[float]:
        x, v = state.tolist()
        lost = mechanism.resistance(x, v, 0.0) + mechanism.damping * v
        return [v, (force(time) - lost) / near]

    if not mechanism.has_linkage:
        return alone
    linkage = mechanism.linkage(mass)

    def linked(time: float, state: Array) -> list[float]:
        x, v, y, w = state.tolist()
        pull = mechanism.pull(y - x, w - v, *linkage)
        lost = mechanism.resistance(x, v, 0.0) + mechanism.damping * v
        return [v, (pull - lost) / near, w, (force(time) - pull) / far]

    return linked


def _course(profile: ForceProfile) -> Callable[[float], float]:
    """Return the force over time as the plant has it: cubic between the profile's knots."""
    times, forces, slopes = profile.knots()
    pieces = CubicHermiteSpline(times, forces, slopes).c.T.tolist()
    knots, last = times.tolist(), float(forces[-1])

    def at(time: float) -> float:
        if time >= knots[-1]:
            return last
        place = bisect_right(knots, time) - 1
        a, b, c, d = pieces[place]
        u = time - knots[place]
        return float(((a * u + b) * u + c) * u + d)

    return at


def _force_mark(profile: ForceProfile, level: float, timeout: float) -> float:
    """Find the time at which the force passes a level, s; the time-out without one."""
    if float(profile.at(timeout)) <= level:
        return timeout
    return float(brentq(lambda t: float(profile.at(t)) - level, 0.0, timeout, xtol=1e-8))
