"""Terms that the whole diagnosis shares: arrays and hypotheses.

A *hypothesis* is a set of effects by name, in alphabetical order; its *values* are those of all
parameters of these effects, effect by effect, in the units that the parameters' names end in.

With an unknown sense of rotation both senses are equally probable, and every hypothesis exists once
for each. All effects act otherwise with the other sense, so no result of one sense is combined with
one of the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.effect import Effect

Array = NDArray[np.float64]
Hypothesis = tuple[str, ...]  #: effects by name, () for none
NONE: Hypothesis = ()
Sense = Literal["known", "unknown"]  #: of rotation: sign of the mismatch (``docs/mismatch.md``)
REVERSED = "reversed_mismatch"  #: name of the effect
DELAY = "actuation_delay"  #: needs no shift, and so no bank of its own
UNKNOWN: Hypothesis = ("unknown",)  #: a structured gap that no known effect explains


def plain(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """Return a hypothesis as people say it."""
    if hypothesis == UNKNOWN:
        return "an unknown cause"
    names = [effects[name].plain for name in hypothesis]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or (
        "no effect"
    )


def forward(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the sense: its effects."""
    return tuple(name for name in hypothesis if name != REVERSED)


def turned(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis with the reversed sense, in alphabetical order."""
    return tuple(sorted((*forward(hypothesis), REVERSED)))
