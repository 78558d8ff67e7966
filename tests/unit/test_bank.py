"""The bank of simulations: what is planned, simulated once, kept and read back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.bank import Bank, Plan, blocks_of, collect, settings_of
from dogshape.diagnosis.prediction.bank_store import TICK, BankStore
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.levels import Axes, check_level, levels_of, only_read
from dogshape.pipeline.diagnose.bank_diagnosis import (
    PLANAR,
    TIMES,
    Means,
    blocks_by_key,
    brought,
    plans_of,
    with_bank_engine,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.numerical_error import Runner
from dogshape.sim.statistics.shift_records import Record
from tests.made_up import few_cells, made_up

EFFECTS = load()
BENCH = load_bench("mq200_adams")


@pytest.fixture
def bench() -> Bench:
    return few_cells(BENCH, [(10, 235.2), (249, 641.5)])


def _plan(*names: str, angles: int = 8, checks: bool = False) -> Plan:
    effects = tuple(EFFECTS[name] for name in names)
    return Plan(effects, angles) if checks else Plan(effects, angles, checks=())


def test_the_default_plan_fits_a_bench_of_28_points_into_an_hour() -> None:
    plan = Plan(tuple(EFFECTS.values()))
    assert len(BENCH.cells) == 28
    assert 30_000 < plan.shifts(BENCH) < 70_000
    assert plan.hours(BENCH, cores=2, shift=PLANAR) < 3.0 / 60.0
    fewer = replace(plan, angles=8)
    assert fewer.shifts(BENCH) == plan.shifts(BENCH) / 2


def test_the_plan_counts_the_shifts_of_its_blocks(bench: Bench) -> None:
    plan = _plan("moving_mass", "contact_friction", "sleeve_friction", checks=True)
    blocks = list(blocks_of(plan, bench))
    assert sum(len(block.angles) for block in blocks) == plan.shifts(bench)
    pairs = [level for level in plan.levels_for(bench) if len(level.hypothesis) == 2]
    # Each pair at two strengths, with the effects' own levels among the bank's.
    names = [("moving_mass", "sleeve_friction"), ("contact_friction", "sleeve_friction")]
    assert [p.hypothesis for p in pairs] == names * 2
    assert len({p.values for p in pairs}) == 4


def test_levels_span_the_prior_and_leave_the_baseline_its_place(bench: Bench) -> None:
    setting = settings_of(bench)[0]
    friction = [level.values[0] for level in levels_of(EFFECTS["sleeve_friction"], setting, 5, 9)]
    assert friction == pytest.approx(np.geomspace(3.0, 200.0, 5).tolist())
    scale = [level.values[0] for level in levels_of(EFFECTS["force_scale"], setting, 5, 9)]
    assert scale == pytest.approx([0.5, 0.75, 1.25, 1.5])
    pairs = [level.values for level in levels_of(EFFECTS["contact_friction"], setting, 5, 9)]
    assert len(set(pairs)) == 9
    assert all(dynamic <= static for static, dynamic in pairs)
    assert (0.45, 0.03) in pairs


def _widened(effect: Effect, place: int, *, upper: bool) -> Effect:
    return effect.with_range(effect.parameters[place].widened(0.5, upper=upper))


def test_a_wider_range_keeps_its_levels_and_goes_on_at_their_spacing(bench: Bench) -> None:
    setting = settings_of(bench)[0]

    def values(effect: Effect) -> list[float]:
        return [level.values[0] for level in levels_of(effect, setting, 5, 9)]

    scale = EFFECTS["force_scale"]
    once = _widened(scale, 0, upper=True)
    assert values(once) == pytest.approx([0.5, 0.75, 1.25, 1.5, 1.75, 2.0])
    assert values(once)[:4] == values(scale)
    # 1.5 wide now, so half of that comes below.
    twice = _widened(once, 0, upper=False)
    assert values(twice)[-6:] == values(once)
    assert min(values(twice)) == twice.parameters[0].low
    assert np.diff(values(twice)).max() <= 0.5
    friction = EFFECTS["sleeve_friction"]
    logs = np.log(values(_widened(friction, 0, upper=True)))
    # The range ends at 1000 N, in two steps of less than the usual ones.
    assert np.diff(logs)[:4] == pytest.approx(np.full(4, np.log(200.0 / 3.0) / 4.0))
    assert np.diff(logs)[4:] == pytest.approx(np.full(2, np.log(5.0) / 2.0))


def _widened_below(bench: Bench, low: float) -> list[float]:
    """Return levels of a force of 1.1 to 1.5 of the nominal one, whose range was widened."""
    scale = EFFECTS["force_scale"]
    (size,) = scale.parameters
    above = replace(scale, parameters=(replace(size, low=1.1, high=1.5),))
    below = above.with_range(replace(size, low=low, high=1.5))
    return [level.values[0] for level in levels_of(below, settings_of(bench)[0], 5, 9)]


def test_a_new_level_beside_the_neutral_value_is_left_out(bench: Bench) -> None:
    found = _widened_below(bench, 0.7)
    assert found == pytest.approx([0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4, 1.5])


def test_the_end_of_a_range_stays_beside_the_neutral_value(bench: Bench) -> None:
    found = _widened_below(bench, 0.98)
    assert found == pytest.approx([0.98, 1.04, 1.1, 1.2, 1.3, 1.4, 1.5])
    assert _widened_below(bench, 1.0) == pytest.approx([1.1, 1.2, 1.3, 1.4, 1.5])


def test_a_wider_plane_keeps_its_levels_and_has_as_many_more_as_it_grew_by(bench: Bench) -> None:
    setting = settings_of(bench)[0]
    detent = EFFECTS["detent_force"]
    first = levels_of(detent, setting, 5, 12)
    wider = levels_of(_widened(detent, 0, upper=True), setting, 5, 12)
    assert set(first) < set(wider)
    assert len(set(wider)) == len(wider) == 18
    high = detent.parameters[0].high
    assert max(level.values[0] for level in set(wider) - set(first)) > high
    # Where it is simulated with others lies in what was added.
    assert check_level(("detent_force",), {"detent_force": first}).values == first[1].values
    assert check_level(("detent_force",), {"detent_force": wider}).values[0] > high


def test_levels_that_no_bench_has_are_left_out(bench: Bench) -> None:
    setting = settings_of(bench)[0].with_dog(axial_gap=0.3e-3)
    gaps = [level.values[0] for level in levels_of(EFFECTS["axial_gap"], setting, 5, 9)]
    assert gaps == pytest.approx([-0.28, 0.26, 0.53, 0.8])


def test_what_is_only_read_needs_no_shift(bench: Bench) -> None:
    setting = settings_of(bench)[0]
    read = [name for name, effect in EFFECTS.items() if only_read(effect, setting)]
    assert read == ["actuation_delay", "relative_angle"]
    plan = _plan("actuation_delay", "relative_angle")
    assert plan.shifts(bench) == 2 * 3 * 8


def test_coordinates_meet_in_the_baseline(bench: Bench) -> None:
    setting = settings_of(bench)[0]
    friction = Axes.of(EFFECTS["sleeve_friction"], setting)
    assert friction.neutral == pytest.approx([0.0])
    assert friction.at(np.array([[0.0], [200.0]])).ravel() == pytest.approx([0.0, 1.0])
    stiffness = Axes.of(EFFECTS["contact_stiffness"], setting)
    assert stiffness.at(np.array([[1e11], [2e13]])).ravel() == pytest.approx([0.0, 1.0])
    # A detent of no force is the baseline wherever it stands; a strong one is not.
    detent = Axes.of(EFFECTS["detent_force"], setting)
    none = detent.at(np.array([[0.0, 0.5], [0.0, 4.5]]))
    assert none[1] == pytest.approx(none[0])
    strong = detent.at(np.array([[200.0, 0.5], [200.0, 4.5]]))
    assert np.linalg.norm(strong[1] - strong[0]) == pytest.approx(1.0)


def test_all_levels_share_the_angles_of_their_point(bench: Bench) -> None:
    plan = _plan("moving_mass")
    bank = collect(plan, bench, made_up)
    levels = [b.angles for b in blocks_of(plan, bench)][2:]
    taken = np.take_along_axis(bank.angles, bank.common, axis=1)
    assert np.array(levels) == pytest.approx(np.tile(taken, (5, 1)))
    assert bank.times.shape == (5, 2, 8)
    assert bank.baseline.shape == (2, 24)


def test_too_small_a_plan_is_refused() -> None:
    with pytest.raises(InputError, match="angles of the bank is 2, but must be at least 4"):
        Plan((), angles=2)


def test_a_bank_is_read_back_as_it_was_and_only_for_what_it_is_of(
    tmp_path: Path, bench: Bench
) -> None:
    path, plan = tmp_path / "deep" / "bank.json", _plan("moving_mass", "sleeve_friction")
    late = replace(bench, clutch=replace(bench.clutch, timeout=0.15))
    first = BankStore([path]).bank(plan, late, made_up)
    assert np.isinf(first.times).any()
    again = BankStore([path]).bank(plan, late, _never)
    for name in ("angles", "common"):
        assert np.array_equal(getattr(first, name), getattr(again, name))
    for name in ("baseline", "times"):
        assert getattr(again, name) == pytest.approx(getattr(first, name), abs=TICK)
    assert first.levels == again.levels
    assert first.numerics == pytest.approx(again.numerics)
    with pytest.raises(AssertionError):
        BankStore([path]).bank(plan, bench, _never)


def test_a_bank_takes_what_is_there_and_simulates_the_rest(tmp_path: Path, bench: Bench) -> None:
    path, more = tmp_path / "bank.json", _plan("moving_mass", "sleeve_friction")
    BankStore([path]).bank(_plan("moving_mass"), bench, made_up)
    one = replace(bench, cells=bench.cells[1:])
    fewer = BankStore([path]).bank(_plan("moving_mass"), one, _never)
    assert fewer.times.shape == (5, 1, 8)
    asked: list[Block] = []

    def counted(blocks: Sequence[Block]) -> list[list[Record]]:
        asked.extend(blocks)
        return made_up(blocks)

    mine = tmp_path / "mine.json"
    bank = BankStore([path, mine]).bank(more, bench, counted)
    assert {block.clutch.mechanism.friction > 0.0 for block in asked} == {True}
    assert bank.times == pytest.approx(collect(more, bench, made_up).times, abs=TICK)
    assert BankStore([path, mine]).missing(blocks_of(more, bench)) == []
    assert len(BankStore([mine]).series) == 2 * 5


def test_a_broken_bank_is_named(tmp_path: Path, bench: Bench) -> None:
    path, plan = tmp_path / "bank.json", _plan("moving_mass")
    for text in ("{", "[]", json.dumps({"bank": 1, "series": {"a": 1}})):
        path.write_text(text)
        with pytest.raises(StorageError, match=r"bank\.json is not a bank"):
            BankStore([path]).bank(plan, bench, made_up)
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be written"):
        BankStore([tmp_path / "file" / "bank.json"]).bank(plan, bench, made_up)


def _never(blocks: Sequence[Block]) -> list[list[Record]]:
    raise AssertionError(f"{len(blocks)} blocks are simulated again")


def test_shifts_in_drake_are_simulated_once(tmp_path: Path, clutch: Clutch) -> None:
    """A heavier ring at one point: the journal serves the second bank."""
    bench = replace(few_cells(BENCH, [(50, 469.0)]), clutch=clutch)
    plan = Plan((EFFECTS["moving_mass"],), angles=4, dense=1, levels=2, checks=())
    journal = tmp_path / "shifts.jsonl"
    bank = collect(plan, bench, Executor(ShiftJournal(journal), 1).run)
    lines = journal.read_text().splitlines()
    assert len(lines) == 12 + 4  # and those that are refined
    run: Runner = Executor(ShiftJournal(journal), 1).run
    again: Bank = collect(plan, bench, run)
    assert journal.read_text().splitlines() == lines
    assert np.array_equal(bank.times, again.times)
    light, heavy = bank.times.mean(axis=(1, 2))
    assert heavy > 1.2 * light
    spread = BankEmulator(bank).at(("moving_mass",), np.array([[10.0]]), 0)
    assert abs(spread.times.mean() - heavy) < 2.0 * spread.error[0]


def test_the_bundled_bank_has_every_series_of_the_compiled_engine(tmp_path: Path) -> None:
    quick = with_bank_engine(BENCH, EFFECTS, Means(tmp_path))
    assert quick.clutch == BENCH.clutch.with_engine("planar")
    store = BankStore((brought(TIMES), tmp_path / TIMES))
    assert store.missing(blocks_by_key(plans_of(quick, EFFECTS)).values()) == []
    assert with_bank_engine(quick, EFFECTS, Means(tmp_path)) == quick


@pytest.mark.parametrize("name", ["stand", "adams"])
def test_the_bundled_bank_has_the_ranges_that_published_answers_were_widened_to(
    tmp_path: Path, name: str
) -> None:
    kept = Path(__file__).parents[2] / "docs" / "evidence" / f"gap_{name}.json"
    ends, effects = json.loads(kept.read_text(encoding="utf-8"))["range_ends"], dict(EFFECTS)
    assert bool(ends) == (name == "stand")
    for end in (one for one in ends if one["remedy"] == "widened"):
        effect, moved = effects[end["effect"]], "high" if end["upper"] else "low"
        (now,) = (p for p in effect.parameters if p.name == end["parameter"])
        effects[end["effect"]] = effect.with_range(replace(now, **{moved: end["moved"]}))
    bench = with_bank_engine(load_bench(f"mq200_{name}"), effects, Means(tmp_path))
    assert bench.clutch.solver.engine == "planar"
    store = BankStore((brought(TIMES), tmp_path / TIMES))
    assert store.missing(blocks_by_key(plans_of(bench, effects)).values()) == []


def test_the_compiled_engine_simulates_what_no_bank_has(bench: Bench, tmp_path: Path) -> None:
    unseen = replace(bench, clutch=replace(bench.clutch, timeout=1.1))
    few = {"actuation_delay": EFFECTS["actuation_delay"]}
    quick = with_bank_engine(unseen, few, Means(tmp_path))
    assert quick.clutch == unseen.clutch.with_engine("planar")
    assert quick.cells == unseen.cells
    asked = with_bank_engine(unseen, few, Means(tmp_path, engine="drake"))
    assert asked.clutch == unseen.clutch


def test_a_bank_of_drake_that_is_there_is_used(bench: Bench, tmp_path: Path) -> None:
    unseen = replace(bench, clutch=replace(bench.clutch, timeout=1.1))
    few = {"actuation_delay": EFFECTS["actuation_delay"]}
    store = BankStore((tmp_path / TIMES,))
    for plan in plans_of(unseen, few):
        store.bank(*plan, made_up)
    assert with_bank_engine(unseen, few, Means(tmp_path)).clutch == unseen.clutch


def test_an_effect_of_ones_own_keeps_the_engine_of_the_bank(tmp_path: Path) -> None:
    """Else the answer would move for another reason than the effect."""
    own = replace(EFFECTS["sleeve_friction"], name="cold_oil", change=_slower)
    more = {**EFFECTS, "cold_oil": own}
    store = BankStore((brought(TIMES), tmp_path / TIMES))
    quick = replace(BENCH, clutch=BENCH.clutch.with_engine("planar"))
    assert store.missing(blocks_by_key(plans_of(quick, more)).values())
    assert with_bank_engine(BENCH, more, Means(tmp_path)).clutch == quick.clutch


def _slower(setting: Setting, values: Mapping[str, float]) -> Setting:
    return setting.with_mechanism(damping=3.0 * values["friction_N"])


def test_an_engine_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'mujoco', which is not an engine; valid are drake, pla"):
        with_bank_engine(BENCH, EFFECTS, Means(tmp_path, engine="mujoco"))
