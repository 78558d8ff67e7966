"""Sense of rotation, in which the rings turn past each other: a setting of the stand.

The sign of a mismatch says which flanks meet (``docs/mismatch.md``). If ``bench.toml`` calls the
sense *known*, only a slip can have reversed it. If the sense is *unknown*, both senses are equally
probable, and every hypothesis exists once for each.

All effects act otherwise with the other sense, so no result of one sense is combined with one of
the other. A hypothesis with ``reversed_mismatch`` is predicted by simulations at the negated
operating points (``diagnosis.prediction.sense_bank``).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Literal

from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Hypothesis

Sense = Literal["known", "unknown"]

REVERSED = "reversed_mismatch"  #: name of the effect
DELAY = "actuation_delay"  #: needs no shift, and so no bank of its own

#: Prior probability of the reversed sense (``diagnosis.settings.Priors``).
SHARES: dict[Sense, float] = {
    "known": USUAL.priors.reversed_known,
    "unknown": USUAL.priors.reversed_unknown,
}


def forward(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the sense: its effects."""
    return tuple(name for name in hypothesis if name != REVERSED)


def turned(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis with the reversed sense, in alphabetical order."""
    return tuple(sorted((*forward(hypothesis), REVERSED)))


def predictable(hypothesis: Hypothesis, sense: Sense) -> bool:
    """Check that the banks of a sense predict a hypothesis.

    Where the sense is known, the reversed one has no more than its baseline and a delay.
    """
    alone = set(forward(hypothesis)) <= {DELAY}
    return REVERSED not in hypothesis or sense == "unknown" or alone


def both_senses(
    hypotheses: Iterable[Hypothesis], effects: Collection[str], sense: Sense
) -> list[Hypothesis]:
    """Return hypotheses, and behind them those with the reversed sense that can be predicted.

    Without the effect ``reversed_mismatch`` there are none of these.
    """
    plain = list(dict.fromkeys(forward(h) for h in hypotheses))
    if REVERSED not in effects:
        return plain
    return [*plain, *(turned(h) for h in plain if predictable(turned(h), sense))]
