"""What a hypothesis predicts of points that were left out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from dogshape.diagnosis.inference.held_out import by_effects


def _scored(means: np.ndarray, weights: np.ndarray) -> Any:
    rows = SimpleNamespace(predicted=SimpleNamespace(mean=means))
    return cast(Any, SimpleNamespace(rows=rows, weights=lambda cells: weights))


def test_values_by_which_nothing_engages_have_no_time_of_zero() -> None:
    means = np.array([[0.1, np.nan, np.nan], [0.2, 0.3, np.nan]])
    predict = by_effects(_scored(means, np.array([0.25, 0.75])))
    found = predict(np.ones(3, dtype=bool))
    assert found[0] == pytest.approx(0.175)
    assert found[1] == pytest.approx(0.3)
    assert np.isnan(found[2])
