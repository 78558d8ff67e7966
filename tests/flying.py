"""Benches whose traces come from simulated shifts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.diagnosis.bench.traces import BenchTrace
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
    """Return some operating points of the published bench, with the scheme that is exact in flight.

    It knows one coefficient of contact friction, which no flight meets.
    """
    every = settings_of(load_bench("mq200_adams"), "sleeve")
    return tuple(
        replace(setting, clutch=replace(setting.clutch, solver=Solver()))
        for setting in every
        if round(setting.point.mismatch / RPM, 6) in MISMATCHES
    )


def sampled(
    trace: Trace, setting: Setting, step: float, noise: float, rng: np.random.Generator
) -> BenchTrace:
    """Return a simulated trace as a bench samples it every ``step`` s, with scatter.

    ``noise`` is a factor of that of the sensors. Before the setting's delay nothing moves.
    """
    end = float(trace.time[-1]) + setting.delay
    time = np.arange(0.0, end + 2.0 * step, step)
    way = trace.actuator_displacement if setting.sensor == "actuator" else trace.displacement
    series = (way, trace.shift_force, trace.sliding_speed, trace.output_speed)
    found = [np.interp(time - setting.delay, trace.time, one) for one in series]
    found[1] = setting.point.profile.at(np.maximum(time - setting.delay, 0.0))
    found[0] = found[0] + noise * NOISE["way"] * rng.standard_normal(time.size)
    found[1] = found[1] + noise * NOISE["force"] * rng.standard_normal(time.size)
    return BenchTrace(Path(), time, *found)


def flying_bench(name: str | None, values: Mapping[str, float], *, shifts: int = 2) -> Bench:
    """Return a bench with an effect whose shifts are simulated, each with its trace."""
    rng = np.random.default_rng(1)
    readings = []
    for plain in settings():
        setting = EFFECTS[name].apply(plain, values) if name else plain
        plant = ClutchPlant(setting.clutch)
        for angle in rng.uniform(0.0, setting.clutch.dog.pitch_angle, shifts):
            shift = engage(plant, setting.point, float(angle))
            trace = sampled(shift.trace, setting, 1e-3, 1.0, rng)
            time = None if shift.shift_time is None else shift.shift_time + setting.delay
            row = len(readings) + 2
            readings.append(Reading(row, plain.point, 1, time, time is not None, trace))
    bench = load_bench("mq200_adams")
    return replace(bench, name="flying", cells=gather(readings), relative_angles=None)
