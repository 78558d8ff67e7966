"""The reversed sense: its simulations, prior and answers; interpolation between levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.stand_file import Sense
from dogshape.diagnosis.diagnosis import Inference, diagnose
from dogshape.diagnosis.inference.ranking import hypotheses_of, log_prior
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.prediction.model import CELL_ERROR, Model
from dogshape.diagnosis.prediction.simulations import Level, simulate_benches
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, REVERSED, reverse_sense, strip_sense
from dogshape.sim.effect import BenchTest, Effect, Values
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record
from tests.analytic import RECORD, mean_time, select_cells, simulate_analytic
from tests.diagnoses import simulated_bench

EFFECTS = load()
NAMES = ("actuation_delay", "moving_mass", "relative_angle", REVERSED, "sleeve_friction")
SOME = {name: EFFECTS[name] for name in NAMES}
CELLS = [(5, 235.2), (50, 469.0), (249, 641.5)]
PLAIN = np.zeros((1, 0))


def _back(slip: float) -> float:
    """Give the factor of the time with the braking flanks, by the mismatch in 1/min."""
    return 1.0 + 0.6 / (1.0 + slip / 20.0)


def _signed(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks of closed form, in which a negative mismatch throws dogs back."""
    found = []
    for block, rows in zip(blocks, simulate_analytic(blocks), strict=True):
        slip = block.point.mismatch * 30.0 / np.pi
        factor = _back(-slip) if slip < 0.0 else 1.0
        found.append(
            [
                {**row, "shift_time_s": None if row["shift_time_s"] is None
                 else factor * row["shift_time_s"]}
                for row in rows
            ]
        )  # fmt: skip
    return found


def _with_sense(bench: Bench, sense: Sense) -> Bench:
    return replace(bench, record=RECORD.model_copy(update={"sense": sense}))


def _model(sense: Sense, run: object = _signed) -> Model:
    bench = _with_sense(select_cells(load_bench("mq200_adams"), CELLS), sense)
    (found,) = build_models(bench, SOME, USUAL, run).values()  # type: ignore[arg-type]
    return found


def test_the_reversed_simulations_are_those_of_the_negated_points() -> None:
    asked: list[Sequence[Block]] = []

    def noted(blocks: Sequence[Block]) -> list[list[Record]]:
        asked.append(blocks)
        return _signed(blocks)

    model = _model("unknown", noted)
    # The reversed sense comes first; further calls bisect steps of its baseline, then of the other.
    is_reversed = [block.point.mismatch < 0.0 for blocks in asked for block in blocks]
    assert is_reversed == sorted(is_reversed, reverse=True)
    assert set(is_reversed) == {True, False}
    assert model.reversed_model is not None
    assert REVERSED not in model.effects
    assert set(model.reversed_model.effects) == set(model.effects)
    base, back = model.predict(NONE, PLAIN), model.predict((REVERSED,), PLAIN)
    # At 5 1/min some shifts reach the time-out with the braking flanks alone.
    factors = [_back(slip) for slip, _ in CELLS[1:]]
    assert (back.mean / base.mean)[0, 1:] == pytest.approx(factors, rel=0.03)


def test_hypotheses_of_both_senses_and_their_priors() -> None:
    known, unknown = _model("known"), _model("unknown")
    for model, share in ((known, USUAL.reversed_known), (unknown, USUAL.reversed_unknown)):
        every = [h for size in (0, 1, 2) for h in hypotheses_of(model, size)]
        logs = {h: log_prior(h, model, USUAL, share) for h in every}
        assert {strip_sense(h) for h in every if REVERSED in h} <= set(every)
        for h in (NONE, ("actuation_delay",)):
            odds = logs[reverse_sense(h)] - logs[h]
            assert odds == pytest.approx(np.log(share / (1.0 - share)))
    assert reverse_sense(("moving_mass",)) not in hypotheses_of(known, 1)
    assert reverse_sense(("moving_mass",)) in hypotheses_of(unknown, 1)


def _found(cause: Mapping[str, Mapping[str, float]], sense: Sense, *, other: bool) -> Inference:
    bench = _with_sense(simulated_bench(cause), sense)
    if other:
        cells = []
        for cell in bench.cells:
            factor = _back(cell.point.mismatch * 30.0 / np.pi)
            rows = tuple(replace(r, time=(r.time or 0.0) * factor) for r in cell.readings)
            cells.append(replace(cell, readings=rows))
        bench = replace(bench, cells=tuple(cells))
    names = ("actuation_delay", "force_scale", "mismatch_speed", "moving_mass", REVERSED)
    effects = {name: EFFECTS[name] for name in names}
    return diagnose(bench, build_models(bench, effects, USUAL, _signed))


