"""Effects together are simulated once, and kept where the next diagnosis finds them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import Bank, Plan, collect
from dogshape.diagnosis.prediction.levels import Level
from dogshape.pipeline.diagnose.joint_simulation import FOLDER, JointSimulation
from dogshape.pipeline.progress import Progress
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from tests.made_up import few_cells, made_up

EFFECTS = load()
PAIR = ("moving_mass", "sleeve_friction")
PLAN = Plan(tuple(EFFECTS[name] for name in PAIR), checks=())
LEVELS = [Level(PAIR, (2.0, 40.0)), Level(PAIR, (5.0, 20.0))]


class Said(Progress):
    """Progress that keeps what is said."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, text: str) -> None:
        """Keep a line."""
        self.lines.append(text)


@pytest.fixture(scope="module")
def bank() -> Bank:
    bench = few_cells(load_bench("mq200_adams"), [(25, 235.2), (50, 315.5)])
    return collect(PLAN, bench, made_up)


class Counted(JointSimulation):
    """Simulation by made-up shifts that counts them; dies once, if told to."""

    done = 0
    dies = False

    def _run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        if type(self).dies:
            raise KeyboardInterrupt
        type(self).done += sum(len(block.angles) for block in blocks)
        return made_up(blocks)


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Counted.done, Counted.dies = 0, False


def _simulation(bank: Bank, folder: Path, progress: Progress | None = None) -> Counted:
    return Counted(PLAN, bank, folder / "none.json", folder, 1, progress or Said())


def test_levels_are_simulated_once(bank: Bank, tmp_path: Path) -> None:
    said = Said()
    first = _simulation(bank, tmp_path, said)(LEVELS[:1])
    assert first.shape == (1, 2, 16)
    assert Counted.done == 32
    assert said.lines == ["32 shifts of effects together: moving_mass with sleeve_friction"]
    both = _simulation(bank, tmp_path, said)(LEVELS)
    assert Counted.done == 64
    assert np.array_equal(both[0], first[0])
    again = _simulation(bank, tmp_path, said)(LEVELS[::-1])
    assert Counted.done == 64
    assert len(said.lines) == 2
    assert np.array_equal(again[::-1], both)
    assert len(list((tmp_path / FOLDER).iterdir())) == 1


def test_a_run_that_is_stopped_keeps_the_rounds_before(bank: Bank, tmp_path: Path) -> None:
    simulation = _simulation(bank, tmp_path)
    simulation(LEVELS[:1])
    Counted.dies = True
    with pytest.raises(KeyboardInterrupt):
        simulation(LEVELS)
    Counted.dies = False
    _simulation(bank, tmp_path)(LEVELS)
    assert Counted.done == 64


def test_another_clutch_or_other_points_have_a_file_of_their_own(
    bank: Bank, tmp_path: Path
) -> None:
    fewer = few_cells(load_bench("mq200_adams"), [(25, 235.2)])
    _simulation(bank, tmp_path)(LEVELS[:1])
    _simulation(collect(PLAN, fewer, made_up), tmp_path)(LEVELS[:1])
    assert len(list((tmp_path / FOLDER).iterdir())) == 2


def test_what_the_package_brings_is_not_simulated(bank: Bank, tmp_path: Path) -> None:
    _simulation(bank, tmp_path)(LEVELS)
    (kept,) = (tmp_path / FOLDER).iterdir()
    brought = Counted(PLAN, bank, kept, tmp_path / "other", 1, Said())
    brought(LEVELS)
    assert Counted.done == 64
    assert not (tmp_path / "other").exists()


def test_a_file_that_is_none_is_named(bank: Bank, tmp_path: Path) -> None:
    _simulation(bank, tmp_path)(LEVELS[:1])
    (kept,) = (tmp_path / FOLDER).iterdir()
    kept.write_text("{}", encoding="utf-8")
    with pytest.raises(StorageError, match="is not a bank of shifts; remove it"):
        _simulation(bank, tmp_path)(LEVELS[:1])
