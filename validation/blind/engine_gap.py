"""Offset of both engines without any effect: a named gap in the error budget of the check.

MuJoCo's dogs pass each other a little sooner than Drake's, alike at all strengths of all effects.
This offset is no effect, and a diagnosis without it would name one for it. So before the first case
both engines make the same shifts without any effect, at the even angles of the bank. The mean
delay of MuJoCo's shifts, outliers aside, is added to all predictions of that operating point. The
residual offset where effects act is the common error ``REST``.

The offset can only be measured on a stand without effects, which no real stand is: there the common
error of ``diagnosis.settings.Rules`` covers all of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.prediction.prediction import FlightEmulator, Marks, Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.validation.blind.mujoco_shift import Draw, Engine
from dogshape.validation.blind.stand import Point, Stand

REST = 0.03  #: common error that is left, as share of the mean time
SOON = 1e-3  #: s, no time is less
RULES = Rules(discrepancy=REST)


def engines_apart(stand: Stand, bank: Bank) -> list[float]:
    """Measure the delay of MuJoCo's shifts behind the bank's at each of its points, s."""
    engine = Engine(stand)
    found = []
    for setting, angles, first in zip(bank.settings, bank.angles, bank.baseline, strict=True):
        second = second_times(engine, setting, angles)
        both = timely(first, second)
        found.append(float((second - first)[both].mean()) if both.any() else 0.0)
    return found


def second_times(engine: Engine, setting: Setting, angles: Iterable[float]) -> Array:
    """Return MuJoCo's times at an operating point, s, NaN where a shift did not engage, (n,)."""
    profile = setting.point.profile
    point = Point(setting.point.mismatch, profile.force, profile.rise)
    times = [engine.shift(point, Draw(float(angle))).time for angle in angles]
    return np.array([np.nan if time is None else time for time in times])


def timely(first: Array, second: Array) -> np.ndarray:
    """Mark shifts of two engines, s, (n,) each, that are outliers in neither."""
    return np.isfinite(bulk(first)) & np.isfinite(bulk(second))


@dataclass(frozen=True)
class Moved:
    """An emulator whose times are later by ``offsets``, s, one for each operating point.

    ``turned`` are those with the reversed sense of rotation.
    """

    emulator: FlightEmulator
    offsets: Sequence[float]
    turned: Sequence[float] = ()

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis."""
        found = self.emulator.at(hypothesis, values, cell)
        offsets = self.turned if REVERSED in hypothesis else self.offsets
        return replace(found, times=np.maximum(found.times + offsets[cell], SOON))

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Return the marks of the flight, which ends before the dogs meet."""
        return self.emulator.flight(hypothesis, values, profile)
