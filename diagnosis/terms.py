"""Terms that the whole diagnosis shares: arrays and hypotheses.

A *hypothesis* is a set of effects by name, in alphabetical order; its *values* are those of all
parameters of these effects, effect by effect. With an unknown sense of rotation every hypothesis
exists once for each sense; results of the two are never combined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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


def listed(names: Sequence[str], last: str = "and") -> str:
    """Join names as a list in words."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def plain(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """Return a hypothesis as people say it."""
    if hypothesis == UNKNOWN:
        return "an unknown cause"
    return listed([effects[name].plain for name in hypothesis]) or "no effect"


def forward(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the sense: its effects."""
    return tuple(name for name in hypothesis if name != REVERSED)


def turned(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis with the reversed sense, in alphabetical order."""
    return tuple(sorted((*forward(hypothesis), REVERSED)))
