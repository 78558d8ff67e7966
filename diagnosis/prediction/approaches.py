r"""Time until the axial gap is closed under several effects at once.

The compiled engine integrates the approach with each two effects; with :math:`y = T^{-1/2}`, which
nears 0 without a jump where the ring no longer arrives, several effects give

.. math:: y = y_0 + \sum_i a_i + \sum_{i<j} b_{ij}(v_i, v_j), \qquad
          b_{ij} = y_{ij} - y_i - y_j + y_0.

The sum :math:`y_0 + a_i` is that of effect *i* alone. The terms :math:`b_{ij}` are interpolated by
splines over the shares of the parameters' ranges.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.simulations import Level
from dogshape.diagnosis.prediction.spline_table import (
    fill_missing,
    node_shares,
    spline_error,
    spline_weights,
)
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.planar import FIRST_STEP, touch_time

NODES = (1, 5, 3, 3)  #: along each parameter of an effect, by the number of its parameters
HELD_TOLERANCE = 0.01  #: of y, within which effects leave it as it is


class Approaches:
    """Approaches with two effects at C operating points, flown where first asked for."""

    def __init__(self, effects: Mapping[str, Effect], settings: Sequence[Setting]) -> None:
        self.effects = effects
        baselines = {setting.point.profile: setting for setting in settings}
        profiles = [*baselines]
        self._baselines = list(baselines.values())  #: one of each force profile
        self._profile_of_cell = np.array([profiles.index(s.point.profile) for s in settings])
        self._min_root = np.array([s.clutch.timeout**-0.5 for s in self._baselines])
        self._baseline_root = self._fly((), (), np.zeros(len(self._baselines), dtype=bool))
        self._tables: dict[Hypothesis, Array] = {}
        self._errors: dict[Hypothesis, Array] = {}

    def pair_change(
        self, space: ParameterSpace, names: Sequence[str], values: Array
    ) -> tuple[Array, Array]:
        """Sum the terms of all pairs of effects at values (m, p), over :math:`y_0`.

        ``names`` are those of effects of the ``space``. Returns the sum and its error by
        interpolation, (m, C) each.
        """
        shares = np.clip(space.shares(values), 0.0, 1.0)
        change = np.zeros((len(values), len(self._baselines)))
        variance = np.zeros_like(change)
        for pair in itertools.combinations(names, 2):
            if self._acts(pair):
                pair_shares = np.hstack([shares[:, space.columns(name)] for name in pair])
                sizes = self._sizes(pair)
                table = self._table(pair)
                change += spline_weights(pair_shares, sizes, degree=3) @ table
                error = spline_weights(pair_shares, sizes, degree=1) @ self._error(pair)
                variance += error**2
        relative = [(values / self._baseline_root) for values in (change, np.sqrt(variance))]
        change, error = (values[:, self._profile_of_cell] for values in relative)
        return change, error

    def _space(self, h: Hypothesis) -> ParameterSpace:
        """Build the parameter space of a hypothesis."""
        return ParameterSpace(tuple(self.effects[name] for name in h), self._baselines[0])

    def _sizes(self, h: Hypothesis) -> tuple[int, ...]:
        """List the numbers of nodes along the parameters of a hypothesis."""
        sizes: list[int] = []
        for name in h:
            count = len(self.effects[name].parameters)
            sizes += count * [NODES[min(count, len(NODES) - 1)]]
        return tuple(sizes)

    def _acts(self, h: Hypothesis) -> bool:
        """Check that each effect by itself changes the approach."""
        return all(self._table((name,)).any() for name in h)

    def _table(self, h: Hypothesis) -> Array:
        """Look up the change of y at the nodes of one or two effects, (nodes, profiles)."""
        if h not in self._tables:
            self._tables[h] = self._tabulate(h)
        return self._tables[h]

    def _error(self, h: Hypothesis) -> Array:
        """Look up the error of the spline of two effects at its nodes, (nodes, profiles)."""
        if h not in self._errors:
            self._errors[h] = spline_error(self._table(h), self._sizes(h))
        return self._errors[h]

    def _tabulate(self, h: Hypothesis) -> Array:
        """Tabulate the change of y by a hypothesis at its nodes, beyond the sum of singles."""
        space = self._space(h)
        shares = node_shares(self._sizes(h))
        single_changes = []
        for name in h if len(h) > 1 else ():
            weights = spline_weights(shares[:, space.columns(name)], self._sizes((name,)), degree=3)
            single_changes.append(weights @ self._table((name,)))
        changes = np.full((len(shares), len(self._baselines)), np.nan)
        for row, values in enumerate(space.values(shares).tolist()):
            is_held = self._is_held([change[row] for change in single_changes])
            with suppress(DogshapeError):  # there is no such bench
                changes[row] = self._fly(h, tuple(values), is_held) - self._baseline_root
        changes = fill_missing(changes, self._sizes(h))
        return changes - sum(single_changes) if single_changes else changes

    def _is_held(self, single_changes: Sequence[Array]) -> np.ndarray:
        """Mark profiles of which an effect alone holds the ring, and no other one speeds it up."""
        if not single_changes:
            return np.zeros(len(self._baselines), dtype=bool)
        roots = self._baseline_root + np.array(single_changes)
        holds = roots.min(axis=0) < (1.0 + HELD_TOLERANCE) * self._min_root
        return np.asarray(
            holds & (roots.max(axis=0) <= (1.0 + HELD_TOLERANCE) * self._baseline_root)
        )

    def _fly(self, h: Hypothesis, values: tuple[float, ...], is_held: np.ndarray) -> Array:
        """Compute the roots of 1 / time until the gap is closed, of each profile, s^(-1/2).

        Where ``is_held`` that time is the time-out.
        """
        roots = self._min_root.copy()
        for k in np.flatnonzero(~is_held):
            setting = Level(h, values).setting(self.effects, self._baselines[k])
            time = touch_time(setting.clutch, setting.point.profile)
            roots[k] = max(time, FIRST_STEP) ** -0.5
        return roots
