r"""The surrogate: expected shift time, spread and share engaged over designs and operating points.

Processes over designs have the logarithm of the expected time over a study's operating points, and
those of the times at each point. Beside its variables a design has coordinates of its shape: entry
play, tip width, fall of the face, and :math:`\tanh((\tan\theta - \mu)/0.04)` for each angle, as a
face or flank lets go where its tangent passes the friction coefficient.

Another operating point *o* is interpolated by Matern's correlation *R* (simple kriging, Rasmussen
and Williams 2006): :math:`y(o) = \bar y + r(o)^T R^{-1} (y - \bar y)`, with the variance
:math:`v (1 + \nu - r^T R^{-1} r)` and *v* the likeliest one over all designs. The **share that
engages** is a correlated Beta process (Goetschalckx, Poupart and Hoey 2011). Retries after a time
:math:`t_r` add :math:`t_r (1 - p)/p`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import inf

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.shift_records import DEFAULTS
from dogshape.surrogate.covariance import Term, distance, matern
from dogshape.surrogate.dataset import Dataset, Grid, Mix
from dogshape.surrogate.process import Effort, Process, fit_process

#: Far and near effects of the shape, and steps that no design nearby predicts.
TERMS = (Term(), Term(scales=(0.05, 3.0), first=0.3), Term(scales=(0.1, 0.1), first=0.1))
POINT_EFFORT = Effort(designs=250, steps=15)  #: of the points, from the parameters of the mix
MIN_DESIGNS = 10  #: fewer determine no length scale
EXACT = 1e-4  #: least relative error of a time
CHUNK = 2000  #: designs that are predicted at a time
#: Of what holds or lets go.
ANGLES = ("chamfer_deg", "traction_deg", "braking_deg", "chamfer_back_deg")
WIDTH = 0.04  #: of the change from holding to letting go, tangent of an angle
SHAPE = (
    *(*ANGLES, "height_mm", "count", "outer_diameter_mm", "inner_diameter_mm"),
    *("crest", "backlash_mm"),
)
LENGTHS = (0.1, 0.2, 0.4, inf)  #: of the share, of designs scaled to one and of operating points
STRENGTHS = (1.0, 10.0, 100.0)  #: shifts that the prior of the share counts for
POINT_LENGTHS = np.array([0.6, 2.0])  #: of an interpolation, likeliest with 28 points of MQ200
POINT_NUGGET = 0.03  #: its part that no other point predicts


def coordinates(data: Dataset, x: Array) -> Array:
    """Compute coordinates of designs (m, d) in edge units, scaled by the data's, (m, c)."""
    places = [k for k, name in enumerate(data.variables) if name in ANGLES]
    friction = data.physics.get("face_friction", data.physics["dynamic_friction"])
    ridge = np.tanh((np.tan(np.radians(x[:, places])) - friction) / WIDTH)
    shape, known = shape_of(data, x), shape_of(data, data.grid.x)
    low, span = known.min(axis=0), np.ptp(known, axis=0)
    shape = (shape - low) / np.where(span > 0.0, span, 1.0)
    return np.concatenate([data.scaled(x), ridge, shape], axis=1)


def shape_of(data: Dataset, x: Array) -> Array:
    """Compute entry play, tip width and fall of the face, mm, (m, 3); of a back too, (m, 4)."""
    known = DEFAULTS | data.physics | dict(zip(data.variables, x.T, strict=True))
    size = {name: np.broadcast_to(known[name], len(x)) for name in SHAPE}
    chamfer, traction, braking, back = (np.tan(np.radians(size[name])) for name in ANGLES)
    radius = 0.25 * (size["outer_diameter_mm"] + size["inner_diameter_mm"])
    play = size["height_mm"] * (traction + braking) + size["backlash_mm"]
    tip = np.pi * radius / size["count"] - 0.5 * play
    found = [play, tip, size["crest"] * tip * chamfer / (1.0 - chamfer * braking)]
    if "crest" in {*data.variables, *data.physics}:
        found.append((1.0 - size["crest"]) * tip * back / (1.0 - back * traction))
    return np.column_stack(found)


