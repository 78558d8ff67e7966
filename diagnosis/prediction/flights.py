r"""Free flight of the sliding ring up to the first touch, under any effects, and its density.

Until dogs touch, ring and actuator move along the shaft alone (``sim.shift.mechanism``):

.. math:: m_s \ddot x = L - R_0 \sigma(\dot x) - D(x) - c \dot x, \qquad m_a \ddot y = F(t) - L.

The compiled engine integrates these. For some :math:`10^5` draws :math:`y = t^{-1/2}` of
each mark, margins and creep are interpolated by cubic splines over flights with one or two effects:

.. math:: y(v) = y_0 + \sum_i a_i(v_i) + \sum_{i<j} b_{ij}(v_i, v_j).

A power of the time nears 0 without a jump where the ring no longer arrives.

Of an actuator the marks of the force are those of its logged channel, pressure or current, with a
fork at rest: the travel changes it little, a contact not at all.

The *k* marks of a force profile count once, by a Student distribution of few degrees of freedom:

.. math:: \ln L = c_k - \tfrac12 \ln |\Sigma| - \tfrac{\nu + k}2 \ln(1 + d^2/\nu), \qquad
          d^2 = (t - \hat t)^T \Sigma^{-1} (t - \hat t).

:math:`\Sigma` has the errors of observed and predicted marks, and the creep of a ring that friction
holds. The force of a trace is the one that acts or the nominal one, a half each. *Unknown* has the
baseline's marks, or these moved by offsets: a Gaussian process over the logarithms of force and
share, one for displacement and one for force, of several sizes.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import gammaln
from scipy.stats import f as f_distribution
from scipy.stats import multivariate_normal, norm

from dogshape.bench.flight_marks import FORCES, SIZE, WAYS, SeenFlight
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.simulations import Level
from dogshape.diagnosis.prediction.spline_table import (
    fill_missing,
    node_shares,
    spline_error,
    spline_weights,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim import kernel
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
)
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import Actuator
from dogshape.sim.shift.mechanism import SMOOTH_SPEED_M_S
from dogshape.sim.shift.planar import FIRST_STEP, channel_course, free_flight

#: Numbers of a clutch that act along the shaft without contact.
AXIAL_NUMBERS = (
    "sleeve_mass",
    "actuator_mass",
    "damping",
    "friction",
    "smooth_speed",
    "detent",
    "detent_position",
    "detent_seat",
    "detent_width",
    "has_linkage",
    "linkage_stiffness",
    "linkage_damping",
    "free_play",
    "stop_depth",
)

#: Columns of a row: marks as t^(-1/2), their creep, margins before the first touch, and delay.
MARK_COLUMNS = slice(SIZE)
CREEP_COLUMNS = slice(SIZE, 2 * SIZE)
MARGIN_COLUMNS = slice(2 * SIZE, -1)
DELAY_COLUMN = -1
COLUMNS = 2 * SIZE + len(WAYS) + 1
NODES = (1, 17, 9, 5, 3)  #: along each parameter of an effect, by the number of parameters
PAIR_NODES = (1, 5, 3, 3, 3)  #: the same of one of two effects

NO_EFFECT: Hypothesis = ()
NO_VALUES: Array = np.zeros((1, 0))


@dataclass(frozen=True)
class Marks:
    """Marks of the flight (``diagnosis.bench.flight_marks``), s, (m, SIZE) each."""

    times: Array  #: when displacement and force pass the marks' values; the time-out for never
    error: Array  #: standard error of each mark by itself
    creep: Array  #: standard error of friction near rest, in common


class _PredictedMarks(NamedTuple):
    """Predicted marks of a profile that has k of them, for m values."""

    acting: Array  #: times with the force of the trace as the acting one, s, (m, k)
    nominal: Array  #: times with the force of the trace as the nominal one, s, (m, k)
    covariance: Array  #: of predicted and observed marks, s^2, (m, k, k)


class _Distances(NamedTuple):
    """Distances of a profile's observed marks from m predictions."""

    squared: Array  #: with acting and nominal force, (2, m)
    log_determinant: Array  #: of the covariance, (m,)
    size: int  #: number of marks


