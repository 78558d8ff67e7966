r"""A bench at one operating point: the simulated clutch and load, and the reading.

What is read of a shift needs no simulation of its own:

- a *delay* of the force behind the time zero of the record adds to every time;
- the *sensor* stands at the sleeve or at the actuator, and a time is when the displacement
  there makes the shift's travel; a simulated shift has both;
- *relative angles* that are not uniform are weights on the simulated ones: von Mises'
  distribution over the pitch, :math:`w \propto \exp(\kappa \cos 2\pi(\varphi - \varphi_0))` with
  :math:`\varphi` in pitches, concentration :math:`\kappa` and centre :math:`\varphi_0`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import EffectError, did_you_mean, require_between
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record

Sensor = Literal["sleeve", "actuator"]
Weights = NDArray[np.float64]
Part = TypeVar("Part", Mechanism, ContactSet, Dog, OperatingPoint)


@dataclass(frozen=True)
class Setting:
    """One operating point on a bench.

    Parameters
    ----------
    clutch, point : what is simulated.
    delay : of the start of the force behind the time zero of the record, s.
    sensor : where the displacement is read.
    concentration, centre : of the relative angles; 0 is uniform, the centre is in pitches from
        dogs facing dogs.
    """

    clutch: Clutch
    point: OperatingPoint
    delay: float = 0.0
    sensor: Sensor = "sleeve"
    concentration: float = 0.0
    centre: float = 0.0

    def __post_init__(self) -> None:
        require_between("delay_s", self.delay, -10.0, 10.0, "give the delay in seconds")
        require_between("concentration", self.concentration, 0.0, 100.0, "correct the value")
        require_between("centre", self.centre, -1.0, 1.0, "give the centre in pitches")

    def block(self, angles: Sequence[float], seed: int | None = None) -> Block:
        """Return the shifts at relative ``angles`` in rad at the start of the force.

        Equal shifts have equal keys, so settings that differ only in how they are read share
        theirs. ``seed`` is that of the angles' draw, None where they were given.
        """
        return Block(self.clutch, self.point, tuple(angles), seed)

    def time_of(self, row: Record) -> float | None:
        """Return the time that the bench reads of a shift, s; None where it reads none."""
        at_ring = row["shift_time_s"]
        time = row.get("actuator_time_s", at_ring) if self.sensor == "actuator" else at_ring
        return None if time is None else float(time) + self.delay

    def weights(self, angles: Sequence[float]) -> Weights:
        """Return the weight of each relative angle in rad, (n,), 1 on average."""
        turns = np.asarray(angles) / self.clutch.dog.pitch_angle
        return angle_weights(turns, self.concentration, self.centre)

    def with_mechanism(self, **fields: float) -> Setting:
        """Return the same setting with other fields of its mechanism.

        As all four, in SI units; a field that there is not raises EffectError.
        """
        return self._with(mechanism=_other("with_mechanism", self.clutch.mechanism, fields))

    def with_contact(self, **fields: float) -> Setting:
        """Return the same setting with other fields of its contact set.

        The solver stays, so that a change of numbers is taken for none of the scheme.
        """
        return self._with(contact=_other("with_contact", self.clutch.contact, fields))

    def with_dog(self, **fields: float) -> Setting:
        """Return the same setting with other fields of its dog."""
        return self._with(dog=_other("with_dog", self.clutch.dog, fields))

    def with_point(self, **fields: Any) -> Setting:
        """Return the same setting with other fields of its operating point."""
        return replace(self, point=_other("with_point", self.point, fields))

    def _with(self, **fields: Any) -> Setting:
        return replace(self, clutch=replace(self.clutch, **fields))


def _other(method: str, part: Part, fields: Mapping[str, Any]) -> Part:
    valid = [field.name for field in dataclasses.fields(part)]
    for name in fields:
        if name not in valid:
            hint = did_you_mean(name, valid)
            every = "" if hint.startswith("valid") else f" Valid are {', '.join(valid)}"
            raise EffectError(f"{method} has no field '{name}'; {hint}{every}, in SI units")
    return replace(part, **fields)


def angle_weights(
    turns: Weights, concentration: float | Weights, centre: float | Weights
) -> Weights:
    """Return the weights of angles (n,) in pitches, (..., n), 1 on average.

    Concentration and centre are numbers or (..., 1).
    """
    raw = np.exp(concentration * (np.cos(2.0 * np.pi * (turns - centre)) - 1.0))
    weights: Weights = raw / raw.mean(axis=-1, keepdims=True)
    return weights
