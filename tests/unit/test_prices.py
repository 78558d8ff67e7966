"""Prices of limits against a search of every design, where there are few."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.study.prices import (
    FACTORS,
    at_factor,
    dear,
    prices,
    prices_figure,
    step_price,
)
from dogshape.pipeline.simulate.design import WORST, design_of
from dogshape.surrogate.covariance import Array


class Fewer:
    """A time that falls with the number of dogs: 1/N s."""

    def predict(self, designs: Array) -> tuple[Array, Array]:
        return 1.0 / designs[:, 0], np.zeros(len(designs))


def test_curves_are_those_of_every_design() -> None:
    """Count alone is searched, so all designs can be looked at one by one."""
    whole = load_study("mq200_paper", {"dog.height_mm": 2.5, "dog.chamfer_deg": 10.0})
    study = replace(whole, variables={"count": whole.variables["count"]})
    assert list(study.variables) == ["count"]
    rows = prices(study, Fewer())
    every = {n: design_of(study, {"count": n}).checks for n in range(6, 37)}
    told = 0
    for row in rows:
        for factor, (limit, time) in zip(FACTORS, row["curve"], strict=True):
            assert limit == pytest.approx(factor * row["limit"])
            kept = [
                n
                for n, checks in every.items()
                if checks
                and all(
                    (c.value <= limit if c.rule.at_most else c.value >= limit)
                    if c.name == row["name"]
                    else c.passed
                    for c in checks
                )
            ]
            assert time == (None if not kept else pytest.approx(1.0 / max(kept)))
            told += time is not None
    assert told > 100
    paid = dear(rows)
    assert {"tip_width", "slot_width"} & {row["name"] for row in paid}
    assert len(prices_figure(paid).data) == min(len(paid), 6)


def test_the_price_of_a_natural_step() -> None:
    """A millisecond for a tenth of 1.5 mm is two thirds of one for a tenth of a millimetre."""
    row = {"unit": "mm", "limit": 1.5, "price_s": 1e-3, "curve": [(0.0, f) for f in FACTORS]}
    step = step_price(row)
    assert step == pytest.approx((0.1, 1e-3 * 1e3 * 0.1 / 0.15))
    assert at_factor(row, 1.1) == 1.1
    assert step_price({**row, "price_s": None}) is None
    assert step_price({**row, "unit": "furlong"}) is None


def test_tolerances_at_their_worst_have_a_price() -> None:
    """Between the best of every design that keeps limits as it is, and with tolerances too."""
    whole = load_study(
        "mq200_paper", {"dog.height_mm": 2.5, "dog.chamfer_deg": 10.0,
                        "search.limits.smallest_margin_worst": 0.0}
    )  # fmt: skip
    study = replace(whole, variables={"count": whole.variables["count"]})
    rows = prices(study, Fewer())
    (row,) = [row for row in rows if row["name"] == WORST]
    nominal = replace(study, file=load_study("mq200_paper").file)
    kept = [
        max(n for n in range(6, 37) if design_of(one, {"count": n}).feasible)
        for one in (study, nominal)
    ]
    assert kept[0] < kept[1]
    assert (row["as_is_s"], row["without_s"]) == pytest.approx((1.0 / kept[0], 1.0 / kept[1]))
    assert row["price_s"] == pytest.approx(1.0 / kept[0] - 1.0 / kept[1])
    assert row in dear(rows)
    assert (at_factor(row, 1.0), at_factor(row, 0.9)) == (row["as_is_s"], None)
    assert step_price(row) is None
    assert len(prices_figure([row]).data) == 0
