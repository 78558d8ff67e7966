"""Tables of flights over the values of effects, and splines between their nodes.

Effects that move the flight are simulated at even shares of their priors, pairs at the grid of
both: no rule of combination is needed. The logarithms of the marks are splines through the nodes,
cubic in each parameter. The error of a spline is half of what a spline through every other node
misses, the largest nearby. The law of an effect (the shape of a detent, one lag for a pneumatic
cylinder) is taken to err by ``LAW`` of its change. A delay adds to all marks, exactly.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import distance_transform_edt, maximum_filter

from dogshape.diagnosis.bench.flight_marks import SIZE, WAYS
from dogshape.diagnosis.prediction.flight import FIRST, Flight, changes_flight, fly
from dogshape.diagnosis.prediction.flight_store import FlightStore, key_of
from dogshape.diagnosis.prediction.levels import Level, columns_of
from dogshape.diagnosis.prediction.prediction import Marks
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile

NODES = {1: (17,), 2: (7, 5), 3: (5, 3, 5)}  #: along each parameter, by their number
MANY = 3  #: nodes along each of more than three parameters
ALONE = (9, 17)  #: of one effect with two parameters
HALF = 0.5  #: error of a spline over what it misses with every other node only
TOUCHED = 0.02  #: s, error of a mark behind the first touch
LAW = 0.02  #: error of an effect's law, over what it changes
TRIED = (0.0, 0.3, 0.9, 1.0)  #: shares of priors at which an effect may move the flight


@dataclass(frozen=True)
class Table:
    """Flights at the grid of nodes: logarithms of marks, their errors, creep and margins.

    Each (n1, n2, ..., SIZE); ``nodes`` are the shares of the priors along each parameter.
    """

    parameters: tuple[Parameter, ...]
    nodes: tuple[Array, ...]
    logs: Array
    errors: Array
    creep: Array
    margin: Array

    def at(self, values: Array) -> Marks:
        """Return the marks at values (m, p)."""
        if not self.parameters:
            one = (np.tile(part, (len(values), 1)) for part in (self.logs, self.errors, self.creep))
            logs, errors, creep = one
            return Marks(np.exp(logs), np.exp(logs) * errors, creep)
        shares = np.stack(
            [shares_below(p, values[:, k]) for k, p in enumerate(self.parameters)], axis=1
        )
        smooth = [spline_weights(nodes, shares[:, k], 3) for k, nodes in enumerate(self.nodes)]
        straight = [spline_weights(nodes, shares[:, k], 1) for k, nodes in enumerate(self.nodes)]
        times = np.exp(summed(smooth, self.logs))
        error = times * summed(straight, self.errors)
        touched = summed(straight, self.margin)[:, : len(WAYS)] < 0.0
        error[:, : len(WAYS)] += TOUCHED * touched
        return Marks(times, error, summed(straight, self.creep))


def shares_below(parameter: Parameter, values: Array) -> Array:
    """Return the shares of a prior below values (m,)."""
    low, high = parameter.low, parameter.high
    inside = np.clip(values, low, high)
    if parameter.scale == "uniform":
        return (inside - low) / (high - low)
    return np.log(inside / low) / np.log(high / low)


def spline_weights(nodes: Array, places: Array, degree: int) -> Array:
    """Compute the weights of the nodes in a spline at places (m,), (m, n)."""
    spline = make_interp_spline(nodes, np.eye(nodes.size), k=min(degree, nodes.size - 1))
    return spline(places)


def summed(weights: Sequence[Array], table: Array) -> Array:
    """Return a table (n1, n2, ..., SIZE) at the places of weights (m, n) each, (m, SIZE)."""
    found = np.tensordot(weights[0], table, axes=1)
    for more in weights[1:]:
        found = np.einsum("mn,mn...->m...", more, found)
    return found


def table_of(effects: Sequence[Effect], setting: Setting) -> Table:
    """Let the ring fly with some effects at all nodes of their parameters."""
    parameters = tuple(p for effect in effects for p in effect.parameters)
    sizes = _sizes(effects)
    nodes = tuple(np.linspace(0.0, 1.0, size) for size in sizes)
    named = {effect.name: effect for effect in effects}
    rows = []
    for shares in itertools.product(*nodes):
        values = tuple(p.at(float(s)) for p, s in zip(parameters, shares, strict=True))
        rows.append(_row(named, values, setting))
    whole = filled(np.array(rows).reshape(*sizes, 3, SIZE))
    logs, creep, margin = np.moveaxis(whole, -2, 0)
    return Table(parameters, nodes, logs, _missed(nodes, logs), creep, margin)


def _row(named: Mapping[str, Effect], values: tuple[float, ...], setting: Setting) -> Array:
    """Return logarithms, creep and margins of a flight, (3, SIZE); NaN where no such bench is."""
    try:
        changed = Level(tuple(named), values).setting(named, setting)
    except DogshapeError:
        return np.full((3, SIZE), np.nan)
    flight = fly(changed, setting.clutch.dog.axial_gap, setting.point.profile.force)
    # Without an axial gap the ring passes its shares at once, sooner than a step can tell.
    return np.array([np.log(np.maximum(flight.times, FIRST)), flight.creep, flight.margin])


def filled(whole: Array) -> Array:
    """Return a grid (n1, n2, ..., 3, SIZE) with nodes of no bench as the nearest that is one."""
    missing = np.isnan(whole[..., 0, 0])
    if not missing.any():
        return whole
    places = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return whole[tuple(places)]


def _sizes(effects: Sequence[Effect]) -> tuple[int, ...]:
    count = sum(len(effect.parameters) for effect in effects)
    if len(effects) == 1 and count == 2:
        return ALONE
    return NODES.get(count, (MANY,) * count)


def _missed(nodes: Sequence[Array], logs: Array) -> Array:
    """Return the error of the spline, the largest of the nodes nearby, as ``logs``."""
    every = [np.arange(0, n.size, 2) for n in nodes]
    found = logs[np.ix_(*every, np.arange(SIZE))]
    for axis, (n, few) in enumerate(zip(nodes, every, strict=True)):
        part = spline_weights(n[few], n, 3)
        found = np.moveaxis(np.tensordot(part, found, axes=(1, axis)), 0, axis)
    near = (3,) * len(nodes)
    return HALF * maximum_filter(abs(found - logs), size=(*near, 1), mode="nearest")


class FlightTables:
    """Tables of flights that predict their marks; a flight is simulated at the first use."""

    def __init__(
        self,
        effects: Mapping[str, Effect],
        settings: Sequence[Setting],
        store: FlightStore | None = None,
    ) -> None:
        self.effects = effects
        self.store = store or FlightStore()
        self.settings = {setting.point.profile: setting for setting in reversed(settings)}
        self._tables: dict[tuple[Hypothesis, ForceProfile], Table] = {}
        self._flights: dict[ForceProfile, Flight] = {}

    def at(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Return the marks at values (m, p); KeyError for a profile of no operating point."""
        setting = self.settings[profile]
        moving = tuple(
            name
            for name in hypothesis
            if any(changes_flight(setting, one) for one in self._tried(name, setting))
        )
        marks = still = self._still(setting, len(values))
        if moving:
            marks = self._table(moving, profile).at(values[:, self._columns(hypothesis, moving)])
            marks = replace(marks, error=marks.error + LAW * abs(marks.times - still.times))
        delay = self._delays(hypothesis, values, setting)
        return replace(marks, times=marks.times + delay[:, None])

    def _still(self, setting: Setting, count: int) -> Marks:
        profile = setting.point.profile
        if profile not in self._flights:
            self._flights[profile] = fly(setting, setting.clutch.dog.axial_gap, profile.force)
        flight = self._flights[profile]
        times, creep = (np.tile(one, (count, 1)) for one in (flight.times, flight.creep))
        return Marks(times, np.zeros_like(times), creep)

    def _table(self, moving: Hypothesis, profile: ForceProfile) -> Table:
        key = (moving, profile)
        if key not in self._tables:
            self._tables[key] = self._stored(moving, self.settings[profile])
        return self._tables[key]

    def _stored(self, moving: Hypothesis, setting: Setting) -> Table:
        """Return the table of some effects from the store, or else let them fly."""
        effects = [self.effects[name] for name in moving]
        tried = [setting, *(one for name in moving for one in self._tried(name, setting))]
        key = key_of(moving, tried, _sizes(effects))
        kept = self.store.get(key)
        if kept is None:
            table = table_of(effects, setting)
            kept = self.store.add(
                key, np.array([table.logs, table.errors, table.creep, table.margin])
            )
        parameters = tuple(p for effect in effects for p in effect.parameters)
        nodes = tuple(np.linspace(0.0, 1.0, size) for size in _sizes(effects))
        return Table(parameters, nodes, *kept)

    def _columns(self, hypothesis: Hypothesis, moving: Hypothesis) -> list[int]:
        every = columns_of(hypothesis, self.effects)
        return [k for name in moving for k in range(every[name].start, every[name].stop)]

    def _delays(self, hypothesis: Hypothesis, values: Array, setting: Setting) -> Array:
        """Add up the delays of the force by effects, s, (m,)."""
        whole = np.zeros(len(values))
        for name in hypothesis:
            if any(one.delay != setting.delay for one in self._tried(name, setting)):
                mine = values[:, self._columns(hypothesis, (name,))]
                levels = [Level((name,), tuple(row.tolist())) for row in mine]
                changed = [level.setting(self.effects, setting).delay for level in levels]
                whole += np.array(changed) - setting.delay
        return whole

    def _tried(self, name: str, setting: Setting) -> list[Setting]:
        """Return settings with an effect at some of its values."""
        effect = self.effects[name]
        rows = [{p.name: p.at(share) for p in effect.parameters} for share in TRIED]
        return [effect.apply(setting, row) for row in rows if effect.possible(setting, row)]
