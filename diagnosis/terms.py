"""Terms that the whole diagnosis shares: arrays and hypotheses.

A *hypothesis* is a set of effects by name, in alphabetical order; its *values* are those of all
parameters of these effects, effect by effect, in the units that the parameters' names end in.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.effect import Effect

Array = NDArray[np.float64]
Hypothesis = tuple[str, ...]  #: effects by name, () for none
NONE: Hypothesis = ()
UNKNOWN: Hypothesis = ("unknown",)  #: a structured gap that no known effect explains


def plain(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """Return a hypothesis as people say it."""
    if hypothesis == UNKNOWN:
        return "an unknown cause"
    names = [effects[name].plain for name in hypothesis]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or (
        "no effect"
    )
