"""Models of a data set, with the simulations of its baseline and levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.prediction.baseline import Baseline
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.readings import reading_effects_of
from dogshape.diagnosis.prediction.simulations import (
    settings_of,
    simulate,
    widen_ranges,
)
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import DELAY, REVERSED
from dogshape.sim.effect import Effect
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.statistics.blocks import Runner


def build_models(
    bench: Bench, effects: Mapping[str, Effect], settings: Settings, runner: Runner
) -> dict[str, Model]:
    """Build the models of a data set, by the place where the displacement may be read."""
    place = bench.record.displacement_at
    if place == "unknown":
        sensors: tuple[Sensor, ...] = ("sleeve", "actuator")
        return {
            sensor: _build_model(bench, effects, settings, runner, sensor=sensor)
            for sensor in sensors
        }
    return {place: _build_model(bench, effects, settings, runner, sensor=place)}


def _build_model(
    bench: Bench,
    effects: Mapping[str, Effect],
    settings: Settings,
    runner: Runner,
    *,
    sensor: Sensor,
) -> Model:
    """Build the model of a data set with the displacement read by a sensor."""
    baseline = settings_of(bench, sensor)
    wide_effects = {
        name: widen_ranges(effect, baseline[0], settings.range_extension)
        for name, effect in effects.items()
    }
    measured = {result.effect for result in bench.measured}
    nuisances = {}
    for name in settings.nuisance:
        if name in wide_effects and name not in measured:
            nuisances[name] = wide_effects.pop(name)
    reversed_model = None
    if wide_effects.pop(REVERSED, None) is not None:
        is_known = bench.record.sense == "known"
        reversed_model = _build_reversed(
            wide_effects, baseline, settings, runner, only_reading=is_known
        )
    simulated = simulate({**wide_effects, **nuisances}, baseline, runner)
    if bench.record.time_zero == "force":
        wide_effects.pop(DELAY, None)
    return Model(
        effects=wide_effects,
        baseline=Baseline(simulated, settings),
        nuisances=nuisances,
        reading_effects=reading_effects_of(wide_effects, baseline),
        constants=settings,
        reversed_model=reversed_model,
        runner=runner,
    )


def _build_reversed(
    effects: Mapping[str, Effect],
    baseline: Sequence[Setting],
    settings: Settings,
    runner: Runner,
    *,
    only_reading: bool,
) -> Model:
    """Build the model of the reversed sense of rotation.

    ``only_reading`` keeps the effects that change the reading alone.
    """
    reversed_effects = dict(effects)
    if only_reading:
        reversed_effects = {name: effects[name] for name in reading_effects_of(effects, baseline)}
    reversed_settings = [s.with_point(mismatch=0.0 - s.point.mismatch) for s in baseline]
    return Model(
        effects=reversed_effects,
        baseline=Baseline(simulate(reversed_effects, reversed_settings, runner), settings),
        nuisances={},
        reading_effects=reading_effects_of(reversed_effects, reversed_settings),
        constants=settings,
        runner=runner,
    )
