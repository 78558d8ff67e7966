"""A toy bench: shift times in closed form, in which some effects act in known ways.

A shift is a free flight over the axial gap and the rest of the travel under a force that rises
linearly, and a wait for the next slot that is uniform over a share of the pitch. Effects of other
names change nothing, as some do on a bench.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.sim.effects import load
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from tests.conftest import RISE

Array = NDArray[np.float64]

SPEEDS = (5.0, 10.0, 25.0, 50.0, 100.0, 149.0, 249.0)
EFFECTS = load()
CLUTCH = load_bench("mq200_adams").clutch
NEUTRAL = {"force_factor": 1.0, "dynamic_friction": 0.16, "mismatch_factor": 1.0}


def _get(values: Mapping[str, Array], name: str) -> Array | float:
    return values.get(name, NEUTRAL.get(name, 0.0))


def times_of(values: Mapping[str, Array], point: OperatingPoint, shares: Array) -> Array:
    """Return times in s, (m, q), at shares (q,) of the wait; values are (m, 1)."""
    force = point.profile.force
    rise = point.profile.rise
    nominal = abs(point.mismatch) * _get(values, "mismatch_factor")
    slip = nominal + _get(values, "offset_rpm") * RPM
    mass = 0.3 + _get(values, "added_mass_kg")
    full = force * _get(values, "force_factor")
    friction = _get(values, "friction_N")
    # Force grows linearly: friction costs the time until it is overcome, mass the cube root.
    delay = friction / full * rise + 0.7 * _get(values, "lag_s")
    gap = 1.0e-3 + _get(values, "gap_offset_mm") * 1e-3
    travel = gap + 3.7e-3
    flight = np.cbrt(6.0 * mass * rise * travel / full)
    # With rising friction and chamfer a longer share of the pitch holds the dogs apart.
    blocked = 0.25 + 0.8 * _get(values, "dynamic_friction")
    blocked = blocked * (1.0 - 0.08 * _get(values, "chamfer_offset_deg"))
    wait = 24.0 * np.pi / 180.0 / np.maximum(slip, 0.5 * RPM)
    excess = np.maximum(0.0, shares - (1.0 - blocked)) / blocked
    return _get(values, "delay_s") + delay + flight + excess * blocked * np.minimum(wait, 0.4)


def points_of(forces: Sequence[float] = tuple(RISE)) -> tuple[OperatingPoint, ...]:
    """Return operating points at all speeds and some forces."""
    return tuple(
        OperatingPoint(speed * RPM, ForceProfile(force, RISE[force]))
        for speed in SPEEDS
        for force in forces
    )


def bench_of(
    values: Mapping[str, float],
    generator: np.random.Generator,
    *,
    shifts: int = 10,
    single: bool = False,
    points: Sequence[OperatingPoint] | None = None,
) -> Bench:
    """Return a data set of the toy with values of effects; ``single`` gives each shift."""
    points = points_of() if points is None else points
    arrays = {name: np.array([[value]]) for name, value in values.items()}
    readings = []
    for point in points:
        times = np.atleast_2d(times_of(arrays, point, generator.random(shifts)))[0]
        groups = [(1, t) for t in times] if single else [(shifts, times.mean())]
        for n, time in groups:
            readings.append(Reading(len(readings) + 2, point, n, float(time), True))
    cells = gather(readings)
    return Bench(name="toy", source="closed form", clutch=CLUTCH, cells=cells)
