"""Prices of limits against a search of every design, where there are few."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.surrogate_findings import FACTORS, TOLERANCES, prices, prices_table
from dogshape.pipeline.simulate.design import design_of
from dogshape.surrogate.covariance import Array

COUNTS = range(6, 37)


class Fewer:
    """A time that falls with the number of dogs: 1/N s."""

    def predict(self, designs: Array) -> tuple[Array, Array]:
        return 1.0 / designs[:, 0], np.zeros(len(designs))


def counted(*settings: str) -> Setup:
    """A study that searches the count alone, so that all designs can be looked at one by one."""
    whole = load_study("mq200_paper", ["dog.height_mm=2.5", "dog.chamfer_deg=10.0", *settings])
    return replace(whole, variables={"count": whole.variables["count"]})


def test_prices_are_those_of_every_design() -> None:
    study = counted()
    every = {n: design_of(study, {"count": n}).checks for n in COUNTS}
    known = 0
    for row in (row for row in prices(study, Fewer()) if row["name"] != TOLERANCES):
        for key, factor in FACTORS.items():
            limit = factor * row["limit"]
            kept = [
                n for n, checks in every.items()
                if checks and all(
                    c.passed if c.name != row["name"]
                    else c.value <= limit if c.rule.at_most else c.value >= limit
                    for c in checks
                )
            ]  # fmt: skip
            assert row[key] == (pytest.approx(1.0 / max(kept)) if kept else None)
            known += bool(kept)
    assert known > 40


@pytest.mark.parametrize(
    ("settings", "cost"),
    [
        (["search.limits.smallest_margin_worst=0.0"], True),
        (["search.limits.smallest_margin_worst=0.0", "tolerance.root_radius_mm=0.0"], True),
        (["tolerance.contact_ratio=0.1"], False),
    ],
)
def test_tolerances_at_their_worst_are_a_limit_with_a_price(
    settings: list[str], cost: bool
) -> None:
    """With them as they are, and without any, as of every number of dogs one by one."""
    study = counted(*settings)
    exact = replace(study.limits, tolerances=study.limits.tolerances.without_sizes())

    def fastest(one: Setup) -> float:
        return 1.0 / max(n for n in COUNTS if design_of(one, {"count": n}).feasible)

    rows = {row["name"]: row for row in prices(study, Fewer())}
    row = rows[TOLERANCES]
    assert row["now_s"] == pytest.approx(fastest(study))
    assert row["without_s"] == pytest.approx(fastest(replace(study, limits=exact)))
    assert bool(prices_table([row]).rows) == cost
    assert all(one["now_s"] == row["now_s"] for one in rows.values())


def test_limits_without_a_source_come_first() -> None:
    times = {"less_s": 0.05, "now_s": 0.06, "more_s": 0.07, "without_s": 0.01}
    dear = {name: 1e-3 * price for name, price in times.items()}
    rows = [
        {"name": name, "key": "k", "unit": "", "limit": 1.0, "at_most": False, **cost}
        for name, cost in (
            ("root_fatigue", times), ("slot_width", dear), ("contact_ratio", times),
            ("slower_than_reference_s", times),
        )
    ]  # fmt: skip
    table = prices_table(rows)
    names = [row[0].removesuffix(" k") for row in table.rows]
    assert names[:2] == ["limits without a source, assumed", "contact ratio"]
    assert names[2:] == ["other limits", "root fatigue", "time lost on the reference"]
    assert table.looks == {0: "group", 2: "group"}
