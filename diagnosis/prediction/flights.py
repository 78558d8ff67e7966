r"""Free flight of the sliding ring up to the first touch, under any effects, and its density.

Until dogs touch, ring and actuator move along the shaft alone (``sim.shift.mechanism``):

.. math:: m_s \ddot x = L - R_0 \sigma(\dot x) - D(x) - c \dot x, \qquad m_a \ddot y = F(t) - L.

The compiled engine integrates these. For some :math:`10^5` draws :math:`y = t^{-1/2}` of
each mark, margins and creep are interpolated by cubic splines over flights with one or two effects:

.. math:: y(v) = y_0 + \sum_i a_i(v_i) + \sum_{i<j} b_{ij}(v_i, v_j).

A power of the time nears 0 without a jump where the ring no longer arrives.

The *k* marks of a force profile count once, by a Student distribution of few degrees of freedom:

.. math:: \ln L = c_k - \tfrac12 \ln |\Sigma| - \tfrac{\nu + k}2 \ln(1 + d^2/\nu), \qquad
          d^2 = (t - \hat t)^T \Sigma^{-1} (t - \hat t).

:math:`\Sigma` holds the errors of seen and predicted marks, and the creep of a ring that friction
holds. The force of a trace is the one that acts or the nominal one, a half each. *Unknown* has the
baseline's marks, or these moved by offsets: a Gaussian process over the logarithms of force and
share, apart for displacement and force, of several sizes.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import block_diag
from scipy.ndimage import distance_transform_edt, maximum_filter
from scipy.special import gammaln
from scipy.stats import f as f_distribution
from scipy.stats import multivariate_normal, norm

from dogshape.diagnosis.bench.flight_marks import FORCES, SIZE, WAYS, SeenFlight
from dogshape.diagnosis.prediction.curve import Space
from dogshape.diagnosis.prediction.simulations import Level
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim import kernel
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.mechanism import SLIP
from dogshape.sim.shift.planar import FIRST_STEP, free_flight

CREEP = 1.8  #: error of a held start, over the creep of the smooth law by the speed at the mark
#: Numbers of a clutch that act along the shaft without contact.
AXIAL = [
    *(kernel.SLEEVE, kernel.FAR, kernel.DAMPING, kernel.FRICTION, kernel.DETENT, kernel.DETENT_AT),
    *(kernel.DETENT_WIDTH, kernel.STIFF, kernel.LOSS, kernel.PLAY, kernel.SLIP_SPEED),
    *(kernel.DEEP_STOP, kernel.LINKED, kernel.DETENT_SEAT),
]
RING, RING_RATE, ACTUATOR, ACTUATOR_RATE = 1, 4, 6, 7  #: places in a state of the compiled engine

COLUMNS = 2 * SIZE + len(WAYS) + 1  #: of a row: marks as t^(-1/2), creep, margins, delay
NODES = (1, 17, 9, 5, 3)  #: along each parameter of an effect, by the number of parameters
PAIRED = (1, 5, 3, 3, 3)  #: the same of one of two effects
MISSED = 0.25  #: error of a spline over what it misses with every other node only
THREE = 0.5  #: error of three effects together, over the largest that two add to their sum
TOUCHED = 0.02  #: s, error of a mark behind the first touch
LAW = 0.02  #: error of an effect's law, over what it changes

SCALES = np.geomspace(1e-3, 0.2, 10)  #: s, standard deviations of unknown offsets
LENGTH, SMOOTH = 1.5, 0.9  #: length in logarithms, and share of variance, that offsets share
STILL: tuple[Hypothesis, Array] = (), np.zeros((1, 0))  #: the baseline and its values
FREEDOM = USUAL.flight_freedom


@dataclass(frozen=True)
class Marks:
    """Marks of the flight (``diagnosis.bench.flight_marks``), s, (m, SIZE) each."""

    times: Array  #: when displacement and force pass the marks' values; the time-out for never
    error: Array  #: standard error of each mark on its own
    creep: Array  #: standard error of friction near rest, in common


def fly(settings: Sequence[Setting], gap: float, force: float) -> tuple[Array, Array, Array]:
    """Simulate the marks of flights; the delay of a setting is no part of them.

    ``gap`` in m and final ``force`` in N are the nominal ones, of which the marks are shares.
    Times of the marks and their creep, s, (n, SIZE) each; way of the ring at each mark of the
    displacement, m, (n, ways).
    """
    ways, forces = gap * np.array(WAYS), force * np.array(FORCES)
    times, creep = np.zeros((2, len(settings), SIZE))
    rings = np.zeros((len(settings), ways.size))
    for k, setting in enumerate(settings):
        clutch, knots = setting.clutch, setting.point.profile.knots
        time, states, rest = free_flight(clutch, setting.point.profile, float(ways[-1]))
        there = clutch.mechanism.has_linkage and setting.sensor == "actuator"
        place, rate = (ACTUATOR, ACTUATOR_RATE) if there else (RING, RING_RATE)
        way, speed = states[:, place], states[:, rate]
        found = [kernel.crossing(time, way, speed, level) for level in ways]
        found += [kernel.crossing(knots[0], knots[1], knots[2], level) for level in forces]
        times[k] = np.fmin(found, clutch.timeout)  # NaN for never
        marks = times[k, : ways.size]
        rings[k] = np.interp(marks, time, states[:, RING])
        creep[k, : ways.size] = CREEP * SLIP * rest / np.fmax(np.interp(marks, time, speed), SLIP)
    return times, creep, rings


class _Grid(NamedTuple):
    """Table over an even grid of shares of priors, with the error of its spline for the marks."""

    sizes: tuple[int, ...]
    rows: Array
    error: Array

    @classmethod
    def fitted(cls, sizes: tuple[int, ...], rows: Array) -> _Grid:
        """Fill nodes of no bench (NaN) with the nearest; the error is that of a coarse spline."""
        whole = rows.reshape(*sizes, -1)
        missing = np.isnan(whole[..., 0])
        if missing.all():
            whole = np.zeros_like(whole)
        elif missing.any():
            near = distance_transform_edt(missing, return_distances=False, return_indices=True)
            whole = whole[tuple(near)]
        few = whole[(*(slice(None, None, 2) for _ in sizes), slice(SIZE))]
        coarse = _weights(_nodes(sizes), few.shape[:-1], 3) @ few.reshape(-1, SIZE)
        missed = abs(coarse.reshape(*sizes, SIZE) - whole[..., :SIZE])
        error = MISSED * maximum_filter(missed, size=(*(3 for _ in sizes), 1), mode="nearest")
        return cls(sizes, whole.reshape(-1, whole.shape[-1]), error.reshape(-1, SIZE))

    def at(self, shares: Array) -> tuple[Array, Array]:
        """Interpolate at shares (m, p): columns (m, K) and their error (m, SIZE)."""
        rows = _weights(shares, self.sizes, 3) @ self.rows
        return rows, _weights(shares, self.sizes, 1) @ self.error


def _nodes(sizes: Sequence[int]) -> Array:
    """List the nodes of a grid as shares, (n1 n2 ..., p)."""
    grid = list(itertools.product(*(np.linspace(0.0, 1.0, size) for size in sizes)))
    return np.array(grid).reshape(len(grid), len(sizes))


@cache
def _basis(size: int, degree: int) -> BSpline:
    return make_interp_spline(np.linspace(0.0, 1.0, size), np.eye(size), k=min(degree, size - 1))


def _weights(shares: Array, sizes: Sequence[int], degree: int) -> Array:
    """Compute the weights of a grid's nodes in a spline at shares (m, p), (m, n1 n2 ...)."""
    whole = np.ones((len(shares), 1))
    for k, size in enumerate(sizes):
        more = _basis(size, degree)(shares[:, k])
        whole = (whole[:, :, None] * more[:, None, :]).reshape(len(shares), -1)
    return whole


