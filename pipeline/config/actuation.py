"""Shift force of a study: what reaches the sleeve of a nominal force, and when."""

from __future__ import annotations

from dataclasses import dataclass

from dogshape.sim.shift.actuation import ForceProfile, LaggedProfile, RiseTable


@dataclass(frozen=True)
class Actuation:
    """Rise times by the final force, and how the sleeve's force differs from the nominal one.

    Parameters
    ----------
    nominal : rise time by the nominal final force.
    delay, lag : dead time before the force starts and lag of first order behind its course, s.
    factor : of the force at the sleeve over the nominal one; the rise keeps its time.
    loss : constant part of the force at the sleeve that is lost, N; the rise keeps its time.
    rise_factor : of the rise time over the nominal one.
    """

    nominal: RiseTable
    delay: float = 0.0
    lag: float = 0.0
    factor: float = 1.0
    loss: float = 0.0
    rise_factor: float = 1.0

    @property
    def table(self) -> RiseTable:
        """Rise time by the final force at the sleeve, before the loss."""
        forces = tuple(self.factor * force for force in self.nominal.forces)
        return RiseTable(forces, tuple(self.rise_factor * rise for rise in self.nominal.rises))

    def profile(self, force: float, rise: float | None = None, other_way: str = "") -> ForceProfile:
        """Compute the force at the sleeve, N, from a nominal final ``force`` in N.

        A nominal ``rise`` in s overrides the table; ``other_way`` is what a user may do beside
        extending it where it lacks the force.
        """
        if rise is None:
            rise = self.nominal.profile(force, other_way).rise
        return self._shaped(self.factor * ForceProfile(force, rise).force, self.rise_factor * rise)

    def at_sleeve(self, force: float) -> ForceProfile:
        """Return the profile of a final ``force`` at the sleeve before the loss, N."""
        return self._shaped(force, self.table.profile(force).rise)

    def _shaped(self, force: float, rise: float) -> ForceProfile:
        if self.lag == 0.0:
            return ForceProfile(force, rise, delay=self.delay, loss=self.loss)
        return LaggedProfile(force, rise, self.lag, delay=self.delay, loss=self.loss)

    @property
    def record(self) -> dict[str, float]:
        """Dead time, lag and loss as the record of a shift has them; empty where there are none."""
        found = {"force_delay_s": self.delay, "force_lag_s": self.lag, "force_loss_N": self.loss}
        return {key: value for key, value in found.items() if value != 0.0}
