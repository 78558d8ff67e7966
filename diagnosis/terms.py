"""Terms that the whole diagnosis shares: arrays and hypotheses.

A *hypothesis* is a set of effects by name, in alphabetical order; its *values* are those of all
parameters of these effects, effect by effect. With an unknown sense of rotation every hypothesis
exists once for each sense; results of the two are never combined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.effect import Effect

Array = NDArray[np.float64]
Hypothesis = tuple[str, ...]  #: effects by name, () for none
NONE: Hypothesis = ()
REVERSED = "reversed_mismatch"  #: name of the effect
DELAY = "actuation_delay"  #: needs no shift, and so no bank of its own
UNKNOWN: Hypothesis = ("unknown",)  #: a structured gap that no known effect explains


def join_words(words: Sequence[str], conjunction: str = "and") -> str:
    """Join words as an enumeration: ``a, b and c``; empty for no words."""
    if len(words) < 2:
        return "".join(words)
    return f" {conjunction} ".join([", ".join(words[:-1]), words[-1]])


def hypothesis_name(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """Write a hypothesis in plain words: its effects, joined by *and*."""
    if hypothesis == UNKNOWN:
        return "an unknown cause"
    return join_words([effects[name].plain for name in hypothesis]) or "no effect"


def strip_sense(hypothesis: Hypothesis) -> Hypothesis:
    """Remove the reversed sense of rotation from a hypothesis."""
    return tuple(name for name in hypothesis if name != REVERSED)


def reverse_sense(hypothesis: Hypothesis) -> Hypothesis:
    """Add the reversed sense of rotation to a hypothesis, in alphabetical order."""
    return tuple(sorted((*strip_sense(hypothesis), REVERSED)))