class Flights:
    """Marks of any hypothesis under the force profiles of some operating points.

    The priors of ``effects`` bound the tables; of ``settings`` the first of each profile counts.
    """

    def __init__(self, effects: Mapping[str, Effect], settings: Sequence[Setting]) -> None:
        self.effects = effects
        self.settings = {setting.point.profile: setting for setting in reversed(settings)}
        self._rows: dict[Hashable, Array] = {}
        self._grids: dict[tuple[Hypothesis, ForceProfile], _Grid] = {}

    def marks(
        self, h: Hypothesis, values: Array, profile: ForceProfile, exact: bool = False
    ) -> Marks:
        """Interpolate, or fly, marks at values (m, p); KeyError for a profile of no point."""
        space, shares = self._space(h), np.empty(values.shape)
        for k, parameter in enumerate(space.parameters):
            shares[:, k] = parameter.share(values[:, k])
        least = self.settings[profile].clutch.timeout ** -0.5
        still = self._flown((), np.zeros((1, 0)), profile)
        whole = np.tile(still, (len(values), 1))
        square, joint = np.zeros((2, len(values), SIZE))
        if exact:
            flown, h = self._flown(h, shares, profile), ()
            whole = np.where(np.isnan(flown), still, flown)  # NaN for no bench
        moving = [name for name in h if self._grid((name,), profile).rows[:, :-1].any()]
        for part in (*((name,) for name in h), *itertools.combinations(moving, 2)):
            mine = np.hstack([shares[:, space.columns(name)] for name in part])
            rows, error = self._grid(part, profile).at(mine)
            whole, square = whole + rows, square + error**2
            if len(part) == 2:
                joint = np.maximum(joint, abs(rows[:, :SIZE]))
        if len(moving) > 2:
            square += (THREE * joint) ** 2
        times, before = (np.maximum(one[:, :SIZE], least) ** -2.0 for one in (whole, still))
        square = (2.0 * times**1.5) ** 2 * square + (LAW * (times - before)) ** 2
        square[:, : len(WAYS)] += (TOUCHED * (whole[:, 2 * SIZE : -1] < 0.0)) ** 2
        creep = np.maximum(whole[:, SIZE : 2 * SIZE], 0.0)
        return Marks(times + whole[:, -1:], np.sqrt(square), creep)

    def _space(self, h: Hypothesis) -> Space:
        return Space(tuple(self.effects[name] for name in h), next(iter(self.settings.values())))

    def _grid(self, h: Hypothesis, profile: ForceProfile) -> _Grid:
        """Fly one or two effects at their nodes: their change, of two beyond that of each alone."""
        if (h, profile) not in self._grids:
            space, along = self._space(h), [PAIRED, NODES][len(h) == 1]
            counts = [len(effect.parameters) for effect in space.effects]
            sizes = tuple(n for count in counts for n in count * (along[min(count, 4)],))
            nodes = _nodes(sizes)
            rows = self._flown(h, nodes, profile) - self._flown((), np.zeros((1, 0)), profile)
            for name in h if len(h) == 2 else ():
                rows = rows - self._grid((name,), profile).at(nodes[:, space.columns(name)])[0]
            self._grids[h, profile] = _Grid.fitted(sizes, rows)
        return self._grids[h, profile]

    def _flown(self, h: Hypothesis, shares: Array, profile: ForceProfile) -> Array:
        """Fly shares (m, p) of priors, equal flights once, (m, COLUMNS); NaN for no bench."""
        base, parameters = self.settings[profile], self._space(h).parameters
        keys: dict[int, Hashable] = {}
        new: dict[Hashable, Setting] = {}
        rows = np.full((len(shares), COLUMNS), np.nan)
        for k, row in enumerate(shares.tolist()):
            values = tuple(p.at(share) for p, share in zip(parameters, row, strict=True))
            with suppress(DogshapeError):
                setting = Level(h, values).setting(self.effects, base)
                axial, force = setting.clutch.numbers[AXIAL].tobytes(), setting.point.profile
                keys[k] = profile, force, axial, setting.sensor, setting.clutch.timeout
                new[keys[k]] = setting
                rows[k, 2 * SIZE :] = setting.clutch.dog.axial_gap
                rows[k, -1] = setting.delay + force.delay
        if new := {key: setting for key, setting in new.items() if key not in self._rows}:
            found = fly(list(new.values()), base.clutch.dog.axial_gap, profile.force)
            self._rows.update(zip(new, np.hstack(found), strict=True))
        for k, key in keys.items():
            times, creep, ring = np.split(self._rows[key], (SIZE, 2 * SIZE))
            rows[k, : 2 * SIZE] = *np.maximum(times, FIRST_STEP) ** -0.5, *creep
            rows[k, 2 * SIZE : -1] -= ring
        return rows


