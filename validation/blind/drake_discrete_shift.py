r"""Stand of a blind check in Drake with a discrete solver: a third engine of truths.

Geometry, pressures and mechanisms are Drake's and the project's; time steps, contact solver and
friction law are not those of the simulation. Drake's convex solver *similar* moves the speeds from
step to step (``STEPS``), and regularises a single coefficient over the stiction velocity,
:math:`\mu v/\sqrt{v^2 + v_s^2}`. It knows no fall from the static to the dynamic coefficient. So
the coefficient is the published law's at the slip with which the dogs meet, for the whole shift.
``tests/verification/test_blind_discrete.py`` has how far its mean times are from those of the
continuous engine without any effect. It makes no ripple, no high dog and no force in stages.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.errors import InputError
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant, DiscreteSteps
from dogshape.validation.blind.mujoco_shift import Draw, Shift, coefficient, friction_law
from dogshape.validation.blind.planar_shift import Law, asked_of, clutch_of, read_of
from dogshape.validation.blind.stand import Point, Stand, Truth

STEPS = DiscreteSteps(1e-4, "similar")
AS_PUBLISHED = Law(1.0, 1.0, 1.0)


class DiscreteEngine:
    """A stand with its truth, ready to shift."""

    def __init__(self, stand: Stand, truth: Truth | None = None) -> None:
        self.stand, self.truth = stand, truth or Truth()
        if self.truth.ripple or self.truth.high_dog or self.truth.stage_time:
            raise InputError(
                "Drake's discrete engine has no ripple, no high dog and no force in stages; give "
                "--engine mujoco"
            )
        self._plants: dict[float, ClutchPlant] = {}

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate one shift; ``keep`` keeps its motion."""
        asked = asked_of(self.truth, point, draw)
        found = engage(self._plant(asked.mismatch), asked, draw.angle)
        return read_of(self.stand, self.truth, draw, found, keep)

    def _plant(self, mismatch: float) -> ClutchPlant:
        """Build the plant with the coefficient of a mismatch in rad/s, once for each."""
        law = friction_law(self.stand, self.truth)
        slip = max(law[2], self.stand.radius * abs(mismatch))
        # Without what regularises creep, which the solver does itself.
        friction = coefficient(law, slip) * (1.0 + (law[2] / slip) ** 2) ** 0.5
        friction = round(friction, 4)
        if friction not in self._plants:
            clutch = clutch_of(self.stand, self.truth, AS_PUBLISHED)
            contact = replace(clutch.contact, static_friction=friction, dynamic_friction=friction)
            self._plants[friction] = ClutchPlant(replace(clutch, contact=contact), STEPS)
        return self._plants[friction]
