"""Benches whose traces come from simulated shifts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.bench.traces import BenchTrace
from dogshape.diagnosis.prediction.simulations import settings_of
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import Solver
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Trace
from dogshape.sim.units import RPM

EFFECTS = load()
MISMATCHES = (25.0, 149.0)
NOISE = {"way": 1e-5, "force": 1.5}  #: m and N, scatter of the sensors


def settings() -> tuple[Setting, ...]:
    """Return operating points of the published bench, with a scheme that is exact in flight.

    It knows one coefficient of contact friction, which no flight meets.
    """
    all_settings = settings_of(load_bench("mq200_adams"), "sleeve")
    return tuple(
        replace(setting, clutch=replace(setting.clutch, solver=Solver()))
        for setting in all_settings
        if round(setting.point.mismatch / RPM, 6) in MISMATCHES
    )


def sample_trace(
    trace: Trace, setting: Setting, step: float, noise: float, rng: np.random.Generator
) -> BenchTrace:
    """Sample a simulated trace as a bench does, every ``step`` s, with scatter.

    ``noise`` is a factor of that of the sensors. Before the setting's delay nothing moves.
    """
    end = float(trace.time[-1]) + setting.delay
    time = np.arange(0.0, end + 2.0 * step, step)
    displacement = (
        trace.actuator_displacement if setting.sensor == "actuator" else trace.displacement
    )
    series = (displacement, trace.shift_force, trace.sliding_speed, trace.output_speed)
    channels = [np.interp(time - setting.delay, trace.time, values) for values in series]
    channels[1] = setting.point.profile.at(np.maximum(time - setting.delay, 0.0))
    channels[0] = channels[0] + noise * NOISE["way"] * rng.standard_normal(time.size)
    channels[1] = channels[1] + noise * NOISE["force"] * rng.standard_normal(time.size)
    return BenchTrace(Path(), time, *channels)


def trace_bench(name: str | None, values: Mapping[str, float], *, shifts: int = 2) -> Bench:
    """Simulate a bench with an effect, each shift with its trace."""
    rng = np.random.default_rng(1)
    readings = []
    for nominal in settings():
        setting = EFFECTS[name].apply(nominal, values) if name else nominal
        plant = ClutchPlant(setting.clutch)
        for angle in rng.uniform(0.0, setting.clutch.dog.pitch_angle, shifts):
            shift = engage(plant, setting.point, float(angle))
            trace = sample_trace(shift.trace, setting, 1e-3, 1.0, rng)
            time = None if shift.shift_time is None else shift.shift_time + setting.delay
            row = len(readings) + 2
            readings.append(Reading(row, nominal.point, 1, time, time is not None, trace))
    bench = load_bench("mq200_adams")
    return replace(bench, name="flying", cells=gather(readings), relative_angles=None)
