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
from dogshape.sim.errors import EffectError, did_you_mean
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, diverged

Sensor = Literal["sleeve", "actuator"]


@dataclass(frozen=True)
class Setting:
    """One operating point on a bench."""

    clutch: Clutch  #: simulated at the point
    point: OperatingPoint
    #: start of the force after time zero of the record, s
    delay: float = quantity("delay_s", -10.0, 10.0, 0.0, remedy="give the delay in seconds")
    sensor: Sensor = "sleeve"  #: where the displacement is read
    #: concentration of the relative angles; 0 is uniform
    concentration: float = quantity("concentration", 0.0, 100.0, 0.0)
    #: centre of the relative angles in pitches from dogs facing dogs
    centre: float = quantity("centre", -1.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        require_ranges(self, "", "correct the value")
        if self.clutch.actuator is not None:
            self.clutch.actuator.require_course(self.point.profile.lag, rise_factor=1.0)

    def block(self, angles: Sequence[float]) -> Block:
        """Return the block of shifts at relative ``angles`` in rad at the start of the force.

        Settings that differ only in reading or weights share blocks.
        """
        return Block(self.clutch, self.point, tuple(angles))

    def time_of(self, row: Record) -> float | None:
        """Return the shift time that the bench reads, s; None for a shift that did not engage."""
        time = row["shift_time_s"]
        if self.sensor == "actuator":
            time = row.get("actuator_time_s", time)
        return None if time is None else float(time) + self.delay

    def times_of(self, rows: Sequence[Record]) -> Array:
        """Read times as the bench does, s, (n,): inf where not engaged, NaN where failed."""
        times = []
        for row in rows:
            time = self.time_of(row)
            if diverged(row):
                time = np.nan
            elif time is None:
                time = np.inf
            times.append(time)
        return np.array(times, dtype=float)

    def _replace_fields(self, part: str, /, **fields: Any) -> Setting:
        """Return a copy with other ``fields`` of a ``part`` (mechanism, point ...), in SI units."""
        owner: Any = self if part == "point" else self.clutch
        old_part = getattr(owner, part)
        valid_names = [field.name for field in dataclasses.fields(old_part)]
        for name in fields:
            if name not in valid_names:
                hint = did_you_mean(name, valid_names)
                if not hint.startswith("valid"):
                    hint += f" Valid are {', '.join(valid_names)}"
                raise EffectError(f"with_{part} has no field '{name}'; {hint}, in SI units")
        new_owner = replace(owner, **{part: replace(old_part, **fields)})
        return new_owner if owner is self else replace(self, clutch=new_owner)

    with_mechanism = partialmethod(_replace_fields, "mechanism")
    with_contact = partialmethod(_replace_fields, "contact")  #: the solver stays
    with_dog = partialmethod(_replace_fields, "dog")
    with_point = partialmethod(_replace_fields, "point")


def angle_weights(turns: Array, concentration: float | Array, centre: float | Array) -> Array:
    """Compute weights of relative angles, (..., n), of mean 1; ``turns`` (n,) in pitches.

    ``concentration`` and ``centre`` are numbers or (..., 1).
    """
    angles = 2.0 * np.pi * turns
    kappa, centre = np.broadcast_arrays(np.atleast_1d(concentration), np.atleast_1d(centre))
    centre_angle = 2.0 * np.pi * centre
    # The exponent kappa (cos(angle - centre) - 1) as a product of matrices.
    factors = [kappa * np.cos(centre_angle), kappa * np.sin(centre_angle), kappa]
    basis = np.stack([np.cos(angles), np.sin(angles), np.full_like(angles, -1.0)])
    exponent = np.concatenate(factors, axis=-1) @ basis
    weights = np.exp(exponent, out=exponent)
    weights /= weights.mean(axis=-1, keepdims=True)
    return weights
