r"""Expected times at the operating points of one study, learnt from designs that have them all.

Rows spread over all operating points have to say how times run from point to point; at the points
of a study nothing need be said between them. A process over designs alone has the logarithm of the
expected time over the study's mix, and another one for each of its points:

.. math:: \ln E_i = f(x_i) + \epsilon_i, \qquad f \sim GP, \quad \epsilon_i \sim N(0, s^2),

*s* being the error that the angles of a design leave, of all designs alike: a mean that is low by
luck has a low error too (``surrogate.process.known_noise``). A sum over its points
predicts no better than the process of the mix and needs the covariance of all their errors.

Beside its variables a design has coordinates that its shape follows from: the play with which a
dog enters, the width of its tip and how deep its face falls, all at the mean radius. Other mixes
and points are those of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dogshape.surrogate.covariance import Array, Covariance, Term, starting
from dogshape.surrogate.dataset import Dataset, Mix
from dogshape.surrogate.process import Process, design_coordinates

#: What the shape does far and near, and steps that no design nearby predicts.
TERMS = (
    Term(design=True, point=False),
    Term(design=True, point=False, scales=(0.05, 3.0), first=0.3),
    Term(design=True, point=False, scales=(0.1, 0.1), first=0.1),
)
SHAPE = (
    "chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count", "outer_diameter_mm",
    "inner_diameter_mm",
)  # fmt: skip


@dataclass(frozen=True)
class MixTimes:
    """Designs that were simulated at every operating point of a mix, and processes of their times.

    Parameters
    ----------
    mix : operating points (q, 2) with weights.
    about : of the study's data: variables, ranges and physics.
    x : designs, (n, d), edge units.
    means : of the shifts that engage at each point, (n, q), s.
    noise : variance of the logarithm of the expected time, then of that at each point, (1 + q,).
    shifts : simulated shifts behind them.
    processes : of the logarithms, in the order of ``noise``.
    scaled : number of the first designs, whose shape sets the scale of coordinates; None for all.
    """

    mix: Mix
    about: Dataset
    x: Array
    means: Array
    noise: Array
    shifts: int
    processes: tuple[Process, ...] = ()
    scaled: int | None = None

    @cached_property
    def inputs(self) -> Array:
        """Coordinates of the designs, (n, c)."""
        return self.coordinates(self.x)

    def coordinates(self, x: Array) -> Array:
        """Return coordinates of designs (m, d) in edge units, (m, c)."""
        plain = design_coordinates(self.about, x)
        shape, spans = shape_of(self.about, x), self.spans
        if shape is None or spans is None:
            return plain
        low, span = spans
        return np.concatenate([plain, (shape - low) / span], axis=1)

    @cached_property
    def spans(self) -> tuple[Array, Array] | None:
        """Least of each coordinate of the shape over the designs, and its range, (3,) each."""
        shape = shape_of(self.about, self.x[: self.scaled])
        if shape is None:
            return None
        low, span = shape.min(axis=0), np.ptp(shape, axis=0)
        return low, np.where(span > 0.0, span, 1.0)

    @cached_property
    def logarithms(self) -> Array:
        """Logarithms of the expected time and of that at each point, (n, 1 + q)."""
        times = np.column_stack([self.means @ self.mix.weights, self.means])
        # The logarithm of a noisy mean lies half its variance low.
        return np.log(times) + 0.5 * self.noise

    def process_of(self, mix: Mix) -> Process | None:
        """Return the process of the whole mix, or of one of its points; None for any other."""
        known = self.mix
        if _same(mix.points, known.points) and np.allclose(mix.weights, known.weights, atol=1e-9):
            return self.processes[0]
        if len(mix.points) != 1:
            return None
        there = [_same(mix.points, point[None, :]) for point in known.points]
        return self.processes[1 + there.index(True)] if any(there) else None

    def covers(self, mix: Mix) -> bool:
        """Check whether every point of a mix is one of these, in their order."""
        return _same(mix.points, self.mix.points)

    def at_points(self, x: Array) -> tuple[Array, Array]:
        """Return mean and variance of the logarithms of designs (m, d) at each point, (m, q)."""
        where = self.coordinates(x)
        found = [process.predict(where) for process in self.processes[1:]]
        mean, variance = (np.column_stack([pair[k] for pair in found]) for k in (0, 1))
        return mean, variance


def shape_of(about: Dataset, x: Array) -> Array | None:
    """Return entry play, width of the tip and fall of the face of designs (m, d), (m, 3), mm.

    As ``sim.shift.geometry.Dog`` has them. None where neither the variables nor the physics say
    what they follow from.
    """
    known = {name: x[:, place] for place, name in enumerate(about.variables)}
    known |= {k: np.full(len(x), float(about.physics[k])) for k in SHAPE if k in about.physics}
    if any(name not in known for name in SHAPE):
        return None
    chamfer, traction, braking = (np.tan(np.radians(known[name])) for name in SHAPE[:3])
    radius = 0.25 * (known["outer_diameter_mm"] + known["inner_diameter_mm"])
    play = known["height_mm"] * (traction + braking)
    tip = np.pi * radius / known["count"] - 0.5 * play
    fall = tip * chamfer / (1.0 - chamfer * braking)
    return np.column_stack([play, tip, fall])


def _same(points: Array, others: Array) -> bool:
    return points.shape == others.shape and bool(np.allclose(points, others, atol=1e-6))


def own_record(own: MixTimes) -> dict[str, Any]:
    """Give times over a study's own points as JSON takes them, and as ``own_of`` reads them."""
    return {
        "points": own.mix.points.tolist(),
        "weights": own.mix.weights.tolist(),
        "retry": own.mix.retry,
        "designs": own.x.tolist(),
        "means": own.means.tolist(),
        "noise": own.noise.tolist(),
        "shifts": own.shifts,
        "processes": [
            {"theta": one.covariance.theta.tolist(), "weights": one.weights.tolist()}
            for one in own.processes
        ],
    }


def own_of(record: dict[str, Any], about: Dataset) -> MixTimes:
    """Return the times of a record; KeyError, TypeError or ValueError where it is incomplete."""
    points, weights, x, means, noise = (
        np.array(record[key], dtype=float)
        for key in ("points", "weights", "designs", "means", "noise")
    )
    mix = Mix(points, weights, float(record["retry"]))
    bare = MixTimes(mix, about, x, means, noise, int(record["shifts"]))
    if len(record["processes"]) != len(noise):
        raise ValueError(f"{len(record['processes'])} processes instead of {len(noise)}")
    each = tuple(_read(bare, place, one) for place, one in enumerate(record["processes"]))
    return replace(bare, processes=each)


def _read(bare: MixTimes, place: int, record: dict[str, Any]) -> Process:
    theta, weights = (np.array(record[key], dtype=float) for key in ("theta", "weights"))
    count = bare.inputs.shape[1]
    size = len(starting(TERMS, count, 0)[0])
    if len(theta) != size:
        raise ValueError(f"{len(theta)} parameters instead of {size}")
    noise = np.full(len(bare.x), bare.noise[place])
    covariance = Covariance(TERMS, count, 0, theta)
    return Process(covariance, bare.inputs, bare.logarithms[:, place], noise, weights)
