"""The emulator of the bank against dense simulation at values that the bank does not hold.

    python -m benchmarks.bank [SHIFTS.jsonl]

Three operating points of the published model, five effects. Each effect is simulated at values
between its levels, at angles of another draw; the table has both means without late shifts
(``diagnosis.prediction.outliers``) with their errors, in ms, and how many joint errors they lie
apart. Then what pairs differ by from their combination, with changes of the time added (w = 1) and
with changes of its logarithm (w = 0), and the w that the emulator takes
(``diagnosis.prediction.combination``). Some 2000 shifts, a few minutes on an idle machine; finished
ones are kept in the file.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.angle_means import engaged_mean, even_variance, residuals
from dogshape.diagnosis.prediction.bank import Bank, Plan, collect, settings_of, times_of
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.levels import Level, check_level
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.effects import load
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM

POINTS = [(10, 235.2), (50, 469.0), (249, 641.5)]
NAMES = (
    "actuation_lag",
    "contact_friction",
    "linkage_compliance",
    "moving_mass",
    "sleeve_friction",
)
CHECKS = (
    ("actuation_lag", "moving_mass"),
    ("actuation_lag", "sleeve_friction"),
    ("linkage_compliance", "moving_mass"),
    ("moving_mass", "sleeve_friction"),
)
ANGLES, LEVELS, PLANE = 12, 4, 7
DENSE, SEED = 24, 2  #: angles of the truth, and their draw
SHARES = (0.5, 0.85)  #: of the prior, held out; of two parameters the second at 0.8 of it


def main() -> None:
    """Print the comparison."""
    if len(sys.argv) > 1:
        executor = Executor(ShiftJournal(Path(sys.argv[1])), 1)
    else:
        executor = scratch_executor(1)
    bench, effects = _bench(), load()
    plan = Plan(
        tuple(effects[name] for name in NAMES), ANGLES, levels=LEVELS, plane=PLANE, checks=CHECKS
    )
    bank = collect(plan, bench, executor.run)
    emulator = BankEmulator(bank)
    print(f"{plan.shifts(bench)} shifts at {len(bench.cells)} operating points")
    print("effect              share  1/min   simulated       emulated        apart")
    scores = [
        score
        for name in NAMES
        for share in SHARES
        for score in _held_out(emulator, bench, executor, name, share)
    ]
    beyond = np.mean(np.abs(scores) > 2.0)
    print(f"root mean square {np.sqrt(np.mean(np.square(scores))):.2f}, {beyond:.0%} beyond two")
    _pairs(bank)
    for pair, blend in emulator.combination.interactions.pairs.items():
        print(f"{' + '.join(pair):38s} w {blend.share.mean():5.2f} +- {blend.error:.2f}")


def _bench() -> Bench:
    bench = load_bench("mq200_adams")
    known = {(round(c.point.mismatch / RPM), c.point.profile.force): c for c in bench.cells}
    return replace(bench, cells=tuple(known[point] for point in POINTS))


def _held_out(
    emulator: BankEmulator, bench: Bench, executor: Executor, name: str, share: float
) -> list[float]:
    """Print and return by how many errors emulated means lie apart from simulated ones."""
    effect = emulator.effects[name]
    shares = (share, 0.8 * share)
    values = tuple(p.at(s) for p, s in zip(effect.parameters, shares, strict=False))
    settings = [
        Level((name,), values).setting(emulator.effects, setting) for setting in settings_of(bench)
    ]
    draws = [(SEED, cell) for cell in range(len(settings))]
    blocks = [
        even_block(s.clutch, s.point, DENSE, draw) for s, draw in zip(settings, draws, strict=True)
    ]
    scores = []
    for cell, rows in enumerate(executor.run(blocks)):
        times = bulk(times_of(settings[cell], rows))
        mean = float(engaged_mean(times))
        error = mean * float(np.sqrt(even_variance(residuals(times))))
        spread = emulator.at((name,), np.array([values]), cell)
        found, own = float(spread.times.mean()), float(spread.error[0])
        scores.append((found - mean) / float(np.hypot(error, own)))
        print(
            f"{name:20s} {share:.2f}  {POINTS[cell][0]:5d}  {mean * 1e3:6.1f} +- "
            f"{error * 1e3:4.1f}  {found * 1e3:6.1f} +- {own * 1e3:4.1f}  {scores[-1]:6.2f}"
        )
    return scores


def _pairs(bank: Bank) -> None:
    """Print by how much pairs differ from sums of changes, of times and of logarithms."""
    print("pair                                  1/min  changes of time     missed: time, log")
    own = {name: [bank.levels[k] for k in bank.of((name,))] for name in NAMES}
    base = engaged_mean(bulk(bank.base))
    for pair in CHECKS:
        both = engaged_mean(bulk(bank.times[bank.of(pair)[0]]))
        chosen = [check_level((name,), own) for name in pair]
        one, two = (engaged_mean(bulk(bank.times[bank.levels.index(k)])) for k in chosen)
        for cell, (mismatch, _) in enumerate(POINTS):
            changes = one[cell] / base[cell] - 1.0, two[cell] / base[cell] - 1.0
            added = (one + two - base)[cell] / both[cell] - 1.0
            product = (one * two / base)[cell] / both[cell] - 1.0
            print(
                f"{' + '.join(pair):38s} {mismatch:4d}  {changes[0]:+8.1%} {changes[1]:+8.1%}"
                f"  {added:+8.1%} {product:+8.1%}"
            )


if __name__ == "__main__":
    main()
