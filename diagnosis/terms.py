"""Terms that the whole diagnosis shares: arrays and hypotheses.

A *hypothesis* is a set of effects by name, in alphabetical order; its *values* are those of all
parameters of these effects, effect by effect, in the units that the parameters' names end in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

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


@dataclass(frozen=True)
class Table:
    """Base of frozen arrays with a row for each of m values of a hypothesis.

    Fields are arrays (m, ...), tables, or None; those named in ``SHARED`` hold for all rows.
    """

    SHARED: ClassVar[tuple[str, ...]] = ()

    def only(self, which: np.ndarray) -> Self:
        """Select some of the rows."""
        return replace(
            self,
            **{
                name: part.only(which) if isinstance(part, Table) else part[which]
                for name, part in self._parts.items()
            },
        )

    def joined(self, other: Self) -> Self:
        """Append the rows of another table."""
        theirs = other._parts
        return replace(
            self,
            **{
                name: part.joined(theirs[name])
                if isinstance(part, Table)
                else np.concatenate([part, theirs[name]])
                for name, part in self._parts.items()
            },
        )

    @property
    def _parts(self) -> dict[str, Any]:
        every = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in self.SHARED}
        return {name: part for name, part in every.items() if part is not None}