def point_coordinates(points: Array) -> Array:
    """Compute logarithmic coordinates of operating points, 1/min of either sign and N, (m, 2)."""
    return np.column_stack([np.arcsinh(points[:, 0] / 5.0) / 4.0, np.log(points[:, 1] / 400.0)])


@dataclass(frozen=True)
class Share:
    """Share of shifts that engage: counts (n, q) at designs (n, c) and points (q, 2)."""

    designs: Array
    points: Array
    engaged: Array
    shifts: Array
    length: float
    strength: float  #: of the prior, in shifts

    def predict(self, x: Array, points: Array) -> tuple[Array, Array]:
        """Predict share and its variance at coordinates (m, c) and (p, 2), (m, p) each."""
        return self._beta(self.nearness(x, self.designs), self.nearness(self.points, points))

    def nearness(self, a: Array, b: Array) -> Array:
        """Compute the weight of designs, or points, (m, c) for others (k, c), (m, k)."""
        if self.length == inf:
            return np.ones((len(a), len(b)))
        return np.exp(-0.5 * (distance(a, b) / self.length) ** 2)

    def _beta(self, designs: Array, points: Array) -> tuple[Array, Array]:
        # Jeffreys' overall share is never 0 or 1.
        overall = (self.engaged.sum() + 0.5) / (self.shifts.sum() + 1.0)
        a = designs @ self.engaged @ points + self.strength * overall
        b = designs @ (self.shifts - self.engaged) @ points + self.strength * (1.0 - overall)
        return a / (a + b), a * b / ((a + b) ** 2 * (a + b + 1.0))

    @property
    def likelihood(self) -> float:
        """Logarithmic probability of the counts of each design, predicted by the others."""
        designs = self.nearness(self.designs, self.designs)
        np.fill_diagonal(designs, 0.0)
        share = self._beta(designs, self.nearness(self.points, self.points))[0]
        lost = self.shifts - self.engaged
        return float((self.engaged * np.log(share) + lost * np.log1p(-share)).sum())


def fit_share(designs: Array, points: Array, engaged: Array, shifts: Array) -> Share:
    """Fit length and strength: those that best predict the counts of designs left out."""
    counts = designs, points, engaged, shifts
    if (engaged == shifts).all():
        return Share(*counts, inf, STRENGTHS[-1])
    tried = (Share(*counts, *pair) for pair in product(LENGTHS, STRENGTHS))
    return max(tried, key=lambda share: share.likelihood)


