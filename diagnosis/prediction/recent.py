"""Recent results of a function of arrays: what is asked again within a data set is not made again.

Hypotheses with the same number of parameters are scored at the same shares of their priors first,
and last at the ends of these. So an effect is asked for the same values with each of its partners.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import numpy as np

Found = TypeVar("Found")

KEPT = 64  #: results that are kept, about 1 MB each of an effect at 28 operating points


class Recent(Generic[Found]):
    """The results that were asked for last, by a key and the values of an array."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._found: OrderedDict[Hashable, Found] = OrderedDict()

    def get(self, key: Hashable, values: np.ndarray, make: Callable[[], Found]) -> Found:
        """Return the result for a key and values, by ``make`` where it is not known."""
        whole = key, values.shape, values.tobytes()
        if whole not in self._found:
            self._found[whole] = make()
            if len(self._found) > self._kept:
                self._found.popitem(last=False)
        self._found.move_to_end(whole)
        return self._found[whole]
