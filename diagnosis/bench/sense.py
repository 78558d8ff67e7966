"""Sense of rotation, in which the rings turn past each other: a setting of the stand.

The sign of a mismatch says which flanks meet (``docs/mismatch.md``). If ``bench.toml`` calls the
sense *known*, only a slip can have reversed it. If the sense is *unknown*, both senses are equally
probable, and every hypothesis exists once for each.

All effects act otherwise with the other sense, so no result of one sense is combined with one of
the other. A hypothesis with ``reversed_mismatch`` is predicted by simulations at the negated
operating points (``diagnosis.prediction.model``).
"""

from __future__ import annotations

from typing import Literal

from dogshape.diagnosis.terms import Hypothesis

Sense = Literal["known", "unknown"]

REVERSED = "reversed_mismatch"  #: name of the effect
DELAY = "actuation_delay"  #: needs no shift, and so no bank of its own


def forward(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the sense: its effects."""
    return tuple(name for name in hypothesis if name != REVERSED)


def turned(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis with the reversed sense, in alphabetical order."""
    return tuple(sorted((*forward(hypothesis), REVERSED)))