def fly(
    settings: Sequence[Setting], gap: float, force: float, creep_error: float
) -> tuple[Array, Array, Array]:
    """Simulate the marks of n flights; the delay of a setting is no part of them.

    Parameters
    ----------
    gap, force : nominal gap, m, and final force, N, of which the marks are shares
    creep_error : error of the start of a held ring, over the creep of the smooth law

    Returns
    -------
    times, creep : of the marks, s, (n, SIZE) each
    rings : way of the ring at each mark of the displacement, m, (n, ways)
    """
    ways = gap * np.array(WAYS)
    forces = force * np.array(FORCES)
    times = np.zeros((len(settings), SIZE))
    creep = np.zeros((len(settings), SIZE))
    rings = np.zeros((len(settings), ways.size))
    for k, setting in enumerate(settings):
        clutch = setting.clutch
        profile = setting.point.profile
        time, states, stiction_ratio = free_flight(clutch, profile, float(ways[-1]))
        way = states[:, DISPLACEMENT]
        speed = states[:, AXIAL_SPEED]
        if clutch.mechanism.has_linkage and setting.sensor == "actuator":
            way = states[:, ACTUATOR_DISPLACEMENT]
            speed = states[:, ACTUATOR_SPEED]
        marks = [kernel.crossing(time, way, speed, level) for level in ways]
        if clutch.actuator is None:
            knots = profile.knots
            marks += [kernel.crossing(knots[0], knots[1], knots[2], level) for level in forces]
        else:
            course = channel_course(clutch.actuator, profile.force, clutch.timeout)
            marks += [_channel_crossing(course, share, clutch.actuator, force) for share in FORCES]
        times[k] = np.fmin(marks, clutch.timeout)  # NaN for never
        way_times = times[k, : ways.size]
        mark_speed = np.interp(way_times, time, speed)
        rings[k] = np.interp(way_times, time, states[:, DISPLACEMENT])
        creep[k, : ways.size] = (
            creep_error * SMOOTH_SPEED_M_S * stiction_ratio / np.fmax(mark_speed, SMOOTH_SPEED_M_S)
        )
    return times, creep, rings


def _channel_crossing(
    course: tuple[Array, Array, Array], share: float, actuator: Actuator, force: float
) -> float:
    """Compute when a channel passes a share of its value at a static force, s; NaN for never."""
    if not actuator.logged_key:
        return np.nan
    return float(kernel.crossing(*course, share * actuator.logged_level(force)))


class _Grid(NamedTuple):
    """Table over an even grid of shares of priors, with the error of its spline for the marks."""

    sizes: tuple[int, ...]
    rows: Array  #: (nodes, K)
    error: Array  #: (nodes, SIZE)

    @classmethod
    def fit(cls, sizes: tuple[int, ...], rows: Array) -> _Grid:
        """Fill nodes of no bench (NaN) with the nearest, and estimate errors by a coarse spline."""
        filled = fill_missing(rows, sizes)
        return cls(sizes, filled, spline_error(filled[:, MARK_COLUMNS], sizes))

    def interpolate(self, shares: Array) -> tuple[Array, Array]:
        """Interpolate at shares (m, p): columns (m, K) and their error (m, SIZE)."""
        rows = spline_weights(shares, self.sizes, degree=3) @ self.rows
        return rows, spline_weights(shares, self.sizes, degree=1) @ self.error