@pytest.mark.parametrize("sense", ["known", "unknown"])
def test_a_reversed_sense_is_named_and_has_no_sizes(sense: Sense) -> None:
    found = _found({}, sense, other=True)
    assert found.leading == (REVERSED,)
    assert found.inclusion[REVERSED] > 0.5
    record = found.to_dict()
    (first,) = [h for h in record["hypotheses"] if h["effects"] == [REVERSED]]
    assert first["parameters"] == {}
    assert not record["sizes"].get(REVERSED)


def test_an_unknown_sense_has_an_answer_for_either() -> None:
    found = _found({"moving_mass": {"added_mass_kg": 3.0}}, "unknown", other=True)
    assert found.leading == ("moving_mass", REVERSED)
    readings = {one.value: one for one in found.record_meanings if one.key == "sense"}
    assert set(readings) == {"as_noted", "reversed"}
    assert sum(one.probability for one in readings.values()) == pytest.approx(1.0)
    assert readings["reversed"].probability > 0.9
    mass = found.fits[found.leading].intervals["added_mass_kg"]
    assert mass.mean == pytest.approx(3.0, rel=0.3)
    known = _found({"moving_mass": {"added_mass_kg": 3.0}}, "known", other=False)
    assert not [one for one in known.record_meanings if one.key == "sense"]


def _heavier(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(added_mass=2.0)


HEAVIER = Effect("heavier", (), _heavier, BenchTest("look", "Look at it."))


def test_an_effect_without_parameters_has_one_level() -> None:
    """One of the user's own is there or not: its only level is simulated, and a delay adds."""
    bench = _with_sense(select_cells(load_bench("mq200_adams"), CELLS), "known")
    effects = {"heavier": HEAVIER, **{n: EFFECTS[n] for n in ("actuation_delay",)}}
    (model,) = build_models(bench, effects, USUAL, simulate_analytic).values()
    (place,) = model.baseline.simulated.level_indices(("heavier",))
    assert model.baseline.simulated.levels[place].values == ()
    alone = model.predict(("heavier",), np.zeros((3, 0)))
    assert alone.mean.shape == (3, len(CELLS))
    for cell, setting in enumerate(model.settings):
        with_it = _heavier(setting, {})
        true = mean_time(with_it.clutch, with_it.point)
        assert abs(alone.mean[0, cell] - true) < 4.0 * alone.error[0, cell]
    space = model.space(("actuation_delay", "heavier"))
    late = model.predict(space.hypothesis, np.array([[0.5]]))
    delay = space.values(np.array([[0.5]]))[0, 0]
    assert late.mean[0] == pytest.approx(alone.mean[0] + delay)


def _run(blocks: list[Block]) -> list[list[Record]]:
    return [list(run_block(block)) for block in blocks]


@pytest.mark.parametrize("name", ["sleeve_friction", "force_scale"])
def test_errors_of_an_interpolation_are_its_stated_ones(name: str) -> None:
    """Friction holds the ring at the end of its range, where the time is infinite.

    The means at all angles scatter too.
    """
    bench = load_bench("mq200_adams")
    bench = replace(bench, clutch=bench.clutch.with_engine("planar"), cells=bench.cells[1:28:9])
    (model,) = build_models(bench, {name: load(None)[name]}, USUAL, _run).values()
    shares = np.linspace(0.02, 0.98, 17)[:, None]
    values = model.space((name,)).values(shares)
    levels = [Level((name,), tuple(row)) for row in values.tolist()]
    benches = [[level.setting(model.effects, one) for one in model.settings] for level in levels]
    times = simulate_benches(benches, model.baseline.simulated, _run)
    exact = (model.baseline.moments_of(times) - model.baseline.moments)[..., 0]
    found, p = model.changes(name, values), model.predict((name,), shares)
    scatter = CELL_ERROR * p.sd / (p.mean - p.delay)
    known = np.isfinite(exact)
    scores = ((found.moments[..., 0] - exact) / np.hypot(found.error, scatter))[known]
    assert np.sqrt((scores**2).mean()) < 1.3
    assert abs(scores).max() < 4.0
