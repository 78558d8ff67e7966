"""Models of a data set, with the simulations of its baseline and levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dogshape.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.prediction.approaches import Approaches
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
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Sensor, Setting
from dogshape.sim.statistics.blocks import Runner

PROBE_SHARES = (0.2, 0.4, 0.6, 0.8)  #: of the parameters' ranges, at which an effect is tried


def untried_effects(bench: Bench, effects: Mapping[str, Effect]) -> dict[str, str]:
    """Name the effects that the actuator of a stand has no use for, each with the reason."""
    reasons = {name: _reason(effect, setting_of(bench)) for name, effect in effects.items()}
    return {name: reason for name, reason in reasons.items() if reason}


def _reason(effect: Effect, setting: Setting) -> str:
    """Give the reason why an actuator refuses an effect; empty for one that acts or without one."""
    actuator = setting.clutch.actuator
    if actuator is None:
        return ""
    reason = ""
    for share in PROBE_SHARES:
        values = {parameter.name: parameter.at(share) for parameter in effect.parameters}
        try:
            profile = effect.apply(setting, values).point.profile
            actuator.require_course(profile.lag, profile.rise / setting.point.profile.rise)
        except InputError as error:
            reason = error.refusal.rule if error.refusal else str(error)
        else:
            return ""
    return reason


def build_models(
    bench: Bench, effects: Mapping[str, Effect], settings: Settings, runner: Runner
) -> dict[str, Model]:
    """Build the models of a data set, by the place where the displacement may be read.

    Effects that the actuator of the stand has no use for are left out.
    """
    untried = untried_effects(bench, effects)
    effects = {name: effect for name, effect in effects.items() if name not in untried}
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
        approaches=Approaches(wide_effects, baseline),
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
        approaches=Approaches(reversed_effects, reversed_settings),
        constants=settings,
        runner=runner,
    )
