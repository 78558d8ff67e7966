"""Designs with their simulated expected shift time, as arrays and as a table."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Dataset:
    """Simulated designs.

    Parameters
    ----------
    variables : names of the d design variables, in edge units.
    low, high : search range of each variable, (d,).
    x : designs, (n, d), edge units.
    time : expected shift time, (n,), s.
    error : its standard error, (n,), s.
    physics : hash of everything else that the times depend on; rows of
        different physics never share a data set.
    """

    variables: tuple[str, ...]
    low: Array
    high: Array
    x: Array
    time: Array
    error: Array
    physics: str

    def __len__(self) -> int:
        return len(self.time)

    def scaled(self, x: Array) -> Array:
        """Scale designs (m, d) to the unit cube of the search range."""
        scaled: Array = (np.atleast_2d(x) - self.low) / (self.high - self.low)
        return scaled

    def subset(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> Dataset:
        """Return the data set with only ``rows``."""
        return Dataset(
            self.variables,
            self.low,
            self.high,
            self.x[rows],
            self.time[rows],
            self.error[rows],
            self.physics,
        )

    @property
    def digest(self) -> str:
        """Hash of designs, times and errors."""
        data = np.column_stack([self.x, self.time, self.error])
        return hashlib.sha256(np.ascontiguousarray(data).tobytes()).hexdigest()[:20]

    def frame(self) -> pd.DataFrame:
        """Return the data set as a table, one row a design."""
        table = pd.DataFrame(self.x, columns=list(self.variables))
        return table.assign(expected_shift_time_s=self.time, standard_error_s=self.error)
