r"""Two plain ways to name the cause, which the diagnosis has to beat.

Each single effect is fitted to the means by trying values over its prior. *Smallest RMSE* names the
one with the smallest root-mean-square distance. *AICc weights* go by

.. math:: AICc = \chi^2 + \sum_i \ln 2 \pi \sigma_i^2 + 2 k + \frac{2 k (k + 1)}{N - k - 1}, \qquad
   w \propto e^{-AICc/2},

with :math:`\chi^2` over the N means, errors :math:`\sigma_i` as the emulator has them, and k
parameters: the first two terms are twice the negative logarithm of the likelihood. No effect at
all is among them with k = 0.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.prediction.hypotheses import NONE, Space
from dogshape.diagnosis.prediction.outliers import added
from dogshape.diagnosis.prediction.prediction import Emulator
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect

Record = dict[str, Any]  #: part of the result of a case, as it is kept in JSON

TRIED = (1, 41, 11)  #: values of each parameter, for none, one and two of them
LEAST = 0.5e-3  #: s, the least spread of single shifts


def plain(bench: Bench, emulator: Emulator, effects: Mapping[str, Effect]) -> Record:
    """Name the cause by both baselines.

    The record has ``smallest_rmse``, the effects of the best fit (of single effects), ``rmse_s``
    by effect, and ``aicc``, a list of ``effects`` with their ``weight``, largest first.
    """
    cells = [k for k, cell in enumerate(bench.cells) if cell.time is not None]
    fits: dict[Hypothesis, tuple[float, float]] = {}
    hypotheses: list[Hypothesis] = [NONE]
    hypotheses.extend((name,) for name in effects)
    for hypothesis in hypotheses:
        space = Space(tuple(effects[name] for name in hypothesis), setting_of(bench))
        fits[hypothesis] = _fit(bench, emulator, space, cells)
    alone = {h: fit[0] for h, fit in fits.items() if h != NONE}
    closest: Hypothesis | None = min(alone, key=lambda h: alone[h], default=None)
    weights = _weights({h: fit[1] for h, fit in fits.items()})
    return {
        "smallest_rmse": None if closest is None else list(closest),
        "rmse_s": {h[0]: rmse for h, rmse in alone.items()},
        "aicc": [
            {"effects": list(h), "weight": weights[h]}
            for h in sorted(weights, key=lambda h: -weights[h])
        ],
    }


def _fit(bench: Bench, emulator: Emulator, space: Space, cells: list[int]) -> tuple[float, float]:
    """Return the smallest RMSE in s and the smallest AICc of a hypothesis."""
    k, n = len(space.parameters), len(cells)
    values = space.values(_grid(space))
    squares, chi = np.zeros(len(values)), np.zeros(len(values))
    for cell in cells:
        bare = bench.cells[cell]
        predicted = emulator.at(space.hypothesis, values, cell)
        mean, variance = added(predicted.outlier_share, predicted.behind, predicted.behind_sd)
        sigma = np.sqrt(np.maximum(predicted.times.std(axis=1), LEAST) ** 2 + variance)
        residual = (bare.time or 0.0) - predicted.times.mean(axis=1) - mean
        squares += residual**2
        chi += deviance(residual, sigma**2 / max(1, bare.n) + predicted.error**2)
    more = 2.0 * k * (k + 1.0) / max(1.0, n - k - 1.0)
    return float(np.sqrt(squares.min() / n)), float(chi.min() + 2.0 * k + more)


def deviance(residual: Array, variance: Array) -> Array:
    """Return minus twice the logarithm of a normal density, of distances and variances, (m,)."""
    return residual**2 / variance + np.log(2.0 * np.pi * variance)


def _grid(space: Space) -> Array:
    """Return shares (m, p) that fill the prior and give a bench."""
    p = len(space.parameters)
    steps = np.linspace(0.0, 1.0, TRIED[min(p, 2)])
    shares = np.array(list(itertools.product(steps, repeat=p))).reshape(len(steps) ** p, p)
    every = frozenset(effect.name for effect in space.effects)
    bounded = Space(space.effects, space.setting, every)
    return shares[bounded.possible(bounded.values(shares))]


def _weights(aicc: Mapping[Hypothesis, float]) -> dict[Hypothesis, float]:
    least = min(aicc.values())
    raw = {h: float(np.exp(-0.5 * (value - least))) for h, value in aicc.items()}
    return {h: w / sum(raw.values()) for h, w in raw.items()}