@dataclass(frozen=True)
class Expected:
    """Expected shift time over a mix with its 95 % interval and standard error, s."""

    time: float
    low: float
    high: float
    error: float
    sd: float  #: of a single shift
    engaged: float  #: least share at a point
    retries: float = 0.0  #: time that shifts which do not engage cost
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

    def expected(self, x: Array, mix: Mix) -> Expected:
        """Predict one design (d,) over a mix."""
        x = x[None, :]
        (time,), (variance,) = self._engaging(x, mix)
        share, (retries,), lost = self._retries(x, mix)
        times, _ = self.at_points(x, mix)
        within = (self.variation(mix.points) * times) ** 2 + (times - time) ** 2
        unsure = float(np.sqrt((lost @ self._together(mix) * lost).sum()))
        total, error = float(time + retries), float(np.hypot(variance**0.5, unsure))
        low, high = (float(end) for end in interval(np.array(total), np.array(error)))
        sd = float(mix.weights @ within[0]) ** 0.5
        return Expected(total, low, high, error, sd, float(share.min()), float(retries), unsure)

    def predict(self, x: Array, mix: Mix | None = None) -> tuple[Array, Array]:
        """Predict expected time and standard error of designs (m, d) over a mix, (m,), s."""
        mix, found = mix or self.data.mix, []
        for some in (x[k : k + CHUNK] for k in range(0, len(x), CHUNK)):
            time, variance = self._engaging(some, mix)
            _, retries, lost = self._retries(some, mix)
            unsure = (lost @ self._together(mix) * lost).sum(axis=1)
            found.append((time + retries, np.sqrt(variance + unsure)))
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])

    def joint(self, x: Array) -> tuple[Array, Array]:
        """Predict designs (m, d) over the own mix, (m,), s; smooth covariance, (m, m)."""
        where, mix = coordinates(self.data, x), self.data.mix
        mean, covariance = self.time.joint(where, smooth=True)
        engaged = np.exp(mean + 0.5 * np.diag(covariance))
        _, retries, lost = self._retries(x, mix)
        errors = np.outer(engaged, engaged) * np.expm1(covariance)
        errors += lost @ self._together(mix) @ lost.T * self.share.nearness(where, where)
        return engaged + retries, errors

    def medians(self, x: Array, mix: Mix) -> Array:
        """Predict expected times of designs (m, d) without their errors, at once, (m,), s."""
        where, retries = coordinates(self.data, x), self._retries(x, mix)[1]
        if mix.equals(self.data.mix):
            return np.exp(self.time.mean(where)[:, 0]) + retries
        logarithms = self.points.mean(where)
        return np.exp(logarithms @ self._links(mix.points)[0].T) @ mix.weights + retries

    def at_points(self, x: Array, mix: Mix) -> tuple[Array, Array]:
        """Predict time at each point and variance of its logarithm, (m, p) each; s."""
        logarithms, variance = self.points.predict(coordinates(self.data, x))
        links, unsure = self._links(mix.points)
        # Errors at the points between which a time is interpolated go together.
        variance = (np.sqrt(variance) * self.misfit @ np.abs(links.T)) ** 2 + unsure
        return np.exp(logarithms @ links.T + 0.5 * variance), variance

    def _engaging(self, x: Array, mix: Mix) -> tuple[Array, Array]:
        """Predict the expected time of shifts that engage, and its variance, (m,), s and s2."""
        if mix.equals(self.data.mix):
            mean, variance = self.time.predict(coordinates(self.data, x))
            time = np.exp(mean[:, 0] + 0.5 * variance[:, 0])
            return time, time**2 * np.expm1(variance[:, 0])
        times, variance = self.at_points(x, mix)
        parts = mix.weights * times
        errors = parts * np.sqrt(np.expm1(variance))
        where = point_coordinates(mix.points)
        return parts.sum(axis=1), (errors @ _alike(where, where) * errors).sum(axis=1)

    def _retries(self, x: Array, mix: Mix) -> tuple[Array, Array, Array]:
        """Predict share engaged (m, p), time of retries (m,), and errors by point (m, p), s."""
        share, unsure = self.share.predict(coordinates(self.data, x), point_coordinates(mix.points))
        weights = mix.weights * mix.retry
        return share, (1.0 - share) / share @ weights, np.sqrt(unsure) / share**2 * weights

    def engaged(self, x: Array, mix: Mix) -> Array:
        """Predict the share of shifts that engage of designs (m, d) at each point, (m, p)."""
        return self._retries(x, mix)[0]

    def _together(self, mix: Mix) -> Array:
        """Correlate errors of the share at the points of a mix, (p, p)."""
        where = point_coordinates(mix.points)
        return self.share.nearness(where, where)

    @cached_property
    def misfit(self) -> Array:
        """Root-mean-square error of designs left out over its prediction, at each point, (q,)."""
        mean, variance = self.points.left_out()
        unsure = variance + self.points.noise[:, None] * self.points.scale**2
        return np.sqrt(((mean - self.points.targets) ** 2 / unsure).mean(axis=0))

    @cached_property
    def _inverse(self) -> tuple[Array, float]:
        """Inverse of the points' correlation, (q, q), and variance of times over the points."""
        where, times = point_coordinates(self.data.mix.points), self.points.targets
        correlation = _alike(where, where) + POINT_NUGGET * np.eye(len(where))
        inverse: Array = np.linalg.inv(correlation).astype(float)
        apart = times - times.mean(axis=1, keepdims=True)
        return inverse, float((apart @ inverse * apart).mean())

    def _links(self, points: Array) -> tuple[Array, Array]:
        """Weigh the data's points for others (p, 2), (p, q), with the variance left, (p,)."""
        own, (inverse, variance) = self.data.mix, self._inverse
        near = _alike(point_coordinates(points), point_coordinates(own.points))
        links, size = near @ inverse, len(own.points)
        left = variance * (1.0 + POINT_NUGGET - (links * near).sum(axis=1))
        links += (1.0 - links.sum(axis=1, keepdims=True)) / size
        same = own.places(points)
        known = np.asarray(same.any(axis=1), dtype=bool)
        return np.where(known[:, None], same, links), np.where(known, 0.0, left)

    def variation(self, points: Array) -> Array:
        """Interpolate the relative standard deviation of a shift, (p,): median of the designs."""
        grid = self.data.engaging
        return np.maximum(self._links(points)[0] @ np.median(grid.sds / grid.means, axis=0), 0.0)

    @cached_property
    def spacing(self) -> float:
        """Median distance of a simulated design to the next one, in shares of the range."""
        known = self.data.scaled(self.data.grid.x)
        apart = distance(known, known)
        np.fill_diagonal(apart, np.inf)
        return float(np.median(apart.min(axis=1)))

    def distance(self, x: Array) -> Array:
        """Measure how far designs (m, d) are from the next simulated one, in ``spacing``, (m,)."""
        known, scaled = self.data.scaled(self.data.grid.x), self.data.scaled(x)
        parts = (scaled[k : k + CHUNK] for k in range(0, len(x), CHUNK))
        return np.concatenate([distance(one, known).min(axis=1) for one in parts]) / self.spacing