def log_flights(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Array:
    """Compute the log density of all profiles' marks at values (m, p) of a hypothesis, (m,)."""
    both = np.zeros((2, len(values)))
    for distance, spread, size in _distances(seen, flights, h, values):
        constant = gammaln((FREEDOM + size) / 2.0) - gammaln(FREEDOM / 2.0)
        constant = constant - 0.5 * size * np.log(FREEDOM * np.pi)
        both += constant - 0.5 * spread - 0.5 * (FREEDOM + size) * np.log1p(distance / FREEDOM)
    return np.asarray(np.logaddexp(*both) - np.log(2.0))


def flight_scores(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Array:
    """Score the marks as normal deviates, (m, profiles), in the likelier reading of the force."""
    tails = np.zeros((2, len(values), len(seen)))
    for k, (distance, _, size) in enumerate(_distances(seen, flights, h, values)):
        tails[:, :, k] = f_distribution.sf(distance / size, size, FREEDOM)
    scores = norm.isf(0.5 * np.maximum(tails, 1e-300))
    acting = (scores[0] ** 2).sum(axis=1) <= (scores[1] ** 2).sum(axis=1)
    return np.where(acting[:, None], scores[0], scores[1])


def log_unknown(seen: Sequence[SeenFlight], flights: Flights) -> float:
    """Compute the log density of all marks if no known effect moved them."""
    if not seen:
        return 0.0
    still = float(log_flights(seen, flights, *STILL)[0])
    predicted = [_predicted(one, flights, *STILL) for one in seen]
    gap = np.concatenate([s.times - p[0][0] for s, p in zip(seen, predicted, strict=True)])
    error = block_diag(*(covariance[0] for *_, covariance in predicted))
    places = np.concatenate([one.places for one in seen])
    force = np.concatenate([np.full(one.places.size, one.profile.force) for one in seen])
    where = np.log([force, np.array([*WAYS, *FORCES])[places]])
    square = ((where[:, :, None] - where[:, None]) ** 2).sum(axis=0)
    way = places < len(WAYS)
    alike = SMOOTH * np.exp(-0.5 * square / LENGTH**2) + (1.0 - SMOOTH) * np.eye(way.size)
    shape = alike * (way[:, None] == way)
    moved = [
        multivariate_normal.logpdf(gap, cov=error + scale**2 * shape * np.outer(which, which))
        for scale in SCALES
        for which in (way | True, way)
    ]
    free = np.logaddexp.reduce(moved) - np.log(len(moved))
    return float(np.logaddexp(still, free) - np.log(2.0))


def _predicted(
    one: SeenFlight, flights: Flights, h: Hypothesis, values: Array
) -> tuple[Array, Array, Array]:
    """Predict the marks that a profile has, (m, k), by acting and nominal force, and covariance."""
    marks = flights.marks(h, values, one.profile)
    times, error, creep = (part[:, one.places] for part in (marks.times, marks.error, marks.creep))
    still = flights.marks(*STILL, one.profile).times[:, one.places]
    nominal = np.where(one.places < len(WAYS), times, still)
    own = np.eye(one.places.size) * (error**2)[:, None, :]
    return times, nominal, one.covariance + own + creep[:, :, None] * creep[:, None, :]


def _distances(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Iterator[tuple[Array, Array, int]]:
    """Yield of each profile squared distances (2, m), log determinants (m,) and number of marks."""
    for one in seen:
        *both, covariance = _predicted(one, flights, h, values)
        root = np.linalg.cholesky(covariance)
        scaled = np.linalg.solve(root, np.stack([one.times - times for times in both], axis=2))
        spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        yield (scaled**2).sum(axis=1).T, spread, one.times.size
