r"""The surrogate: expected shift time, spread and share engaged over designs and operating points.

Gaussian processes over designs predict the logarithm of the expected time over a study's operating
points, and the logarithm of the time at each point. Beside its variables a design has coordinates
of its shape: entry play, tip width, fall of the face, and :math:`\tanh((\tan\theta - \mu)/0.04)`
for each angle, since a face or flank slides where its tangent exceeds the friction coefficient.

Another operating point *o* is interpolated by Matern's correlation *R* (simple kriging, Rasmussen
and Williams 2006): :math:`y(o) = \bar y + r(o)^T R^{-1} (y - \bar y)`, with the variance
:math:`v (1 + \nu - r^T R^{-1} r)`, nugget :math:`\nu` and *v* of maximum likelihood over all
designs. Due to the mean :math:`\bar y` the weights of the points add up to 1. The **share that
engages** is a correlated Beta process (Goetschalckx, Poupart and Hoey 2011). Retries after a time
:math:`t_r` add :math:`t_r (1 - p)/p`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import product
from math import inf
from typing import Any

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.shift_records import DEFAULTS
from dogshape.surrogate.covariance import Term, distance, matern
from dogshape.surrogate.dataset import Dataset, Grid, Mix
from dogshape.surrogate.process import Effort, Process, fit_process

#: Effects of the shape over long and short distances, and jumps that no design nearby predicts.
TERMS = (Term(), Term(scales=(0.05, 3.0), first=0.3), Term(scales=(0.1, 0.1), first=0.1))
#: Effort of the process of the points; its fit starts at the parameters of the expected time.
POINT_EFFORT = Effort(designs=250, steps=15)
MIN_DESIGNS = 10  #: fewer determine no length scale
MIN_RELATIVE_ERROR = 1e-4  #: of a time
CHUNK_DESIGNS = 2000  #: designs that are predicted at once
#: Angles that decide whether a face or flank sticks or slides.
ANGLES = ("chamfer_deg", "traction_deg", "braking_deg", "chamfer_back_deg")
RIDGE_WIDTH = 0.04  #: of the change from sticking to sliding, tangent of an angle
SHARE_LENGTHS = (0.1, 0.2, 0.4, inf)  #: of the correlation of the share, in scaled coordinates
SHARE_STRENGTHS = (1.0, 10.0, 100.0)  #: of the prior of the share, as a number of shifts
POINT_LENGTHS = np.array([0.6, 2.0])  #: of an interpolation, likeliest with 28 points of MQ200
POINT_NUGGET = 0.03  #: share of the variance that no other point predicts
MISMATCH_SCALE = 5.0  #: of the mismatch's coordinate, 1/min: linear below, logarithmic above
MISMATCH_UNIT = 4.0  #: of the mismatch's coordinate: brings it to the range of the force's
FORCE_SCALE = 400.0  #: of the force's coordinate, N
NORMAL_95 = 1.96  #: half width of a 95 % interval, standard deviations


def coordinates(data: Dataset, x: Array) -> Array:
    """Compute coordinates of designs (m, d) in edge units, scaled by the data's, (m, c)."""
    names = [name.removeprefix(OUTPUT_PREFIX) for name in data.variables]
    columns = [k for k, name in enumerate(names) if name in ANGLES]
    friction = data.physics.get("face_friction", data.physics["dynamic_friction"])
    tangents = np.tan(np.radians(x[:, columns]))
    ridge = np.tanh((tangents - friction) / RIDGE_WIDTH)
    shape = shape_of(data, x)
    data_shape = shape_of(data, data.grid.x)
    span = np.ptp(data_shape, axis=0)
    shape = (shape - data_shape.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    return np.concatenate([data.scaled(x), ridge, shape], axis=1)


@dataclass(frozen=True)
class _Shape:
    """Dogs of designs in the units of their keys, an array (m,) for each key."""

    chamfer_deg: Array
    traction_deg: Array
    braking_deg: Array
    chamfer_back_deg: Array
    height_mm: Array
    count: Array
    outer_diameter_mm: Array
    inner_diameter_mm: Array
    crest: Array
    backlash_mm: Array


def shape_of(data: Dataset, x: Array) -> Array:
    """Compute entry play, tip width and fall of the face of designs (m, d), mm, (m, 3).

    Where the data have a crest, a fourth column is the fall of the back of the face. Where the
    output dog varies, its columns follow, and depth and play of the pair.
    """
    values = DEFAULTS | data.physics | dict(zip(data.variables, x.T, strict=True))
    sliding = _shape_from(values, len(x))
    has_back = "crest" in data.variables or "crest" in data.physics
    columns = _dog_columns(sliding, sliding.height_mm, has_back=has_back)
    if any(name.startswith(OUTPUT_PREFIX) for name in data.variables):
        output_values = {
            name.removeprefix(OUTPUT_PREFIX): value
            for name, value in values.items()
            if name.startswith(OUTPUT_PREFIX)
        }
        output = _shape_from(values | output_values, len(x))
        has_back |= "crest" in output_values
        # Sliding and output dog are equally wide half the sliding dog's height above its root.
        crest_height = 2.0 * output.height_mm - sliding.height_mm
        columns += _dog_columns(output, crest_height, has_back=has_back)
        depth = np.minimum(sliding.height_mm, output.height_mm)
        backlash = 0.5 * (sliding.backlash_mm + output.backlash_mm)
        columns += [depth, depth * _lean(sliding) + backlash]
    return np.column_stack(columns)


def _shape_from(values: Mapping[str, Any], size: int) -> _Shape:
    """Collect the dogs of ``size`` designs from ``values`` by key."""
    return _Shape(*(np.broadcast_to(values[field.name], size) for field in fields(_Shape)))


def _lean(shape: _Shape) -> Array:
    """Compute the sum of the tangents of both side angles, (m,)."""
    traction = np.tan(np.radians(shape.traction_deg))
    braking = np.tan(np.radians(shape.braking_deg))
    return np.asarray(traction + braking)


def _dog_columns(shape: _Shape, height: Array, *, has_back: bool) -> list[Array]:
    """Compute play, tip width and falls of the tip, mm, (m,) each.

    ``height`` is twice that of the crest above the pitch plane, mm.
    """
    chamfer = np.tan(np.radians(shape.chamfer_deg))
    traction = np.tan(np.radians(shape.traction_deg))
    braking = np.tan(np.radians(shape.braking_deg))
    back = np.tan(np.radians(shape.chamfer_back_deg))
    radius = 0.25 * (shape.outer_diameter_mm + shape.inner_diameter_mm)
    play = height * (traction + braking) + shape.backlash_mm
    tip = np.pi * radius / shape.count - 0.5 * play
    # A face falls from the ridge to the flank, which leans towards or away from it.
    face_fall = shape.crest * tip * chamfer / (1.0 - chamfer * braking)
    columns = [play, tip, face_fall]
    if has_back:
        columns.append((1.0 - shape.crest) * tip * back / (1.0 - back * traction))
    return columns


def point_coordinates(points: Array) -> Array:
    """Compute logarithmic coordinates of operating points, signed 1/min and N, (m, 2)."""
    mismatch = np.arcsinh(points[:, 0] / MISMATCH_SCALE) / MISMATCH_UNIT
    return np.column_stack([mismatch, np.log(points[:, 1] / FORCE_SCALE)])


@dataclass(frozen=True)
class Share:
    """Share of shifts that engage: a correlated Beta process over designs and points."""

    designs: Array  #: coordinates, (n, c)
    points: Array  #: coordinates, (q, 2)
    engaged: Array  #: number of shifts that engaged, (n, q)
    shifts: Array  #: number of shifts, (n, q)
    length: float  #: of the correlation, of coordinates
    strength: float  #: of the prior, in shifts

    def predict(self, x: Array, points: Array) -> tuple[Array, Array]:
        """Predict share and its variance at coordinates (m, c) and (p, 2), (m, p) each."""
        return self._beta(self.correlation(x, self.designs), self.correlation(self.points, points))

    def correlation(self, a: Array, b: Array) -> Array:
        """Compute the correlation of the share at coordinates (m, c) and (k, c), (m, k)."""
        if self.length == inf:
            return np.ones((len(a), len(b)))
        return np.exp(-0.5 * (distance(a, b) / self.length) ** 2)

    def _beta(self, designs: Array, points: Array) -> tuple[Array, Array]:
        """Compute mean and variance from correlations (m, n) and (q, p), (m, p) each."""
        # The overall share with Jeffreys' prior, which is never 0 or 1.
        overall = (self.engaged.sum() + 0.5) / (self.shifts.sum() + 1.0)
        failed = self.shifts - self.engaged
        alpha = designs @ self.engaged @ points + self.strength * overall
        beta = designs @ failed @ points + self.strength * (1.0 - overall)
        total = alpha + beta
        return alpha / total, alpha * beta / (total**2 * (total + 1.0))

    @property
    def likelihood(self) -> float:
        """Logarithmic probability of the counts of each design, predicted by the others."""
        designs = self.correlation(self.designs, self.designs)
        np.fill_diagonal(designs, 0.0)
        share, _ = self._beta(designs, self.correlation(self.points, self.points))
        not_engaged = self.shifts - self.engaged
        return float((self.engaged * np.log(share) + not_engaged * np.log1p(-share)).sum())


def fit_share(designs: Array, points: Array, engaged: Array, shifts: Array) -> Share:
    """Fit length and strength of the share by leaving out each design.

    ``designs`` (n, c) and ``points`` (q, 2) are coordinates, the counts are (n, q).
    """
    counts = designs, points, engaged, shifts
    if (engaged == shifts).all():
        return Share(*counts, length=inf, strength=SHARE_STRENGTHS[-1])
    candidates = [
        Share(*counts, length=length, strength=strength)
        for length, strength in product(SHARE_LENGTHS, SHARE_STRENGTHS)
    ]
    return max(candidates, key=lambda share: share.likelihood)


@dataclass(frozen=True)
class Expected:
    """Expected shift time over a mix with its 95 % interval and standard error, s."""

    time: float
    low: float
    high: float
    error: float
    sd: float  #: of a single shift
    engaged: float  #: smallest share at a point
    retries: float = 0.0  #: mean time of retries within ``time``
    retries_error: float = 0.0

    @property
    def without_retries(self) -> tuple[float, float]:
        """Expected time of the shifts that engage, and its standard error, s."""
        return self.time - self.retries, max(self.error**2 - self.retries_error**2, 0.0) ** 0.5


@dataclass(frozen=True)
class Surrogate:
    """Processes of the logarithms of the expected time, and of that at each point of its mix."""

    data: Dataset
    time: Process
    points: Process
    share: Share

    def expect(self, x: Array, mix: Mix) -> Expected:
        """Predict the expected shift time of one design (d,) over a mix."""
        x = x[None, :]
        (time,), (variance,) = self._predict_engaging(x, mix)
        share, (retries,), point_errors = self._predict_retries(x, mix)
        times, _ = self.predict_points(x, mix)
        # Variance of a shift: within each point, and of the points' means.
        squares = (self.variation(mix.points) * times) ** 2 + (times - time) ** 2
        retries_variance = _quadratic_form(point_errors, self._share_correlation(mix))
        retries_error = float(np.sqrt(retries_variance[0]))
        total = float(time + retries)
        error = float(np.hypot(variance**0.5, retries_error))
        low, high = interval(np.array(total), np.array(error))
        return Expected(
            time=total,
            low=float(low),
            high=float(high),
            error=error,
            sd=float(mix.weights @ squares[0]) ** 0.5,
            engaged=float(share.min()),
            retries=float(retries),
            retries_error=retries_error,
        )

    def predict(self, x: Array, mix: Mix | None = None) -> tuple[Array, Array]:
        """Predict expected time and standard error of designs (m, d) over a mix, s, (m,) each.

        ``mix`` is by default that of the data.
        """
        mix = mix or self.data.mix
        correlation = self._share_correlation(mix)
        times = []
        errors = []
        for start in range(0, len(x), CHUNK_DESIGNS):
            designs = x[start : start + CHUNK_DESIGNS]
            time, variance = self._predict_engaging(designs, mix)
            _, retries, point_errors = self._predict_retries(designs, mix)
            retries_variance = _quadratic_form(point_errors, correlation)
            times.append(time + retries)
            errors.append(np.sqrt(variance + retries_variance))
        return np.concatenate(times), np.concatenate(errors)

    def predict_jointly(self, x: Array) -> tuple[Array, Array]:
        """Predict designs (m, d) over the data's mix: times, s, (m,), and covariance, s2, (m, m).

        The covariance is that of the smooth terms (``Term.rough``): jumps are left out.
        """
        designs = coordinates(self.data, x)
        mix = self.data.mix
        mean, covariance = self.time.predict_jointly(designs, smooth=True)
        times = np.exp(mean + 0.5 * np.diag(covariance))
        _, retries, point_errors = self._predict_retries(x, mix)
        time_covariance = np.outer(times, times) * np.expm1(covariance)
        retries_covariance = point_errors @ self._share_correlation(mix) @ point_errors.T
        retries_covariance *= self.share.correlation(designs, designs)
        return times + retries, time_covariance + retries_covariance

    def predict_medians(self, x: Array, mix: Mix) -> Array:
        """Predict the median expected times of designs (m, d) over a mix, s, (m,).

        It computes no errors, so it is faster than ``predict``.
        """
        designs = coordinates(self.data, x)
        _, retries, _ = self._predict_retries(x, mix)
        if mix.equals(self.data.mix):
            return np.exp(self.time.mean(designs)[:, 0]) + retries
        point_weights, _ = self._point_weights(mix.points)
        logarithms = self.points.mean(designs)
        return np.exp(logarithms @ point_weights.T) @ mix.weights + retries

    def predict_points(self, x: Array, mix: Mix) -> tuple[Array, Array]:
        """Predict time, s, at each point and variance of its logarithm, (m, p) each."""
        logarithms, variance = self.points.predict(coordinates(self.data, x))
        weights, interpolation_variance = self._point_weights(mix.points)
        # Errors at the data's points are taken as fully correlated.
        errors = np.sqrt(variance) * self.misfit
        variance = (errors @ np.abs(weights.T)) ** 2 + interpolation_variance
        return np.exp(logarithms @ weights.T + 0.5 * variance), variance

    def _predict_engaging(self, x: Array, mix: Mix) -> tuple[Array, Array]:
        """Predict the expected time of shifts that engage, s, and its variance, s2, (m,) each."""
        if mix.equals(self.data.mix):
            mean, variance = self.time.predict(coordinates(self.data, x))
            time = np.exp(mean[:, 0] + 0.5 * variance[:, 0])
            return time, time**2 * np.expm1(variance[:, 0])
        times, variance = self.predict_points(x, mix)
        terms = mix.weights * times
        errors = terms * np.sqrt(np.expm1(variance))
        points = point_coordinates(mix.points)
        correlation = _point_correlation(points, points)
        return terms.sum(axis=1), _quadratic_form(errors, correlation)

    def _predict_retries(self, x: Array, mix: Mix) -> tuple[Array, Array, Array]:
        """Predict share engaged (m, p), time of retries, s, (m,), and its errors, s, (m, p).

        Errors at the points of a mix are correlated by ``_share_correlation``.
        """
        share, variance = self.share.predict(
            coordinates(self.data, x), point_coordinates(mix.points)
        )
        weights = mix.weights * mix.retry
        retries_per_shift = (1.0 - share) / share
        retries_error = np.sqrt(variance) / share**2  # derivative of (1 - p) / p is -1 / p^2
        return share, retries_per_shift @ weights, retries_error * weights

    def predict_engaged(self, x: Array, mix: Mix) -> Array:
        """Predict the share of shifts that engage of designs (m, d) at each point, (m, p)."""
        return self._predict_retries(x, mix)[0]

    def _share_correlation(self, mix: Mix) -> Array:
        """Compute the correlation of errors of the share at the points of a mix, (p, p)."""
        points = point_coordinates(mix.points)
        return self.share.correlation(points, points)

    @cached_property
    def misfit(self) -> Array:
        """Ratio of leave-one-out errors to predicted ones at each point, root mean square, (q,)."""
        mean, variance = self.points.leave_one_out()
        predicted_variance = variance + self.points.noise[:, None] * self.points.scale**2
        return np.sqrt(((mean - self.points.targets) ** 2 / predicted_variance).mean(axis=0))

    @cached_property
    def _kriging(self) -> tuple[Array, float]:
        """Inverse of the points' correlation, (q, q), and variance of ln time over the points."""
        points = point_coordinates(self.data.mix.points)
        times = self.points.targets
        correlation = _point_correlation(points, points) + POINT_NUGGET * np.eye(len(points))
        inverse: Array = np.linalg.inv(correlation).astype(float)
        deviation = times - times.mean(axis=1, keepdims=True)
        return inverse, float((deviation @ inverse * deviation).mean())

    def _point_weights(self, points: Array) -> tuple[Array, Array]:
        """Compute kriging weights of the data's points at points (p, 2), and their variance.

        Weights (p, q) of a point of the data select it, with variance 0; variances are (p,).
        """
        mix = self.data.mix
        inverse, variance = self._kriging
        correlation = _point_correlation(point_coordinates(points), point_coordinates(mix.points))
        weights = correlation @ inverse
        kriging_variance = variance * (1.0 + POINT_NUGGET - (weights * correlation).sum(axis=1))
        mean_weights = (1.0 - weights.sum(axis=1, keepdims=True)) / len(mix.points)
        match = mix.match(points)
        simulated = np.asarray(match.any(axis=1), dtype=bool)
        weights = np.where(simulated[:, None], match, weights + mean_weights)
        return weights, np.where(simulated, 0.0, kriging_variance)

    def variation(self, points: Array) -> Array:
        """Interpolate the median relative standard deviation of a shift over designs, (p,)."""
        grid = self.data.engaging
        medians = np.median(grid.sds / grid.means, axis=0)
        return np.maximum(self._point_weights(points)[0] @ medians, 0.0)

    @cached_property
    def spacing(self) -> float:
        """Median distance of a simulated design to the nearest one, in shares of the range."""
        simulated = self.data.scaled(self.data.grid.x)
        distances = distance(simulated, simulated)
        np.fill_diagonal(distances, np.inf)
        return float(np.median(distances.min(axis=1)))

    def distance(self, x: Array) -> Array:
        """Measure the distance of designs (m, d) to the nearest simulated one, spacings, (m,)."""
        simulated = self.data.scaled(self.data.grid.x)
        designs = self.data.scaled(x)
        nearest = []
        for start in range(0, len(x), CHUNK_DESIGNS):
            distances = distance(designs[start : start + CHUNK_DESIGNS], simulated)
            nearest.append(distances.min(axis=1))
        return np.concatenate(nearest) / self.spacing


def log_times(grid: Grid, mix: Mix) -> tuple[Array, Array]:
    """Compute logarithms of expected time and that at each point with variances, (n, 1 + q) each.

    Half the variance is added, as the logarithm of a noisy mean is too low by that on average.
    """
    times = np.column_stack([grid.means @ mix.weights, grid.means])
    errors = np.column_stack([np.sqrt(grid.errors**2 @ mix.weights**2), grid.errors])
    noise = np.maximum((errors / times) ** 2, MIN_RELATIVE_ERROR**2)
    return np.log(times) + 0.5 * noise, noise


@dataclass(frozen=True)
class Parameters:
    """Parameters of a fitted surrogate."""

    time: Array  #: ``theta`` of the process of the expected time
    points: Array  #: ``theta`` of the process of the times at points
    share_length: float
    share_strength: float


def fit(
    data: Dataset,
    effort: Effort = Effort(),  # noqa: B008  a frozen value
    point_effort: Effort = POINT_EFFORT,
    parameters: Parameters | None = None,
) -> Surrogate:
    """Fit the surrogate to a data set, or build it from ``parameters``.

    Raises InputError for fewer than ``MIN_DESIGNS`` designs that engage at every point.
    """
    grid = data.engaging
    if len(grid.x) < MIN_DESIGNS:
        raise InputError(
            f"{len(grid.x)} designs engage at every operating point of the study, but the "
            f"surrogate needs at least {MIN_DESIGNS}; raise surrogate.mix_shifts for 'fit', "
            "search.trials for 'study'"
        )
    inputs = coordinates(data, grid.x)
    logarithms, noise = log_times(grid, data.mix)
    # A mean that is low by chance has a small error too: all designs take the mean variance.
    noise = np.broadcast_to(noise.mean(axis=0), noise.shape)
    if parameters is not None:
        effort = point_effort = Effort(steps=0)
    time = fit_process(
        TERMS,
        inputs,
        targets=logarithms[:, :1],
        noise=noise[:, :1],
        start=None if parameters is None else parameters.time,
        effort=effort,
    )
    points = fit_process(
        TERMS,
        inputs,
        targets=logarithms[:, 1:],
        noise=noise[:, 1:],
        start=time.covariance.theta if parameters is None else parameters.points,
        effort=point_effort,
    )
    counts = (
        coordinates(data, data.grid.x),
        point_coordinates(data.mix.points),
        data.grid.engaged,
        data.grid.shifts,
    )
    if parameters is None:
        share = fit_share(*counts)
    else:
        share = Share(*counts, length=parameters.share_length, strength=parameters.share_strength)
    return Surrogate(data, time, points, share)


def interval(time: Array, error: Array) -> tuple[Array, Array]:
    """Compute 95 % intervals of positive times from standard errors, s, (m,) each."""
    relative = np.sqrt(np.log1p((error / time) ** 2))
    centre = np.log(time) - 0.5 * relative**2
    return np.exp(centre - NORMAL_95 * relative), np.exp(centre + NORMAL_95 * relative)


def _quadratic_form(errors: Array, correlation: Array) -> Array:
    """Compute variances of the sums of correlated errors, (m, p) with (p, p), (m,)."""
    return (errors @ correlation * errors).sum(axis=1)


def _point_correlation(a: Array, b: Array) -> Array:
    """Correlate times at coordinates of operating points (n, 2) and (m, 2), (n, m)."""
    return matern(distance(a / POINT_LENGTHS, b / POINT_LENGTHS))
