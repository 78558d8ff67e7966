r"""A single impact in closed form, and under the published contact law.

Flat faces of area *A* press with :math:`F = k A x (1 + d v)` (Hunt and Crossley 1975). For a mass
*m* alone with that force that arrives at :math:`v_0`, with :math:`g(u) = u - \ln(1 + u)`,

.. math:: x_{max}^2 = \frac{2 m}{k A d^2} g(d v_0), \qquad g(-d v_1) = g(d v_0).

The published model used IMPACT of Adams, :math:`F = K x^{3/2} + C s(x/x_C) v` with the cubic step
*s* (``ImpactLaw``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.special import lambertw

from dogshape.sim.shift.actuation import cubic_step
from dogshape.sim.shift.clutch import ContactSet, ImpactLaw


@dataclass(frozen=True)
class Impact:
    """Deepest penetration in m, restitution, and time in contact in s."""

    penetration: float
    restitution: float
    duration: float


def impact(contact: ContactSet, area: float, mass: float, speed: float) -> Impact:
    """Compute an impact over ``area`` (m2) of ``mass`` (kg) at ``speed`` (m/s) in closed form.

    The time in contact is an integral over the speed, by quadrature.
    """
    d = contact.dissipation
    stiffness = contact.stiffness * area
    level = d * speed - math.log1p(d * speed)
    penetration = math.sqrt(2.0 * mass * level / stiffness) / d

    def slowness(angle: float, arriving: bool) -> float:
        # x = penetration sin(angle) takes away the root where the speed vanishes.
        remaining_level = level * math.cos(angle) ** 2
        return penetration * math.cos(angle) / (_speed(remaining_level, arriving) / d)

    quarter_turn = 0.5 * math.pi
    times = [quad(slowness, 0.0, quarter_turn, args=(arriving,))[0] for arriving in (True, False)]
    return Impact(penetration, restitution(d * speed), sum(times))


def restitution(approach: float) -> float:
    """Compute the speed of departure over that of arrival; ``approach`` is d v."""
    if approach < 1e-9:
        return 1.0
    return _speed(approach - math.log1p(approach), False) / approach


def _speed(level: float, arriving: bool) -> float:
    """Solve g(u) = level while arriving, g(-u) = level while leaving, for u > 0."""
    sign = 1.0 if arriving else -1.0
    if level < 1e-4:  # Lambert's W loses its digits at the branch point; its series does not
        root = sign * math.sqrt(2.0 * level)
        return sign * (root + root**2 / 3.0 + root**3 / 36.0)
    branch = -1 if arriving else 0
    return float(abs(1.0 + lambertw(-math.exp(-1.0 - level), branch).real))


def published_impact(law: ImpactLaw, mass: float, speed: float) -> Impact:
    """Integrate an impact under a law of Adams; mass in kg, speed in m/s."""

    def motion(_: float, state: NDArray[np.float64]) -> list[float]:
        x, v = state
        damping = cubic_step(x / law.depth, law.damping)
        return [v, -max(0.0, law.stiffness * max(x, 0.0) ** 1.5 + damping * v) / mass]

    def separation(_: float, state: NDArray[np.float64]) -> float:
        return float(state[0])

    separation.terminal = True  # type: ignore[attr-defined]
    separation.direction = -1.0  # type: ignore[attr-defined]
    solution = solve_ivp(
        motion,
        (0.0, 1.0),
        [1e-12, speed],
        events=separation,
        method="LSODA",
        rtol=1e-9,
        atol=1e-14,
    )
    return Impact(
        penetration=float(solution.y[0].max()),
        restitution=float(-solution.y[1, -1] / speed),
        duration=float(solution.t[-1]),
    )
