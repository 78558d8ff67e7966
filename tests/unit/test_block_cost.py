"""Likely cost of shifts: which blocks go first, and that no result depends on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.block_cost import (
    FINE,
    REVERSED,
    dearest_first,
    likely_cost,
    mean_cost,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.units import RPM


@pytest.fixture
def blocks(study: Setup) -> list[Block]:
    """One block for each operating point of the published study."""
    return even_blocks(study.clutch, study.points, 3, 1)


def _at(blocks: list[Block], mismatch_rpm: float, force: float) -> Block:
    (found,) = [
        block
        for block in blocks
        if block.point.mismatch == pytest.approx(mismatch_rpm * RPM)
        and block.point.profile.force == force
    ]
    return found


def test_slow_and_fast_shifts_cost_more_than_those_between(blocks: list[Block]) -> None:
    cost = {rpm: likely_cost(_at(blocks, rpm, 235.2)) for rpm in (5, 50, 249)}
    assert cost[5] > 1.5 * cost[50] < cost[249]
    assert likely_cost(_at(blocks, 249, 641.5)) < cost[249]
    still = _at(blocks, 5, 235.2)
    still = replace(still, point=replace(still.point, mismatch=0.0))
    assert likely_cost(still) < 10.0
    turned = replace(still, point=replace(still.point, mismatch=-5 * RPM))
    assert likely_cost(turned) == REVERSED * cost[5]
    fine = _at(blocks, 5, 235.2).refined(0)
    assert likely_cost(fine) == FINE * cost[5]
    assert mean_cost([fine, turned]) == pytest.approx(cost[5])


def test_engines_differ_in_what_costs(blocks: list[Block]) -> None:
    slow = _at(blocks, 5, 235.2)
    quick = replace(slow, clutch=slow.clutch.with_engine("planar"))
    assert 1.0 < likely_cost(quick) < likely_cost(slow)


def test_the_dearest_go_first_and_none_is_lost(blocks: list[Block]) -> None:
    few = blocks[4].only([0])
    ordered = dearest_first([few, *blocks])
    costs = [likely_cost(block) * len(block.angles) for block in ordered]
    assert costs == sorted(costs, reverse=True)
    assert len(ordered) == len(blocks) + 1
    assert mean_cost([]) == 1.0
    assert min(map(likely_cost, blocks)) < mean_cost(blocks) < max(map(likely_cost, blocks))


def test_weights_add_up_to_the_shifts_and_rows_keep_their_order(
    small_study: Setup, tmp_path: Path
) -> None:
    told: list[float] = []
    counted: list[int] = []
    clutch = small_study.clutch.with_engine("planar")
    blocks = even_blocks(clutch, small_study.points, 3, 1)
    alone = Executor(ShiftJournal(tmp_path / "one.jsonl"), 1, counted.append, weigh=told.append)
    rows = alone.run(blocks)
    equal = sum(weight * count for weight, count in zip(told, counted, strict=True))
    assert equal == pytest.approx(sum(counted))
    assert max(told) > 1.0 > min(told)
    both = Executor(ShiftJournal(tmp_path / "two.jsonl"), 2).run(blocks)
    assert both == rows
    keys = [[row["key"] for row in mine] for mine in rows]
    assert keys == [block.keys for block in blocks]
