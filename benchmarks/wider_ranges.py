"""Measure what the emulator misses in a widened range, with levels kept and with all spaced anew.

    python -m benchmarks.wider_ranges [--bench NAME] [--draws N] [--seed N]

Each effect whose range can be widened at its upper end, once and twice as a diagnosis does it.
At random values of the wider prior, from 0.3 of it on, the emulator's means are held against 48
shifts simulated directly, in the engine of the bank (``benchmarks/joint_levels``): by levels that
were there before with new ones beyond them, and by the usual number spread over the wider range.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.joint_levels import EFFECTS, LEAST, NAMES, missed
from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.inference.range_ends import RangeEnd, widened
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.diagnose.bank_diagnosis import Means, bank_of, with_bank_engine
from dogshape.sim.effect import Effect
from dogshape.sim.setting import Setting

WAYS = "kept and beyond", "spaced anew"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bench", default="mq200_adams")
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    means, generator = Means(jobs=1), np.random.default_rng(given.seed)
    bench = with_bank_engine(load_bench(given.bench), EFFECTS, means)
    setting = bank_of(bench, {}, means).settings[0]
    print(f"{bench.name}: {len(bench.cells)} operating points, root mean square over {given.draws}")
    print("draws of each effect: missed of the mean time, and of the stated error")
    print(f"{'effect':22s}{'widened':>10s}{'':4s}" + "".join(f"{way:>26s}" for way in WAYS))
    every: dict[int, list[Array]] = {}
    for name in NAMES:
        for times, effect in enumerate(_wider(EFFECTS[name], setting), 1):
            levels = [_drawn(effect, setting, generator) for _ in range(given.draws)]
            rows = [
                [missed(emulator, level) for level in levels]
                for emulator in (_emulator(bench, one, means) for one in _ways(effect))
            ]
            # Of a draw with which nothing engages there is no mean time.
            found = np.sqrt(np.nanmean(np.square(rows), axis=1))
            every.setdefault(times, []).append(found)
            print(f"{name:22s}{_often(times):>10s}{'':4s}{_row(found)}", flush=True)
    for times, rows_of in every.items():
        middle = np.median(rows_of, axis=0)
        print(f"{f'median of {len(rows_of)}':22s}{_often(times):>10s}{'':4s}{_row(middle)}")


def _often(times: int) -> str:
    return ("once", "twice")[times - 1]


def _row(found: Array) -> str:
    return "".join(f"{100 * share:17.1f} % {error:6.2f}" for share, error in found)


def _wider(effect: Effect, setting: Setting) -> Iterator[Effect]:
    """Yield an effect with its first parameter's range widened upwards, once and twice."""
    for _ in range(USUAL.decision.widenings):
        end = RangeEnd(effect.name, effect.parameters[0], upper=True, probability=1.0)
        every, (told,) = widened({effect.name: effect}, (end,), setting, USUAL.decision.wider)
        if told.remedy != "widened":
            return
        effect = every[effect.name]
        yield effect


def _ways(effect: Effect) -> tuple[Effect, Effect]:
    return effect, replace(effect, before=None)


def _emulator(bench: Bench, effect: Effect, means: Means) -> BankEmulator:
    return BankEmulator(bank_of(bench, {effect.name: effect}, means))


def _drawn(effect: Effect, setting: Setting, generator: np.random.Generator) -> Level:
    """Draw values of an effect's wider prior of which there is a bench."""
    names = [p.name for p in effect.parameters]
    while True:
        shares = generator.uniform(LEAST, 1.0, len(names)).tolist()
        values = tuple(p.at(s) for p, s in zip(effect.parameters, shares, strict=True))
        if effect.possible(setting, dict(zip(names, values, strict=True))):
            return Level((effect.name,), values)


if __name__ == "__main__":
    main()
