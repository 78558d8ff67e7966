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
from typing import Any

import numpy as np

from dogshape.sim.elementwise import ARRAY, bisect, largest, smallest, sqrt
from dogshape.sim.errors import require_between, require_parts
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.geometry import FLANKS, Flank
from dogshape.sim.units import RPM

RESTITUTION = 0.25  #: that the default contact leaves at 0.2 m/s; less at higher speed
REMEDY = "correct the strike"


@dataclass(frozen=True)
class Strike:
    """Inertias (kg m2), shafts (N m/rad) and mismatches (rad/s) of a flank strike.

    Inertias of a side include ring and wheel; ``output_stiffness`` None is a rigid shaft. Positive
    ``mismatch`` strikes traction flanks, negative braking ones.
    """

    ring_inertia: float = quantity("ring_inertia_kgm2", 1e-7, 100.0, late=True)
    sliding_inertia: float = quantity("sliding_inertia_kgm2", 1e-7, 100.0)
    input_stiffness: float = quantity("input_stiffness_Nm_rad", 1e-3, 1e9, late=True)
    wheel_inertia: float = quantity("wheel_inertia_kgm2", 1e-7, 1e4, late=True)
    output_inertia: float = quantity("output_inertia_kgm2", 1e-7, 1e4)
    output_stiffness: float | None = quantity("output_stiffness_Nm_rad", 1e-3, 1e9, None)
    backlash: float = quantity("backlash_deg", 0.0, 30.0, 0.0)
    restitution: float = quantity("restitution", 0.0, 0.5, RESTITUTION)
    mismatch: tuple[float, ...] = ()
    #: number over the life; None for the static limit alone
    strikes: float | None = quantity("strikes", 1.0, 1e12, None)
    ends: str = ""  #: ends of the ranges of the study file, in words

    def __post_init__(self) -> None:
        require_ranges(self, "strike", REMEDY)
        for speed in self.mismatch:
            require_between("strike.mismatch_rpm", speed / RPM, -5000.0, 5000.0, REMEDY)
        require_parts("strike", self, self, REMEDY)

    def speed(self, flank: Flank) -> float:
        """Return the largest speed at which a flank strikes, rad/s; 0 if it does not strike."""
        sign = 1.0 if flank == "traction" else -1.0
        return max(0.0, *(sign * mismatch for mismatch in (0.0, *self.mismatch)))

    @property
    def flanks(self) -> tuple[Flank, ...]:
        """Flanks that strike."""
        return tuple(flank for flank in FLANKS if self.speed(flank) > 0.0)

    def torque(self, speed: float, stiffness: float) -> float:
        """Compute the torque of a strike, N m.

        ``speed`` of the strike in rad/s, ``stiffness`` of all dogs in N m/rad, a number or (n,).
        """
        ring_torque = two_mass_torque(
            speed, stiffness, first_inertia=self.ring_inertia, second_inertia=self.wheel_inertia
        )
        side_torque = two_mass_torque(
            speed, stiffness, first_inertia=self.sliding_inertia, second_inertia=self.output_inertia
        )
        second_share = self.second_speed(speed) / speed if speed > 0.0 else 0.0
        closed_torque = self._closed_flank_torque(speed, stiffness)
        return smallest(side_torque, largest(closed_torque, second_share * ring_torque))

    def second_speed(self, speed: float) -> float:
        """Compute the speed of the second strike of the ring, rad/s, for the first one's speed."""
        speed_change = 1.0 + self.restitution
        rate = math.sqrt(self.input_stiffness / self.ring_inertia)
        play = 0.0
        if speed > 0.0:
            play = self.restitution * self.backlash * rate / (speed_change * speed)
        if play >= math.pi:
            return (1.0 + speed_change) * speed
        # The displacement falls below zero, then rises through it once.
        _, phase = bisect(lambda angle: angle - speed_change * math.sin(angle) < play, 0.0, math.pi)
        return (1.0 - speed_change * math.cos(phase)) * speed

    def _closed_flank_torque(self, speed: float, stiffness: float) -> float:
        """Compute the torque between closed flanks as the sum over the modes, N m."""
        shaft_inertia = self.sliding_inertia - self.ring_inertia
        rigid_output = self.output_stiffness is None
        wheel_inertia = self.output_inertia if rigid_output else self.wheel_inertia
        chain = (  # inertia, its speed, spring to the next
            (shaft_inertia, speed, self.input_stiffness),
            (self.ring_inertia, speed, stiffness),
            (wheel_inertia, 0.0, self.output_stiffness or 0.0),
            (self.output_inertia - wheel_inertia, 0.0, 0.0),
        )
        parts = [row for row in chain if row[0] > 0.0]
        inertias = np.array([inertia for inertia, _, _ in parts])
        speeds = np.array([part_speed for _, part_speed, _ in parts])
        springs = [spring + np.zeros(np.shape(stiffness)) for _, _, spring in parts[:-1]]
        links = np.diff(np.eye(len(inertias)), axis=0)
        roots = np.sqrt(inertias)
        stiffness_matrix = links.T @ (np.stack(springs, axis=-1)[..., None] * links)
        squared_rates, modes = np.linalg.eigh(stiffness_matrix / np.outer(roots, roots))
        # The first mode is the rotation of all together, which strains nothing.
        rates = np.sqrt(squared_rates[..., 1:])
        modes = modes[..., 1:]
        dog_link = links[int(shaft_inertia > 0.0)]
        strains = (dog_link / roots) @ modes
        swings = np.abs(strains * ((roots * speeds) @ modes) / rates).sum(axis=-1)
        torque: Any = stiffness * swings
        return torque if isinstance(stiffness, ARRAY) else float(torque)


def two_mass_torque(
    speed: float, stiffness: float, first_inertia: float, second_inertia: float
) -> float:
    """Compute the peak torque of two inertias (kg m2) that meet on a spring, N m.

    ``speed`` in rad/s, ``stiffness`` in N m/rad.
    """
    total_inertia = first_inertia + second_inertia
    return speed * sqrt(stiffness * first_inertia * second_inertia / total_inertia)
