r"""Peak forces of one shift, and the validity of rigid rings behind compliant dogs.

*Along the shaft* the ring stops within the time of a half sine, :math:`3/2` of the time above half
of the peak. A stress wave runs through a steel ring of the length :math:`L = m/(\varrho A)` and
back in :math:`2 L/c`, :math:`c = \sqrt{E/\varrho}` (Goldsmith, *Impact*, 1960): in a shorter
contact the ring is not rigid, and less of its mass takes part. *A* is the annulus of the dogs.

*Along the circumference* a rigid sliding side stops at once. For shifts with rigid shafts the
closed form of ``[strike]`` adds ring and shaft, at the speed of the hardest strike and with the
stiffer flank.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.materials import DENSITY, YOUNG

HALF_SINE = 1.5  #: duration of a half sine over its time above half of the peak


def contact_time(time: Array, force: Array) -> float:
    """Compute the duration of the largest peak of ``force`` (n,) as of a half sine, s.

    A force is the mean over the step that ends at its ``time`` (n,).
    """
    peak = int(np.argmax(force))
    low_steps = np.flatnonzero(force < 0.5 * force[peak])
    rise_steps = low_steps[low_steps < peak]
    fall_steps = low_steps[low_steps > peak]
    first = int(rise_steps[-1]) if rise_steps.size else 0
    last = int(fall_steps[0]) - 1 if fall_steps.size else len(force) - 1
    return HALF_SINE * float(time[last] - time[first])


@dataclass(frozen=True)
class PeakForces:
    """Simulated peak forces of a shift, N, with the conditions under which they hold."""

    axial: float
    tangential: float
    contact: float  #: duration of the axial peak, s
    wave: float  #: passage of a stress wave through the ring and back, s
    shafts: bool  #: whether the sliding ring was simulated on an elastic shaft
    strike: float | None  #: tangential force of ``[strike]`` for that shift, N

    @property
    def rigid_axially(self) -> bool:
        """Whether the ring is rigid within the axial peak."""
        return self.contact >= self.wave


def peak_forces(result: Engagement, limits: Limits) -> PeakForces:
    """Compute the peak forces of a shift; the largest of a range of strikes."""
    dog = result.clutch.dog
    area = math.pi * (dog.outer_radius**2 - dog.inner_radius**2)
    length = result.clutch.rings.mass / (DENSITY * area)
    count = result.clutch.pair.touching_count
    load = limits.beside(result.clutch.pair.output).load
    pair_stiffness = max(load.stiffness(dog, flank) for flank in FLANKS)
    stiffness = count * pair_stiffness * dog.mean_radius**2
    speed = abs(result.loads.strike_mismatch)
    torques = [strike.torque(speed, stiffness) for strike in limits.strikes]
    return PeakForces(
        axial=result.loads.peak_axial_force,
        tangential=result.loads.peak_tangential_force,
        contact=contact_time(result.trace.time, result.trace.contact_force),
        wave=2.0 * length * math.sqrt(DENSITY / YOUNG),
        shafts=result.clutch.mechanism.ring_inertia > 0.0,
        strike=max(torques) / dog.mean_radius if torques else None,
    )
