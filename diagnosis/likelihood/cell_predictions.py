"""Predictions of all cells of a data set, with the error that any simulation has."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Self

import numpy as np

from dogshape.diagnosis.likelihood.modes import Modes, modes_of
from dogshape.diagnosis.likelihood.observations import LEAST
from dogshape.diagnosis.prediction.outliers import added
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array


@dataclass(frozen=True)
class CellPredictions(Prediction):
    """Prediction of all cells, (cells, m), with the error that any simulation has.

    Parameters
    ----------
    mean, sd : of shifts that are no outliers, s.
    model : part of ``error`` that any simulation of the operating points has, s.
    shape : error of the logarithm of ``sd``.
    kurtosis : of ``times``.
    simulated : mean without what has no error, s.
    missed, jump : share of cells that are odd, and by how much their mean is off, s.
    rules : errors that are assumed of any simulation.
    """

    mean: Array
    sd: Array
    model: Array
    shape: Array
    kurtosis: Array
    simulated: Array
    missed: Array
    jump: Array
    rules: Rules

    @classmethod
    def of(cls, cells: list[Prediction], rules: Rules, setting: Array | float = 0.0) -> Self:
        """Gather predictions, one a cell; the model's own error joins the emulator's.

        ``setting`` is the error of each mean by those of its nominal values, s, (cells,).
        """
        every = {f.name: np.stack([getattr(c, f.name) for c in cells]) for f in fields(Prediction)}
        times = every["times"]
        mean = times.mean(axis=2)
        square = (times - mean[..., None]) ** 2
        moment = square.mean(axis=2)
        count = times.shape[2]
        sd = np.maximum(LEAST, np.sqrt(moment * (count / (count - 1.0))))
        simulated = mean - every["delay"]
        model = np.hypot(rules.model_error * simulated, rules.least_error)
        if np.any(setting):
            model = np.hypot(model, np.reshape(setting, (-1, 1)))
        every["error"] = np.maximum(np.hypot(every["error"], model), 1e-5)
        # Where no simulated shift is late, one of so many may still be (Laplace's rule).
        least = np.isnan(every["behind"]) / (count + 2.0)
        share = np.maximum(every["outlier_share"], least)
        every["outlier_share"] = np.clip(share, rules.late_least, 1.0 - rules.late_least)
        shape = np.hypot(rules.spread_share, rules.spread_error * simulated / sd)
        # A square of squares: numpy takes a fourth power by logarithms, 20 times as slow.
        kurtosis = (square**2).mean(axis=2) / np.maximum(moment, 1e-12) ** 2
        odd = np.full_like(mean, rules.odd_share), rules.odd_size * simulated
        return cls(
            **every, mean=mean, sd=sd, model=model, shape=shape, kurtosis=kurtosis,
            simulated=simulated, missed=odd[0], jump=odd[1], rules=rules,
        )  # fmt: skip

    def moved(self, offsets: Array) -> CellPredictions:
        """Move the prediction of one value (cells, 1) by offsets, s, (cells, m)."""
        one = np.ones_like(offsets[:1])
        every = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "rules"}
        wide = {n: part * (one if part.ndim == 2 else one[..., None]) for n, part in every.items()}
        times = {"times": self.times + offsets[..., None], "mean": self.mean + offsets}
        return type(self)(**{**wide, **times}, rules=self.rules)

    def at_value(self, place: int) -> CellPredictions:
        """Select one of the values, (cells, 1)."""
        every = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "rules"}
        return type(self)(**{n: part[:, [place]] for n, part in every.items()}, rules=self.rules)

    @cached_property
    def modes(self) -> Modes:
        """Both modes of the times, (cells, m)."""
        return modes_of(self.times, LEAST)

    @property
    def whole(self) -> tuple[Array, Array]:
        """Mean and standard deviation with outliers, s."""
        mean, variance = added(self.outlier_share, self.behind, self.behind_sd)
        return self.mean + mean, np.sqrt(self.sd**2 + variance)