class Flights:
    """Marks of any hypothesis under the force profiles of some operating points.

    The priors of ``effects`` bound the tables; of ``settings`` the first of each profile counts.
    """

    def __init__(
        self, effects: Mapping[str, Effect], settings: Sequence[Setting], constants: Settings
    ) -> None:
        self.effects = effects
        self.constants = constants
        self.settings = {setting.point.profile: setting for setting in reversed(settings)}
        self._rows: dict[Hashable, Array] = {}
        self._grids: dict[tuple[Hypothesis, ForceProfile], _Grid] = {}

    def marks(
        self, h: Hypothesis, values: Array, profile: ForceProfile, exact: bool = False
    ) -> Marks:
        """Interpolate marks at values (m, p), or fly them where ``exact``.

        Raises KeyError for a profile of no operating point.
        """
        space = self._space(h)
        shares = space.shares(values)
        baseline = self._fly_shares(NO_EFFECT, NO_VALUES, profile)
        variance = np.zeros((len(values), SIZE))
        if exact:
            rows = self._fly_shares(h, shares, profile)
            rows = np.where(np.isnan(rows), baseline, rows)  # NaN for no bench
        else:
            rows, variance = self._interpolate(space, shares, profile)
        min_root = self.settings[profile].clutch.timeout ** -0.5
        times = np.maximum(rows[:, MARK_COLUMNS], min_root) ** -2.0
        baseline_times = np.maximum(baseline[:, MARK_COLUMNS], min_root) ** -2.0
        law_error = self.constants.flight_law * (times - baseline_times)
        variance = (2.0 * times**1.5) ** 2 * variance + law_error**2
        is_touching = rows[:, MARGIN_COLUMNS] < 0.0
        variance[:, : len(WAYS)] += (self.constants.flight_touch * is_touching) ** 2
        return Marks(
            times=times + rows[:, [DELAY_COLUMN]],
            error=np.sqrt(variance),
            creep=np.maximum(rows[:, CREEP_COLUMNS], 0.0),
        )

    def _interpolate(
        self, space: ParameterSpace, shares: Array, profile: ForceProfile
    ) -> tuple[Array, Array]:
        """Interpolate flights at shares (m, p): (m, COLUMNS), and variance of marks (m, SIZE)."""
        h = space.hypothesis
        baseline = self._fly_shares(NO_EFFECT, NO_VALUES, profile)
        rows = np.tile(baseline, (len(shares), 1))
        variance = np.zeros((len(shares), SIZE))
        max_pair_change = np.zeros((len(shares), SIZE))
        moving = []
        for name in h:
            if self._grid((name,), profile).rows[:, :DELAY_COLUMN].any():
                moving.append(name)
        singles = [(name,) for name in h]
        for names in (*singles, *itertools.combinations(moving, 2)):
            effect_shares = np.hstack([shares[:, space.columns(name)] for name in names])
            changes, error = self._grid(names, profile).interpolate(effect_shares)
            rows = rows + changes
            variance = variance + error**2
            if len(names) == 2:
                max_pair_change = np.maximum(max_pair_change, abs(changes[:, MARK_COLUMNS]))
        if len(moving) > 2:
            variance += (self.constants.flight_triple * max_pair_change) ** 2
        return rows, variance

    def _space(self, h: Hypothesis) -> ParameterSpace:
        """Build the parameter space of a hypothesis."""
        setting = next(iter(self.settings.values()))
        return ParameterSpace(tuple(self.effects[name] for name in h), setting)

    def _grid(self, h: Hypothesis, profile: ForceProfile) -> _Grid:
        """Fly one or two effects at their nodes: change by one, or by two beyond their sum."""
        if (h, profile) not in self._grids:
            space = self._space(h)
            node_counts = NODES if len(h) == 1 else PAIR_NODES
            sizes: list[int] = []
            for effect in space.effects:
                parameters = len(effect.parameters)
                sizes += parameters * [node_counts[min(parameters, 4)]]
            nodes = node_shares(sizes)
            baseline = self._fly_shares(NO_EFFECT, NO_VALUES, profile)
            changes = self._fly_shares(h, nodes, profile) - baseline
            if len(h) == 2:
                for name in h:
                    grid = self._grid((name,), profile)
                    single_changes, _ = grid.interpolate(nodes[:, space.columns(name)])
                    changes = changes - single_changes
            self._grids[h, profile] = _Grid.fit(tuple(sizes), changes)
        return self._grids[h, profile]

    def _fly_shares(self, h: Hypothesis, shares: Array, profile: ForceProfile) -> Array:
        """Fly shares (m, p) of priors, equal flights once, (m, COLUMNS); NaN for no bench."""
        baseline = self.settings[profile]
        parameters = self._space(h).parameters
        keys: dict[int, Hashable] = {}
        settings: dict[Hashable, Setting] = {}
        rows = np.full((len(shares), COLUMNS), np.nan)
        for k, row in enumerate(shares.tolist()):
            values = tuple(p.at(share) for p, share in zip(parameters, row, strict=True))
            with suppress(DogshapeError):
                setting = Level(h, values).setting(self.effects, baseline)
                clutch = setting.clutch
                force = setting.point.profile
                axial = tuple(clutch.numbers[name] for name in AXIAL_NUMBERS)
                keys[k] = (profile, force, axial, clutch.actuator, setting.sensor, clutch.timeout)
                settings[keys[k]] = setting
                rows[k, MARGIN_COLUMNS] = clutch.dog.axial_gap
                rows[k, DELAY_COLUMN] = setting.delay + force.delay
        new_settings = {key: s for key, s in settings.items() if key not in self._rows}
        if new_settings:
            flights = fly(
                list(new_settings.values()),
                gap=baseline.clutch.dog.axial_gap,
                force=profile.force,
                creep_error=self.constants.flight_creep,
            )
            self._rows.update(zip(new_settings, np.hstack(flights), strict=True))
        for k, key in keys.items():
            times, creep, rings = np.split(self._rows[key], (SIZE, 2 * SIZE))
            rows[k, MARK_COLUMNS] = np.maximum(times, FIRST_STEP) ** -0.5
            rows[k, CREEP_COLUMNS] = creep
            rows[k, MARGIN_COLUMNS] -= rings
        return rows