def logarithms_of(grid: Grid, mix: Mix) -> tuple[Array, Array]:
    """Compute logarithms of expected time and that at each point with variances, (n, 1 + q) each.

    The logarithm of a noisy mean lies half its variance low, which is put back.
    """
    times = np.column_stack([grid.means @ mix.weights, grid.means])
    errors = np.column_stack([np.sqrt(grid.errors**2 @ mix.weights**2), grid.errors])
    noise = np.maximum((errors / times) ** 2, EXACT**2)
    return np.log(times) + 0.5 * noise, noise


def fit(
    data: Dataset,
    effort: Effort = Effort(),  # noqa: B008  a frozen value
    point_effort: Effort = POINT_EFFORT,
    known: tuple[Array, Array, float, float] | None = None,
) -> Surrogate:
    """Fit the surrogate to a data set, unless its parameters are known.

    These are those of both processes, length and strength of the share.

    InputError for fewer than ``MIN_DESIGNS`` designs that engage at every point.
    """
    grid = data.engaging
    if len(grid.x) < MIN_DESIGNS:
        raise InputError(
            f"{len(grid.x)} designs engage at every operating point of the study, but the "
            f"surrogate needs at least {MIN_DESIGNS}; raise surrogate.mix_shifts for 'fit', "
            "search.trials for 'study'"
        )
    where, points = coordinates(data, grid.x), point_coordinates(data.mix.points)
    logs, noise = logarithms_of(grid, data.mix)
    # A mean that is low by luck has a low error too: designs share the mean of theirs.
    noise = np.broadcast_to(noise.mean(axis=0), noise.shape)
    counts = coordinates(data, data.grid.x), points, data.grid.engaged, data.grid.shifts
    first, second, share = None, None, None
    if known is not None:
        effort = point_effort = Effort(steps=0)
        first, second, share = known[0], known[1], Share(*counts, *known[2:])
    time = fit_process(TERMS, where, logs[:, :1], noise[:, :1], start=first, effort=effort)
    second = time.covariance.theta if second is None else second
    each = fit_process(TERMS, where, logs[:, 1:], noise[:, 1:], start=second, effort=point_effort)
    return Surrogate(data, time, each, share or fit_share(*counts))


def interval(time: Array, error: Array) -> tuple[Array, Array]:
    """Return the 95 % interval of positive times with their standard errors, each (m,), s."""
    relative = np.sqrt(np.log1p((error / time) ** 2))
    centre = np.log(time) - 0.5 * relative**2
    return np.exp(centre - 1.96 * relative), np.exp(centre + 1.96 * relative)


def _alike(a: Array, b: Array) -> Array:
    """Correlate times at coordinates of operating points (n, 2) and (m, 2), (n, m)."""
    return matern(distance(a / POINT_LENGTHS, b / POINT_LENGTHS))
