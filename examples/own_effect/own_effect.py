"""Simulate shifts with an effect of one's own, which is one file in a folder.

    python examples/own_effect/own_effect.py

The diagnosis takes the same folder:
``dogshape diagnose BENCH_DIR --effects examples/own_effect/effects``.
"""

from __future__ import annotations

from pathlib import Path

import dogshape as ds
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import run_block

EFFECTS = Path(__file__).parent / "effects"


def main(count: int = 8) -> dict[float, float]:
    """Simulate ``count`` relative angles with each damping; give mean shift times, s."""
    config = ds.Study("mq200").config
    cold_oil = load(EFFECTS)["cold_oil"]
    point = next(p for p in config.points if p.profile.force > 400 and p.mismatch > 5)
    nominal = Setting(config.clutch, point)
    angles = [config.clutch.dog.pitch_angle * (k + 0.5) / count for k in range(count)]
    means = {}
    for damping in (0.0, 1000.0, 3000.0):
        setting = cold_oil.apply(nominal, {"damping_Ns_m": damping})
        times = [setting.time_of(row) for row in run_block(setting.block(angles))]
        engaged = [time for time in times if time is not None]
        means[damping] = sum(engaged) / len(engaged)
        print(f"{damping:6.0f} N s/m: {means[damping] * 1e3:6.1f} ms, {len(engaged)} engaged")
    return means


if __name__ == "__main__":
    main()
