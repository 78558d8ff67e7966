r"""Flank strike: the torque with which flanks meet at a mismatch, in closed form.

A chain of four inertias on three springs: rest of the sliding side, input shaft :math:`c_1`, ring
:math:`J_r`, dogs :math:`k = N c r^2`, wheel :math:`J_w`, output shaft, rest. Closed flanks at the
speed *w*: :math:`T_c = \sum_i |k \Delta_i q_i/\omega_i|` over the modes (Rao, *Mechanical
Vibrations*, ch. 6).

Second strike: the flanks give back the share *e*, the spline closes over the play *b* and the shaft
throws the ring forward; with :math:`\theta = \tau \sqrt{c_1/J_r}` it strikes with :math:`\nu w`,
:math:`\nu = 1 - (1 + e) \cos\theta`, where :math:`w \tau - (1 + e) w \sqrt{J_r/c_1} \sin\theta = e
b/(1 + e)`, or :math:`2 + e` for :math:`\theta > \pi`. The torque is the larger of :math:`T_c` and
:math:`\nu w \sqrt{k J_r J_w/(J_r + J_w)}`, at most that of the whole inertias. Against the motion
(``tests/verification/test_strike.py``) a third too much in the median; with an output shaft up to
1.8 times too little for one chain in fifty. No damping; scatter of dogs as in
``sim.strength.load_case``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dogshape.sim.errors import InputError, refusal, require_between, require_ranges, within
from dogshape.sim.shift.geometry import FLANKS, Flank
from dogshape.sim.units import RPM

RESTITUTION = 0.25  #: that the default contact leaves at 0.2 m/s; less at higher speed
REMEDY = "correct the strike"


@dataclass(frozen=True)
class Strike:
    """Inertias and shafts that take part when flanks strike, and the speed of it.

    Parameters
    ----------
    ring_inertia : of the sliding ring with its toothing, kg m2.
    sliding_inertia : of all on its side, the ring included, kg m2.
    input_stiffness : torsional stiffness of the shaft between the two, N m/rad.
    wheel_inertia : of what stands at the flanks on the other side, kg m2.
    output_inertia : of all on that side, the wheel included, kg m2.
    output_stiffness : of the shaft between those, N m/rad; None for a rigid one.
    backlash : play of the ring's spline, rad.
    restitution : share of the speed with which flanks part.
    mismatch : at which traction flanks strike (positive) and braking ones (negative), rad/s.
    strikes : over the life, for fatigue; None for a static limit alone.
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
    strikes: float | None = within("strikes", 1.0, 1e12, None)

    def __post_init__(self) -> None:
        require_ranges(self, "strike", REMEDY)
        for speed in self.mismatch:
            require_between("strike.mismatch_rpm", speed / RPM, -5000.0, 5000.0, REMEDY)
        for name, part, key, whole in (
            ("ring", self.ring_inertia, "sliding", self.sliding_inertia),
            ("wheel", self.wheel_inertia, "output", self.output_inertia),
        ):
            if part > whole:
                rule = f"it is a part of {key}.inertia_kgm2 = {whole:.6g}"
                message = refusal(f"strike.{name}_inertia_kgm2", part, "kg m2", rule, REMEDY)
                raise InputError(message)

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
        low, high = 0.0, math.pi
        for _ in range(60):  # the way falls below zero, then rises through it once
            middle = 0.5 * (low + high)
            if middle - away * math.sin(middle) < play:
                low = middle
            else:
                high = middle
        return (1.0 - away * math.cos(high)) * speed

    def _closed(self, speed: float, stiffness: float) -> float:
        """Return the sum over the modes of the torque between closed flanks, N m."""
        behind = self.sliding_inertia - self.ring_inertia
        beyond = self.output_inertia - self.wheel_inertia
        joint = self.output_stiffness
        chain = [(self.ring_inertia, speed), (self.wheel_inertia, 0.0)]
        springs, at = [stiffness], 0
        if behind > 0.0:
            chain, springs, at = [(behind, speed), *chain], [self.input_stiffness, stiffness], 1
        if joint is None:
            chain[-1] = (self.output_inertia, 0.0)
        elif beyond > 0.0:
            chain, springs = [*chain, (beyond, 0.0)], [*springs, joint]
        inertia, speeds = (np.array(column) for column in zip(*chain, strict=True))
        links = np.diff(np.eye(len(chain)), axis=0)
        root = np.sqrt(inertia)
        forces = links.T @ (np.array(springs)[:, None] * links)
        squares, shapes = np.linalg.eigh(forces / np.outer(root, root))
        # The first mode is the common turning of all, which strains nothing.
        rates, shapes = np.sqrt(squares[1:]), shapes[:, 1:]
        strains = links[at] @ (shapes / root[:, None])
        return float(np.abs(stiffness * strains * (shapes.T @ (root * speeds)) / rates).sum())


def two_mass_torque(speed: float, stiffness: float, one: float, other: float) -> float:
    """Compute the peak torque in N m of two inertias in kg m2 that meet on a spring.

    ``speed`` in rad/s, ``stiffness`` in N m/rad.
    """
    return speed * math.sqrt(stiffness * one * other / (one + other))
