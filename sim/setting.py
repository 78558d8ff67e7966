r"""A bench at one operating point: the simulated clutch and load, and the reading.

What is read of a shift needs no simulation: a *delay* of the force behind the time zero of the
record adds to every time; the *sensor* stands at the sleeve or at the actuator; *relative angles*
that are not uniform are weights on the simulated ones, von Mises' over the pitch,
:math:`w \propto \exp(\kappa \cos 2\pi(\varphi - \varphi_0))` with :math:`\varphi` in pitches.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partialmethod
from typing import Any, Literal

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import EffectError, did_you_mean, require_ranges, within
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record

Sensor = Literal["sleeve", "actuator"]


@dataclass(frozen=True)
class Setting:
    """One operating point on a bench."""

    clutch: Clutch  #: what is simulated, at the point
    point: OperatingPoint
    #: of the start of the force behind the time zero of the record, s
    delay: float = within("delay_s", -10.0, 10.0, 0.0, remedy="give the delay in seconds")
    sensor: Sensor = "sleeve"  #: where the displacement is read
    #: of the relative angles; 0 is uniform
    concentration: float = within("concentration", 0.0, 100.0, 0.0)
    centre: float = within("centre", -1.0, 1.0, 0.0)  #: of these, in pitches from dogs facing dogs

    def __post_init__(self) -> None:
        require_ranges(self, "", "correct the value")

    def block(self, angles: Sequence[float]) -> Block:
        """Return the shifts at relative ``angles`` in rad at the start of the force.

        Settings that differ only in how they are read share theirs.
        """
        return Block(self.clutch, self.point, tuple(angles))

    def time_of(self, row: Record) -> float | None:
        """Return the time that the bench reads of a shift, s; None where it reads none."""
        at_ring = row["shift_time_s"]
        time = row.get("actuator_time_s", at_ring) if self.sensor == "actuator" else at_ring
        return None if time is None else float(time) + self.delay

    def _with(self, part: str, /, **fields: Any) -> Setting:
        """Return the same setting with other fields of a part of it, in SI units."""
        whole: Any = self if part == "point" else self.clutch
        old = getattr(whole, part)
        valid = [field.name for field in dataclasses.fields(old)]
        for name in (name for name in fields if name not in valid):
            hint = did_you_mean(name, valid)
            every = "" if hint.startswith("valid") else f" Valid are {', '.join(valid)}"
            raise EffectError(f"with_{part} has no field '{name}'; {hint}{every}, in SI units")
        new = replace(whole, **{part: replace(old, **fields)})
        return new if whole is self else replace(self, clutch=new)

    with_mechanism = partialmethod(_with, "mechanism")  #: with other fields of its mechanism
    with_contact = partialmethod(_with, "contact")  #: of its contact set; the solver stays
    with_dog = partialmethod(_with, "dog")  #: of its dog
    with_point = partialmethod(_with, "point")  #: of its operating point


def angle_weights(turns: Array, concentration: float | Array, centre: float | Array) -> Array:
    """Return the weights of angles (n,) in pitches, (..., n), 1 on average.

    Concentration and centre are numbers or (..., 1).
    """
    at, middle = 2.0 * np.pi * turns, 2.0 * np.pi * np.asarray(centre)
    near = np.cos(at) * np.cos(middle) + np.sin(at) * np.sin(middle)
    raw = np.exp(concentration * (near - 1.0))
    return raw / raw.mean(axis=-1, keepdims=True)
