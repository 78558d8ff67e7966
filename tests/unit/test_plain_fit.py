"""Plain method beside the diagnosis: fits of made-up times, weights and verdicts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.validation.blind.plain_fit import MODEL_ERROR, MeanTimes, PlainFit, conclude, sizes_of

BASE = np.linspace(0.05, 0.3, 12)  #: mean times without any effect, s
GAIN = {"lag": np.full(12, 0.1), "drag": 0.3 * np.linspace(1.0, 0.0, 12) ** 3, "mass": 0.4 * BASE}


class _Prediction(SimpleNamespace):
    def select(self, index: Any) -> _Prediction:
        return _Prediction(mean=self.mean[index], sd=self.sd[index])


class _Space:
    def __init__(self, names: tuple[str, ...]) -> None:
        self.parameters = tuple(SimpleNamespace(name=f"{name}_size") for name in names)

    def values(self, shares: Any) -> Any:
        return shares


class _Model:
    """Times that grow in proportion to shares of ranges."""

    effects = GAIN

    def space(self, hypothesis: tuple[str, ...]) -> _Space:
        return _Space(hypothesis)

    def predict(self, hypothesis: tuple[str, ...], shares: Any) -> _Prediction:
        gain = sum((shares[:, k, None] * GAIN[n] for k, n in enumerate(hypothesis)), 0.0 * BASE)
        mean = np.broadcast_to(BASE + gain, (len(shares), 12))
        return _Prediction(mean=mean, sd=0.05 * mean)

    def possible(self, hypothesis: tuple[str, ...], shares: Any) -> Any:
        return np.ones(len(shares), dtype=bool)


def _times(mean: Any) -> MeanTimes:
    return MeanTimes(_Model(), np.arange(12), np.asarray(mean), np.full(12, 10.0))  # type: ignore[arg-type]


def _diagnosed(mean: Any) -> dict[str, Any]:
    return conclude(_times(mean).fit_all(), _Model(), 12)  # type: ignore[arg-type]


def test_a_single_cause_is_found_with_its_size() -> None:
    result = _diagnosed(BASE + 0.6 * GAIN["drag"])
    # AICc gives a second effect that nothing needs a share of exp(-penalty / 2) alone.
    assert (result["verdict"], result["causes"]) == ("ambiguous", ["drag"])
    assert result["hypotheses"][0]["effects"] == ["drag"]
    size = result["hypotheses"][0]["parameters"]["drag_size"]
    assert size["low"] < 0.6 < size["high"]
    assert sum(h["probability"] for h in result["hypotheses"]) == pytest.approx(1.0)


def test_a_pair_none_and_an_unlisted_cause() -> None:
    pair = _diagnosed(BASE + 0.7 * GAIN["drag"] + 0.8 * GAIN["lag"])
    assert pair["hypotheses"][0]["effects"] == ["drag", "lag"]
    assert _diagnosed(BASE)["hypotheses"][0]["effects"] == []
    assert _diagnosed(BASE * np.where(np.arange(12) % 2, 1.4, 1.0))["verdict"] == "unknown"


def test_weights_are_those_of_the_criterion() -> None:
    """Without parameters: chi square and ln variances alone (Burnham and Anderson 2002)."""
    means = _times(1.02 * BASE)
    none = means.fit(())
    assert none is not None
    variance = BASE**2 * (0.05**2 / 10.0 + MODEL_ERROR**2)
    chi_square = float(((0.02 * BASE) ** 2 / variance).sum())
    assert none.chi_square == pytest.approx(chi_square)
    assert none.criterion == pytest.approx(chi_square + np.log(variance).sum())
    others = [
        PlainFit((name,), np.zeros(1), np.zeros((1, 1)), 1.0, none.criterion + 2.0 * k)
        for k, name in enumerate(GAIN, start=1)
    ]
    weights = [h["probability"] for h in conclude([none, *others], _Model(), 12)["hypotheses"]]  # type: ignore[arg-type]
    assert np.array(weights[1:]) / weights[0] == pytest.approx(np.exp([-1.0, -2.0, -3.0]))


def test_sizes_of_a_fit_have_its_errors() -> None:
    fit = PlainFit(("lag",), np.array([0.5]), np.array([[0.1**2]]), 1.0, 0.0)
    size = sizes_of(fit, _Model())["lag_size"]  # type: ignore[arg-type]
    assert size["mean"] == pytest.approx(0.5, abs=0.01)
    assert (size["high"] - size["low"]) / 2.0 == pytest.approx(1.645 * 0.1, rel=0.1)