def log_student(squared: Array, log_determinant: Array, size: int, freedom: float) -> Array:
    """Compute Student's log density of ``size`` marks, in the shape of ``squared``.

    ``squared`` are their squared distances, ``log_determinant`` that of their covariance,
    ``freedom`` the degrees of freedom.
    """
    constant = gammaln((freedom + size) / 2.0) - gammaln(freedom / 2.0)
    constant = constant - 0.5 * size * np.log(freedom * np.pi)
    tail = 0.5 * (freedom + size) * np.log1p(squared / freedom)
    return np.asarray(constant - 0.5 * log_determinant - tail)


def log_flights(
    observed: Sequence[SeenFlight],
    flights: Flights,
    h: Hypothesis,
    values: Array,
    log_contacts: Array | float = 0.0,
) -> Array:
    """Compute the log density of all profiles' marks at values (m, p) of a hypothesis, (m,).

    ``log_contacts`` is that of the same traces' contacts with acting and nominal force, (2, m).
    """
    freedom = flights.constants.flight_freedom
    log = np.zeros((2, len(values)))  # with acting and nominal force
    for squared, log_determinant, size in _distances(observed, flights, h, values):
        log += log_student(squared, log_determinant, size, freedom)
    return np.asarray(np.logaddexp(*(log + log_contacts)) - np.log(2.0))


def flight_scores(
    observed: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Array:
    """Score the marks as normal deviates, (m, profiles), in the likelier reading of the force."""
    freedom = flights.constants.flight_freedom
    tails = np.zeros((2, len(values), len(observed)))
    for k, distances in enumerate(_distances(observed, flights, h, values)):
        size = distances.size
        tails[:, :, k] = f_distribution.sf(distances.squared / size, size, freedom)
    acting, nominal = norm.isf(0.5 * np.maximum(tails, 1e-300))
    is_acting = (acting**2).sum(axis=1) <= (nominal**2).sum(axis=1)
    return np.where(is_acting[:, None], acting, nominal)


def log_unknown(observed: Sequence[SeenFlight], flights: Flights) -> float:
    """Compute the log density of all marks if no known effect moved them."""
    if not observed:
        return 0.0
    log_baseline = float(log_flights(observed, flights, NO_EFFECT, NO_VALUES)[0])
    predictions = [_predict_marks(flight, flights, NO_EFFECT, NO_VALUES) for flight in observed]
    pairs = zip(observed, predictions, strict=True)
    residual = np.concatenate([flight.times - p.acting[0] for flight, p in pairs])
    error = block_diag(*(p.covariance[0] for p in predictions))
    places = np.concatenate([flight.places for flight in observed])
    force = np.concatenate([np.full(f.places.size, f.profile.force) for f in observed])
    x = np.log([force, np.array([*WAYS, *FORCES])[places]])
    square = ((x[:, :, None] - x[:, None]) ** 2).sum(axis=0)
    is_way = places < len(WAYS)
    constants = flights.constants
    correlation = constants.offset_smooth * np.exp(-0.5 * square / constants.offset_length**2)
    correlation = correlation + (1.0 - constants.offset_smooth) * np.eye(is_way.size)
    correlation = correlation * (is_way[:, None] == is_way)
    logs = []
    for sd in constants.offset_sizes:
        for is_offset in (np.ones_like(is_way), is_way):  # all marks, or those of displacement
            offsets = sd**2 * correlation * np.outer(is_offset, is_offset)
            logs.append(multivariate_normal.logpdf(residual, cov=error + offsets))
    log_offset = np.logaddexp.reduce(logs) - np.log(len(logs))
    return float(np.logaddexp(log_baseline, log_offset) - np.log(2.0))


def _predict_marks(
    flight: SeenFlight, flights: Flights, h: Hypothesis, values: Array
) -> _PredictedMarks:
    """Predict the marks that a profile has at values (m, p) of a hypothesis."""
    places = flight.places
    marks = flights.marks(h, values, flight.profile)
    baseline = flights.marks(NO_EFFECT, NO_VALUES, flight.profile)
    times = marks.times[:, places]
    creep = marks.creep[:, places]
    single = np.eye(places.size) * (marks.error[:, places] ** 2)[:, None, :]
    return _PredictedMarks(
        acting=times,
        nominal=np.where(places < len(WAYS), times, baseline.times[:, places]),
        covariance=flight.covariance + single + creep[:, :, None] * creep[:, None, :],
    )


def _distances(
    observed: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Iterator[_Distances]:
    """Yield the distances of each profile's marks from those at values (m, p)."""
    for flight in observed:
        p = _predict_marks(flight, flights, h, values)
        root = np.linalg.cholesky(p.covariance)
        residuals = np.stack([flight.times - p.acting, flight.times - p.nominal], axis=2)
        scaled = np.linalg.solve(root, residuals)
        log_determinant = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        yield _Distances((scaled**2).sum(axis=1).T, log_determinant, flight.times.size)
