r"""Marks of one case: the truth beside the diagnosis.

The size of a case's gap compares its means with those of the same engine without any effect. It is
in sampling errors of the means, less the part of chance:

.. math:: g^2 = \max(0, \overline{z^2} - c), \qquad
   z = (\bar t - \bar t_0) / (\sigma_0 / \sqrt n),

with *c* what chance alone gives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from dogshape.diagnosis.prediction.outliers import Array, bulk

Record = dict[str, Any]  #: key, results and score of a set, as they are kept in JSON
Names = tuple[str, ...]

LEAST = 0.5e-3  #: s, the least spread of single shifts
CREDIBLE = 0.9
COUNTED = 0.9  #: share of the operating points that a gap's size counts
#: Mean square of the least nine tenths of standard normal numbers.
CHANCE = float(chi2.cdf(chi2.ppf(COUNTED, 1), 3) / COUNTED)
#: Truths that no data of shifts can tell apart.
UNKNOWN: Names = ("unknown",)


@dataclass(frozen=True)
class Mark:
    """Marks of one case: ``truth`` and findings; hypotheses are names in alphabetical order.

    ``chances`` are probabilities by hypothesis, ``group`` the top's class, ``credible`` the 90 %
    set. ``inside`` has for each true parameter whether its 90 % interval holds it. ``plain`` and
    ``weights`` are what the plain baselines say. A refusal of the data has no chances. ``also`` are
    what the truth looks like to any method: the truth without effects that the data cannot show.
    """

    name: str
    kind: str
    form: str
    truth: Names
    outside: Names
    gap: float
    verdict: str
    causes: Names
    chances: dict[Names, float]
    group: frozenset[Names]
    credible: tuple[Names, ...]
    inside: tuple[bool, ...]
    plain: Names | None
    weights: dict[Names, float]
    time: float
    also: tuple[Names, ...] = ()

    @property
    def refused(self) -> bool:
        """Test that the data were refused as impossible."""
        return self.verdict == "refused"

    @property
    def top(self) -> Names:
        """The most probable hypothesis; unknown where the data were refused."""
        return max(self.chances, key=lambda h: self.chances[h]) if self.chances else UNKNOWN

    @property
    def right(self) -> bool:
        """Test that the top is the truth."""
        return self.top == self.truth

    @property
    def right_class(self) -> bool:
        """Test that the truth is the top or in its class."""
        return self.right or self.truth in self.group

    @property
    def named(self) -> bool:
        """Test that the diagnosis names a cause."""
        return self.verdict == "effect"

    @property
    def named_right(self) -> bool:
        """Test that the named cause is the truth, no more and no less."""
        return self.named and tuple(sorted(self.causes)) == self.truth

    @property
    def named_as_seen(self) -> bool:
        """Test that the named cause is the truth or its visible part."""
        return self.named and tuple(sorted(self.causes)) in (self.truth, *self.also)

    @property
    def causes_true(self) -> bool:
        """Test that every named cause, or part of one, is true."""
        return set(self.causes) <= set(self.truth)

    @property
    def found(self) -> int:
        """Number of true causes in the verdict or the top."""
        return len(set(self.truth) & ({*self.causes} | {*self.top}))


def mark_of(name: str, truth: Record, key: Record, result: Record) -> Mark:
    """Hold one result against the truth of its case (of the key)."""
    found: Record = result.get("diagnosis", {})
    chances = {names_of(h["effects"]): float(h["probability"]) for h in found.get("hypotheses", [])}
    top = max(chances, key=lambda h: chances[h]) if chances else UNKNOWN
    causes = names_of(truth["causes"])
    plain = found.get("plain", {})
    smallest = plain.get("smallest_rmse")
    return Mark(
        name=name,
        kind=truth["kind"],
        form=truth["form"],
        truth=causes,
        outside=tuple(truth["outside"]),
        gap=gap_size(truth["times_s"], key["reference_s"]),
        verdict=found.get("verdict", "refused"),
        causes=tuple(found.get("causes", ())),
        chances=chances,
        group=class_of(top, found),
        credible=_credible(found, chances),
        inside=tuple(_inside(found, truth)),
        plain=None if smallest is None else names_of(smallest),
        weights={names_of(w["effects"]): w["weight"] for w in plain.get("aicc", [])},
        time=float(result["time_s"]),
    )


def gap_size(times: Sequence[Sequence[float | None]], free: Sequence[Sequence[Any]]) -> float:
    """Compute the size of a gap in sampling errors, from times (points, n) in s with None.

    Late shifts (``diagnosis.prediction.outliers``) are left out, and so is the tenth of the
    operating points with the largest *z*: a few shifts of ten that skip a slot by chance move a
    narrow mean by more than most effects do.
    """
    squares = []
    for mine, without in zip(times, free, strict=True):
        bench, base = timely(mine), timely(without)
        if not bench.size or not base.size:
            return math.inf if bool(bench.size) != bool(base.size) else 0.0
        z = (bench.mean() - base.mean()) / sampling_error(without, bench.size)
        squares.append(float(z) ** 2)
    return math.sqrt(max(0.0, counted(squares) - CHANCE))


def counted(squares: Sequence[float]) -> float:
    """Average the squares that count, without the largest."""
    return float(np.sort(squares)[: max(1, math.ceil(COUNTED * len(squares)))].mean())


def timely(times: Sequence[float | None]) -> Array:
    """Select the times of shifts that engaged and are no outliers, s, (k,)."""
    engaged = np.array([t for t in times if t is not None], dtype=float)
    return engaged[np.isfinite(bulk(engaged))] if engaged.size else engaged


def sampling_error(free: Sequence[float | None], count: int) -> float:
    """Compute the standard error, s, of a mean of ``count`` shifts by times without effect."""
    base = timely(free)
    spread = float(base.std(ddof=1)) if base.size > 1 else LEAST
    return max(LEAST, spread) / math.sqrt(count)


def names_of(effects: Iterable[str]) -> Names:
    """Sort the effects of a hypothesis in alphabetical order."""
    return tuple(sorted(effects))


def class_of(one: Names, found: Record) -> frozenset[Names]:
    """List all that stands in a class with a hypothesis, itself too, by the record."""
    groups = [{names_of(effects) for effects in group} for group in found.get("classes", ())]
    return frozenset({one}.union(*(group for group in groups if one in group)))


def _credible(found: Record, chances: dict[Names, float]) -> tuple[Names, ...]:
    if "credible_set" in found:
        return tuple(names_of(h) for h in found["credible_set"])
    return credible_of(chances)


def credible_of(chances: Mapping[Names, float]) -> tuple[Names, ...]:
    """List the fewest hypotheses that have 90 % of the probability, by all their probabilities."""
    chosen: list[Names] = []
    whole = 0.0
    for hypothesis in sorted(chances, key=lambda h: -chances[h]):
        if whole >= CREDIBLE:
            break
        chosen.append(hypothesis)
        whole += chances[hypothesis]
    return tuple(chosen)


def _inside(found: Record, truth: Record) -> list[bool]:
    """Test for each parameter that the interval of the true hypothesis holds the true value."""
    mine = [h for h in found.get("hypotheses", []) if list(h["effects"]) == truth["causes"]]
    if not mine:
        return []
    values = {n: v for one in truth["parameters"].values() for n, v in one.items()}
    given = mine[0].get("parameters", {})
    return [
        given[name]["low"] <= value <= given[name]["high"]
        for name, value in values.items()
        if name in given
    ]
