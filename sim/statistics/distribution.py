r"""Distributions of what is not known for sure, by name, with truncation.

``normal``
    mean :math:`\mu`, standard deviation :math:`\sigma`.
``uniform``
    between low and high.
``lognormal``
    median *m* and factor *k*: two values of three lie between m/k and m k
    (:math:`\sigma = \ln k` of the logarithm).
``triangular``
    between low and high with the peak at the mode.

``low`` and ``high`` cut off a normal or lognormal: with distribution function *F* the value at
the share *u* is :math:`F^{-1}(F(low) + u (F(high) - F(low)))`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError, did_you_mean

Values = NDArray[np.float64]

#: What each distribution needs; a normal and a lognormal may have low and high besides.
NEEDS = {
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
    "lognormal": ("median", "factor"),
    "triangular": ("low", "mode", "high"),
}
LEAST = 1e-3  #: share of a distribution that a truncation must leave


@dataclass(frozen=True)
class Distribution:
    """A distribution of one number, in the unit of the key that it stands for.

    Parameters
    ----------
    key : of the study file, for messages.
    kind : one of ``NEEDS``; an unknown one raises InputError.
    mean, sd, median, factor, low, mode, high : those that the kind needs, None for the others.
    """

    key: str
    kind: str
    mean: float | None = None
    sd: float | None = None
    median: float | None = None
    factor: float | None = None
    low: float | None = None
    mode: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in NEEDS:
            hint = did_you_mean(self.kind, NEEDS)
            raise InputError(
                f"{self.key}.distribution is '{self.kind}', which is not a distribution; {hint}"
            )
        self._require_names()
        self._require_values()
        if self._share_kept() < LEAST:
            raise InputError(
                f"{self.key}: next to nothing of the {self.kind} distribution lies between its "
                "low and high; widen them"
            )

    def _require_names(self) -> None:
        needed = NEEDS[self.kind]
        allowed = {*needed, *(("low", "high") if self.kind in ("normal", "lognormal") else ())}
        for name in needed:
            if name not in self.given:
                whole = ", ".join(needed)
                raise InputError(
                    f"{self.key} lacks '{name}': a {self.kind} distribution needs {whole}; add it"
                )
        for name, value in self.given.items():
            if name not in allowed:
                raise InputError(
                    f"{self.key}.{name} is nothing that a {self.kind} distribution has; remove it"
                )
            if not math.isfinite(value):
                raise InputError(f"{self.key}.{name} is {value}, but it must be finite; correct it")

    def _require_values(self) -> None:
        low, high = self.bounds
        if not low < high:
            raise InputError(
                f"{self.key}.low is {low:.6g}, but it must lie below high = {high:.6g}; "
                "exchange or correct them"
            )
        if self.mode is not None and not low <= self.mode <= high:
            raise InputError(
                f"{self.key}.mode is {self.mode:.6g}, but it must lie between low = {low:.6g} "
                f"and high = {high:.6g}; correct it"
            )
        for name, least in (("sd", 0.0), ("median", 0.0), ("factor", 1.0)):
            value = self.given.get(name)
            if value is not None and value <= least:
                rule = f"it must be more than {least:.6g}"
                raise InputError(f"{self.key}.{name} is {value:.6g}, but {rule}; correct it")

    @property
    def given(self) -> dict[str, float]:
        """The numbers that are given, by name."""
        names = ("mean", "sd", "median", "factor", "low", "mode", "high")
        pairs = ((name, getattr(self, name)) for name in names)
        return {name: value for name, value in pairs if value is not None}

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value, infinite where there is none."""
        least = 0.0 if self.kind == "lognormal" else -math.inf
        low = least if self.low is None else max(self.low, least)
        return low, math.inf if self.high is None else self.high

    @property
    def text(self) -> str:
        """Description in words that tell any two distributions apart."""
        return ", ".join([self.kind, *(f"{name} {v:.12g}" for name, v in self.given.items())])

    def at(self, shares: Values) -> Values:
        """Return the values below which so large ``shares`` of the distribution lie, (n,)."""
        curve = self._curve()
        low, high = curve.cdf(self.bounds)
        values: Values = curve.ppf(low + shares * (high - low))
        return np.clip(values, *self.bounds)

    def _share_kept(self) -> float:
        if self.low is None and self.high is None:
            return 1.0
        if self.kind in ("uniform", "triangular"):
            return 1.0
        low, high = self._curve().cdf(self.bounds)
        return float(high - low)

    def _curve(self) -> Any:
        """Return the distribution without its truncation, as scipy has it."""
        from scipy import stats  # noqa: PLC0415  slow to load, and a certain study does without

        if self.kind == "normal":
            return stats.norm(self.mean, self.sd)
        if self.kind == "lognormal":
            return stats.lognorm(math.log(self.factor or 0.0), scale=self.median)
        low, high = self.bounds
        if self.kind == "uniform":
            return stats.uniform(low, high - low)
        mode = self.mode if self.mode is not None else low
        return stats.triang((mode - low) / (high - low), low, high - low)


def sobol_shares(count: int, dimensions: int, seed: int) -> Values:
    """Return the first ``count`` places of a scrambled Sobol sequence, (count, dimensions).

    Each in (0, 1).
    """
    from scipy.stats import qmc  # noqa: PLC0415  slow to load, and a certain study does without

    sequence = qmc.Sobol(dimensions, seed=np.random.default_rng(seed))
    whole = sequence.random_base2(max(0, math.ceil(math.log2(count))))
    return np.clip(whole[:count], 1e-12, 1.0 - 1e-12)
