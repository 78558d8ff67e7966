r"""Flank strike: the torque with which flanks meet at a mismatch, in closed form.

A chain of four inertias on three springs: rest of the sliding side, input shaft :math:`c_1`, ring
:math:`J_r`, dogs :math:`k = N c r^2`, wheel :math:`J_w`, output shaft, rest. Closed flanks at the
speed *w*: :math:`T_c = \sum_i |k \Delta_i q_i/\omega_i|` over the modes (Rao, ch. 6). Second
strike: flanks give back the share *e*, the spline closes over the play *b*, the shaft throws the
ring forward with :math:`\nu w`, :math:`\nu = 1 - (1 + e) \cos\theta`, :math:`\theta = \tau
\sqrt{c_1/J_r}`, where :math:`w \tau - (1 + e) w \sqrt{J_r/c_1} \sin\theta = e b/(1 + e)`, or
:math:`2 + e` for :math:`\theta > \pi`. The torque is the larger of :math:`T_c` and :math:`\nu w
\sqrt{k J_r J_w/(J_r + J_w)}`, at most that of the whole inertias; no damping. Against the motion
(``tests/verification/test_strike.py``) a third too much in the median.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import bisect
from dogshape.sim.errors import require_between, require_parts, require_ranges, within
from dogshape.sim.shift.geometry import FLANKS, Flank
from dogshape.sim.units import RPM

RESTITUTION = 0.25  #: that the default contact leaves at 0.2 m/s; less at higher speed
REMEDY = "correct the strike"


@dataclass(frozen=True)
class Strike:
    """Inertias (kg m2) and shafts (N m/rad) that take part when flanks strike, and the speed of it.

    Those of a side include ring and wheel; ``output_stiffness`` None is a rigid shaft. Positive
    ``mismatch`` (rad/s) strikes traction flanks, negative braking ones.
    """

    ring_inertia: float = within("ring_inertia_kgm2", 1e-7, 100.0)
    sliding_inertia: float = within("sliding_inertia_kgm2", 1e-7, 100.0)
    input_stiffness: float = within("input_stiffness_Nm_rad", 1e-3, 1e9)
    wheel_inertia: float = within("wheel_inertia_kgm2", 1e-7, 1e4)
    output_inertia: float = within("output_inertia_kgm2", 1e-7, 1e4)
    output_stiffness: float | None = within("output_stiffness_Nm_rad", 1e-3, 1e9, None)
    backlash: float = within("backlash_deg", 0.0, 30.0, 0.0)
    restitution: float = within("restitution", 0.0, 0.5, RESTITUTION)
    mismatch: tuple[float, ...] = ()
    strikes: float | None = within("strikes", 1.0, 1e12, None)  #: of the life; None: static alone
    ends: str = ""  #: of ranges, in words

    def __post_init__(self) -> None:
        require_ranges(self, "strike", REMEDY)
        for speed in self.mismatch:
            require_between("strike.mismatch_rpm", speed / RPM, -5000.0, 5000.0, REMEDY)
        require_parts("strike", self, self, REMEDY)

    def speed(self, flank: Flank) -> float:
        """Return the speed in rad/s at which a flank strikes at most, 0 where it does not."""
        sign = 1.0 if flank == "traction" else -1.0
        return max(0.0, *(sign * one for one in (0.0, *self.mismatch)))

    @property
    def flanks(self) -> tuple[Flank, ...]:
        """Flanks that strike."""
        return tuple(flank for flank in FLANKS if self.speed(flank) > 0.0)

    def torque(self, speed: float, stiffness: float) -> float:
        """Compute the torque of a strike at ``speed`` in rad/s on dogs of ``stiffness``, N m.

        ``stiffness`` is that of all dogs, N m/rad.
        """
        near = two_mass_torque(speed, stiffness, self.ring_inertia, self.wheel_inertia)
        whole = two_mass_torque(speed, stiffness, self.sliding_inertia, self.output_inertia)
        again = self.second_speed(speed) / speed if speed > 0.0 else 0.0
        return min(whole, max(self._closed(speed, stiffness), again * near))

    def second_speed(self, speed: float) -> float:
        """Compute the speed in rad/s at which the ring strikes again, thrown by its shaft."""
        away = 1.0 + self.restitution
        rate = math.sqrt(self.input_stiffness / self.ring_inertia)
        play = self.restitution * self.backlash * rate / (away * speed) if speed > 0.0 else 0.0
        if play >= math.pi:
            return (1.0 + away) * speed
        # The way falls below zero, then rises through it once.
        _, high = bisect(lambda turn: turn - away * math.sin(turn) < play, 0.0, math.pi)
        return (1.0 - away * math.cos(high)) * speed

    def _closed(self, speed: float, stiffness: float) -> float:
        """Return the sum over the modes of the torque between closed flanks, N m."""
        behind, joint = self.sliding_inertia - self.ring_inertia, self.output_stiffness
        wheel = self.output_inertia if joint is None else self.wheel_inertia
        chain = (  # inertia, its speed, spring to the next
            (behind, speed, self.input_stiffness),
            (self.ring_inertia, speed, stiffness),
            (wheel, 0.0, joint or 0.0),
            (self.output_inertia - wheel, 0.0, 0.0),
        )
        inertia, speeds, springs = np.array([row for row in chain if row[0] > 0.0]).T
        links = np.diff(np.eye(len(inertia)), axis=0)
        root = np.sqrt(inertia)
        forces = links.T @ (springs[:-1, None] * links)
        squares, shapes = np.linalg.eigh(forces / np.outer(root, root))
        # The first mode is the common turning of all, which strains nothing.
        rates, shapes = np.sqrt(squares[1:]), shapes[:, 1:]
        strains = links[int(behind > 0.0)] @ (shapes / root[:, None])
        return float(np.abs(stiffness * strains * (shapes.T @ (root * speeds)) / rates).sum())


def two_mass_torque(speed: float, stiffness: float, one: float, other: float) -> float:
    """Compute the peak torque in N m of two inertias in kg m2 that meet on a spring.

    ``speed`` in rad/s, ``stiffness`` in N m/rad.
    """
    return speed * math.sqrt(stiffness * one * other / (one + other))
