r"""Emulator: from a bank's levels to the distribution of times at any values of a hypothesis.

One effect alone: the mean :math:`M(x)` is that of the baseline with the change along the curve of
``diagnosis.prediction.level_curves``, :math:`\ln M = \sum_l w_l \ln M_l`. An effect of no strength
is then the baseline itself. The shape, times over their mean at equal shares, has the same weights.
Both leave outliers (``diagnosis.prediction.outliers``) out. The share of outliers has the weights
of the share engaged, and their delay is that of all levels of the operating point.

Effects together: with :math:`T_e` the times at a share of an effect's own spread and :math:`T_0`
those of the baseline, :math:`T = T_0 \prod_e T_e/T_0`, and the odds of engaging likewise. Simulated
pairs correct these times (``diagnosis.prediction.combination``). Delays add to all times, exactly.
Angles that are not uniform are weights on the baseline's angles.

The error of a mean has three parts: the curve's own (angles and interpolation), numerics, and the
combination.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.prediction.angle_means import (
    binned,
    even_variance,
)
from dogshape.diagnosis.prediction.angle_profiles import (
    AngleProfiles,
    Preferred,
    weighted,
)
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.combination import Emulated
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.diagnosis.prediction.flight_table import FlightTables
from dogshape.diagnosis.prediction.level_fit import NONE, SHARES, Alone, fit_effect
from dogshape.diagnosis.prediction.levels import Level, columns_of
from dogshape.diagnosis.prediction.outliers import (
    PRIOR,
    bulk,
    outlier_statistics,
)
from dogshape.diagnosis.prediction.prediction import Marks, Prediction
from dogshape.diagnosis.prediction.recent import Recent
from dogshape.diagnosis.prediction.together import Combination, Combined
from dogshape.diagnosis.prediction.touch_phases import TouchPhases
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.setting import Setting, angle_weights
from dogshape.sim.shift.actuation import ForceProfile

Array = NDArray[np.float64]

PROBES = 4  #: values at which it is seen whether operating points read alike


class BankEmulator:
    """Emulator over a bank: predicts each operating point at any values of a hypothesis."""

    def __init__(self, bank: Bank, flights: FlightStore | None = None) -> None:
        self.bank = bank
        self.effects = {effect.name: effect for effect in bank.effects}
        simulated = {level.hypothesis[0] for level in bank.levels}
        self._soon = bulk(bank.baseline)
        levels = [(bank.times, bulk(bank.times))] if bank.levels else []
        self.outliers = outlier_statistics([(bank.baseline, self._soon), *levels])
        self.fits = {
            name: fit_effect(bank, self.effects[name], self._soon, self.outliers)
            for name in sorted(simulated)
        }
        self._asked: tuple[object, Prediction] | None = None
        self._alone = Recent[Alone]()
        self._read_before = Recent[tuple[Array, Array, Array]]()
        self._phases = TouchPhases(self.effects, bank.settings)
        self.flights = FlightTables(self.effects, bank.settings, flights)

    def with_levels(self, levels: Sequence[Level], times: Array) -> BankEmulator:
        """Return an emulator that has joint levels too; ``times`` are (L, C, n), s.

        Curves of each effect alone, and the statistics of outliers, stay.
        """
        bank = self.bank
        if bank.levels:
            times = np.concatenate([bank.times, times])
        changed = copy(self)
        changed.bank = replace(bank, levels=(*bank.levels, *levels), times=times)
        changed._asked = None
        for name in ("combination", "profiles"):
            vars(changed).pop(name, None)
        return changed

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict an operating point at ``values`` (m, p) of a hypothesis.

        Raises InputError for an effect that the bank does not have.
        """
        # Operating points are asked in turn, and all at once are much quicker than each alone.
        key = hypothesis, values.shape, values.tobytes()
        if self._asked is None or self._asked[0] != key:
            self._asked = key, self._everywhere(hypothesis, values)
        every = self._asked[1]
        return Prediction(**{f.name: getattr(every, f.name)[cell] for f in fields(every)})

    def _everywhere(self, hypothesis: Hypothesis, values: Array) -> Prediction:
        """Predict all operating points, (C, m) and (C, m, q)."""
        parts = self._parts(hypothesis, values)
        alone = {
            name: self._alone.get(name, mine, lambda n=name, v=mine: self.fits[n].at(v))  # type: ignore[misc]
            for name, mine in parts.items()
            if name in self.fits
        }
        read = {name: mine for name, mine in parts.items() if name not in self.fits}
        delay, preferred = self._read(read, len(values))
        if not alone and not preferred.uniform:
            return self._spread(self._weighted_baseline(preferred), delay, np.zeros((1, 1)))
        combined = self._combined(alone)
        whole = combined.emulated
        if not preferred.uniform:
            acting = {name: mine for name, mine in parts.items() if name in self.fits}
            whole = self._preferring(combined, alone, acting, preferred)
        return self._spread(whole, delay, combined.common)

    def _combined(self, alone: Mapping[str, Alone]) -> Combined:
        """Combine effects."""
        if len(alone) == 1:
            (only,) = alone.values()
            return Combined(only.emulated, np.zeros((1, 1)), {})
        if not alone:
            return Combined(self._baseline, np.zeros((1, 1)), {})
        return self.combination.at(alone)

    @cached_property
    def combination(self) -> Combination:
        """Combination of effects, with the bank's joint levels."""
        return Combination(self.bank, self._baseline, self.fits)

    def _preferring(
        self,
        combined: Combined,
        alone: Mapping[str, Alone],
        acting: Mapping[str, Array],
        preferred: Preferred,
    ) -> Emulated:
        """Weight the angles of effects that act on the shifts (``acting``: values by name)."""
        mixed = self.combination.profiles(alone, combined.weights, self.profiles)
        count = len(next(iter(acting.values())))
        turned = self.profiles.phases.at(acting, count)
        weights = preferred.weights(self.profiles.places, turned)
        return weighted(combined.emulated, mixed, weights, self.bank.common.shape[1])

    @cached_property
    def profiles(self) -> AngleProfiles:
        """Times over the angle at the first touch."""
        return AngleProfiles(self.bank, self._phases)

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Predict the marks of the flight at ``values`` (m, p) of a hypothesis."""
        self._parts(hypothesis, values)
        return self.flights.at(hypothesis, values, profile)

    def _parts(self, hypothesis: Hypothesis, values: Array) -> dict[str, Array]:
        """Return the values of each effect, (m, p) each."""
        for name in hypothesis:
            if name not in self.effects:
                raise InputError(
                    f"the bank does not have the effect '{name}'; "
                    f"{did_you_mean(name, self.effects)}"
                )
        return {n: values[:, mine] for n, mine in columns_of(hypothesis, self.effects).items()}

    @cached_property
    def _baseline(self) -> Emulated:
        return _stacked([self._weighted(cell, None) for cell in range(len(self.bank.settings))])

    def _weighted(self, cell: int, weights: Array | None) -> Emulated:
        """Return the baseline with weights (m, n) on its angles."""
        times = self.bank.baseline[cell]
        given = np.ones((1, times.size)) if weights is None else weights
        ended, known = np.isfinite(times), ~np.isnan(times)
        total = np.maximum((given * known).sum(axis=1), 1e-12)
        share = (given * ended).sum(axis=1) / total
        fast = self._soon[cell]
        found = binned(fast, SHARES, given) if ended.any() else None
        if found is None:
            never = np.full((len(given), SHARES), self.bank.settings[cell].clutch.timeout)
            quarter, rare = (
                np.full(len(given), 0.25),
                np.full(len(given), self.outliers.share[cell]),
            )
            return Emulated(never, share, np.full(len(given), NONE**2), quarter, rare)
        mean, soon = found.mean(axis=1), np.isfinite(fast)
        part = np.maximum((given * soon).sum(axis=1) / total, 1e-12)
        apart = np.where(soon, fast, 0.0) - soon * mean[:, None]
        series = given * apart / (mean * part)[:, None]
        count = total**2 / (given**2 * known).sum(axis=1)
        likely = (share * count + 0.5) / (count + 1.0)
        doubt = likely * (1.0 - likely) / (count + 2.0)
        rare = (share - part) * count + PRIOR * self.outliers.share[cell]
        return Emulated(found, share, even_variance(series), doubt, rare / (share * count + PRIOR))

    def _read(self, parts: dict[str, Array], count: int) -> tuple[Array, Preferred]:
        """Add up delays, (C or 1, m), and say which angles come more often than others."""
        wide = len(self.bank.settings), count
        if not parts:
            return np.zeros((1, count)), Preferred(np.zeros(wide), np.zeros(wide))
        rows = np.concatenate(list(parts.values()), axis=1)
        names = tuple(parts)
        delay, concentration, centre = self._read_before.get(
            names, rows, lambda: self._readings(names, rows)
        )
        sharp, middle = np.broadcast_to(concentration, wide), np.broadcast_to(centre, wide)
        return delay, Preferred(sharp, middle)

    def _weighted_baseline(self, preferred: Preferred) -> Emulated:
        """Weight the baseline's angles."""
        every = enumerate(zip(self.bank.settings, self.bank.angles, strict=True))
        turns = [(cell, angles / one.clutch.dog.pitch_angle) for cell, (one, angles) in every]
        sharp, middle = preferred.concentration, preferred.centre
        weights = [angle_weights(t, sharp[c][:, None], middle[c][:, None]) for c, t in turns]
        return _stacked([self._weighted(cell, one) for cell, one in enumerate(weights)])

    def _readings(self, names: tuple[str, ...], rows: Array) -> tuple[Array, Array, Array]:
        """Return delay, concentration and centre of benches that only read otherwise, (C, m) each.

        Where all operating points read alike the first axis is 1.
        """

        def at(setting: Setting, rows: Array) -> Array:
            read = [Level(names, tuple(r)).setting(self.effects, setting) for r in rows.tolist()]
            return np.array([(s.delay - setting.delay, s.concentration, s.centre) for s in read]).T

        # An effect may ask for the operating point; most do not, and those are read once.
        few = rows[:: max(1, len(rows) // PROBES)][:PROBES]
        first, *others = self.bank.settings
        known = at(first, few)
        alike = all(np.allclose(at(one, few), known, atol=1e-12) for one in others)
        settings = (first,) if alike else (first, *others)
        delay, concentration, centre = np.stack([at(one, rows) for one in settings], axis=1)
        return delay, concentration, centre

    def _spread(self, whole: Emulated, delay: Array, common: Array) -> Prediction:
        """Make the prediction from what acts on the shifts, and delays of the reading."""
        mean = whole.times.mean(axis=-1)
        ratio = mean / self._baseline.times.mean(axis=-1)
        variance = whole.variance * mean**2 + self._other[:, None] * ratio**2
        n = self.bank.baseline.shape[1]
        times = whole.times + delay[..., None]
        parts = {
            "engaged": (whole.engaged * n + 0.5) / (n + 1.0),
            "error": np.sqrt(variance),
            "engaged_error": np.sqrt(whole.engaged_variance),
            "common": common * mean,
            "outlier_share": whole.outlier_share,
            "behind": self.outliers.mean[:, None],
            "behind_sd": self.outliers.sd[:, None],
            "delay": delay,
        }
        # Constants are repeated for each value.
        shape = np.broadcast_shapes(mean.shape, delay.shape)
        wide = np.broadcast_to(times, (*shape, times.shape[-1]))
        return Prediction(wide, **{name: np.broadcast_to(p, shape) for name, p in parts.items()})

    @cached_property
    def _other(self) -> Array:
        """Variance from numerics, by operating point, s2, (C,)."""
        return np.array([self._other_of(cell) for cell in range(len(self.bank.settings))])

    def _other_of(self, cell: int) -> float:
        times = self._soon[cell]
        ended = times[np.isfinite(times)]
        mean, scatter = self.bank.numerics
        spread = float(ended.std(ddof=1)) if ended.size > 1 else 0.0
        return spread**2 * (mean**2 + scatter**2 / max(1, ended.size))


def _stacked(emulated_alone: list[Emulated]) -> Emulated:
    """Gather what is emulated at each operating point."""
    return Emulated(
        *(np.stack([getattr(one, f.name) for one in emulated_alone]) for f in fields(Emulated))
    )
