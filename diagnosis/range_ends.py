"""Sizes at an end of the range of their parameter: the list of values ends before the data do.

Draws of a posterior that reaches beyond an end pile up there: their mean distance from the end is
one standard deviation if the density falls exponentially, 1.3 for half a normal distribution, 1.7
for a parameter of which the data say nothing.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np

from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array
from dogshape.sim.effect import Parameter

End = Literal["low", "high"]


class RangeEnd(NamedTuple):
    """Parameter whose size lies at an end of its range."""

    effect: str
    parameter: str
    end: End
    value: float  #: of the end, in the parameter's unit

    def to_dict(self) -> dict[str, Any]:
        """Write the record ``at_range_end``."""
        return self._asdict()


def find_end(parameter: Parameter, draws: Array, neutral: float, settings: Settings) -> End | None:
    """Find the end of a range that draws (n,) of its parameter pile up at.

    Ends towards the neutral value, which is no effect, and limits of possible values do not count.
    """
    shares = parameter.share(draws)
    ends: dict[End, Array] = {}
    if neutral > parameter.low > parameter.least:
        ends["low"] = shares
    if neutral < parameter.high < parameter.most:
        ends["high"] = 1.0 - shares
    limit = min(settings.end_distance, settings.end_distance_sds * float(np.std(shares)))
    return next((end for end, distance in ends.items() if distance.mean() < limit), None)
