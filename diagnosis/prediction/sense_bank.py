"""Banks of both senses of rotation, and the emulator that asks the one a hypothesis wants.

The reversed bank has the same effects at the negated operating points, at fewer levels. Where the
sense is known it has no more than the baseline, which takes a fiftieth of the shifts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.sense import REVERSED, Sense, forward
from dogshape.diagnosis.prediction.bank import COMMON, Bank, Plan, both
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.levels import Level, only_read
from dogshape.diagnosis.prediction.prediction import Marks, Prediction
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.shift.actuation import ForceProfile

#: Of the reversed bank: as many angles of the baseline as in the other one, fewer levels.
ANGLES, DENSE, LEVELS, PLANE = 8, 6, 3, 9


def forward_plan(effects: Mapping[str, Effect]) -> Plan:
    """Return the plan of the bank with the sense of the table."""
    return Plan(tuple(effect for name, effect in effects.items() if name != REVERSED))


def reversed_plan(effects: Mapping[str, Effect], bench: Bench) -> Plan:
    """Return the plan of the reversed bank of a data set.

    Where the sense is known, it has effects alone that only change how a shift is read.
    """
    sense: Sense = bench.mismatch_sense
    setting = setting_of(bench)
    mine = {
        name: effect
        for name, effect in effects.items()
        if name != REVERSED and (sense == "unknown" or only_read(effect, setting))
    }
    checks = tuple(both(COMMON, name) for name in mine if name != COMMON)
    return Plan(tuple(mine.values()), ANGLES, DENSE, LEVELS, PLANE, checks)


def reversed_bench(bench: Bench) -> Bench:
    """Return a data set with every mismatch negated."""
    cells = tuple(
        # Nought stays +0, so that the point keeps its key.
        replace(cell, point=replace(cell.point, mismatch=0.0 - cell.point.mismatch))
        for cell in bench.cells
    )
    return replace(bench, cells=cells)


Simulate = Callable[[Sequence[Level]], Array]


class SenseEmulator:
    """Emulator for hypotheses of either sense of rotation.

    ``turned`` is the bank with the reversed sense, whose curves are fitted when first asked.
    ``simulate`` gives times of joint levels, s, (L, C, n), with the sense of the table; None where
    none can be simulated.
    """

    def __init__(self, plain: BankEmulator, turned: Bank, simulate: Simulate | None = None) -> None:
        self.plain = plain
        self._turned = turned
        self._simulate = simulate

    def acting(self, hypothesis: Hypothesis) -> Hypothesis:
        """List the effects of a hypothesis that are simulated, none of the reversed sense."""
        if REVERSED in hypothesis or self._simulate is None:
            return ()
        return tuple(name for name in hypothesis if name in self.plain.fits)

    def joint_levels(self, acting: Hypothesis) -> int:
        """Count the levels at which effects were simulated together."""
        return len(self.plain.bank.of(acting))

    def with_levels(self, levels: Sequence[Level]) -> SenseEmulator:
        """Simulate effects together at some levels, and return an emulator that has them."""
        assert self._simulate is not None
        changed = copy(self)
        changed.plain = self.plain.with_levels(levels, self._simulate(levels))
        return changed

    @cached_property
    def reversed(self) -> BankEmulator:
        """The emulator at the negated operating points."""
        return BankEmulator(self._turned)

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis.

        Raises InputError for an effect that the bank of its sense does not have.
        """
        one = self.reversed if REVERSED in hypothesis else self.plain
        return one.at(forward(hypothesis), values, cell)

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Return the marks of the flight, which ends before the dogs meet: of either sense."""
        return self.plain.flight(forward(hypothesis), values, profile)
