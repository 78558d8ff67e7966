"""Measure what the emulator misses of effects together, and what joint levels mend.

    python -m benchmarks.joint_levels [--clutch DIR] [--pairs N] [--seed N]

Pairs of effects at random values of their priors, on a clutch whose bank has each effect alone.
Each is simulated directly at 48 relative angles of each operating point, in the engine of the bank,
so that no engine's difference counts. Beside it the emulator's mean as it is combined from effects
alone, and with joint levels drawn about the values, as many as a first round of a diagnosis has, by
a normal of 0.15 of each prior. Missed are root mean squares over the operating points, of the mean
time without any effect, and over the error that the emulator states; bulk without outliers.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.angle_profiles import AngleProfiles
from dogshape.diagnosis.prediction.bank import Bank, times_at, times_of
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.levels import Level, columns_of
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.prediction.sense_bank import forward_plan
from dogshape.diagnosis.prediction.touch_phases import TouchPhases
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.diagnose.bank_diagnosis import Means, bank_of, with_bank_engine
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.shift_records import Record

ANGLES = 48  #: of what is simulated directly
ABOUT = 0.15  #: of each prior, standard deviation of joint levels about the values
LEAST = 0.3  #: least share of a prior
LITTLE = 0.2  #: below which both correlations are alike, and not shown
READ = "relative_angle"
EFFECTS = load(None)
NAMES = tuple(n for n, e in EFFECTS.items() if e.parameters and n not in ("actuation_delay", READ))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", type=Path, default=bundled_root() / "blind" / "hub")
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    means = Means(jobs=1)
    bench = with_bank_engine(load_bench(given.clutch), EFFECTS, means)
    bank = bank_of(bench, EFFECTS, means)
    emulator, generator = BankEmulator(bank), np.random.default_rng(given.seed)
    every = list(combinations(NAMES, 2))
    drawn = [every[k] for k in generator.permutation(len(every))[: given.pairs]]
    angled = [(name,) for name in generator.permutation(NAMES).tolist()]
    rows: dict[str, list[Array]] = {}
    for acting in drawn:
        level = _drawn(bank, acting, generator)
        joint = _about(bank, level, generator)
        known = emulator.with_levels(joint, _times(bank, joint))
        rows.setdefault("pairs, from each alone", []).append(missed(emulator, level))
        rows.setdefault("the same, with joint levels", []).append(missed(known, level))
    for acting in angled:
        level = _drawn(bank, (*acting, READ), generator)
        rows.setdefault("one with uneven angles", []).append(missed(emulator, level))
        alone = Level(acting, level.values[: len(EFFECTS[acting[0]].parameters)])
        rows.setdefault("that one alone", []).append(missed(emulator, alone))
    print(f"{bench.name}: {len(bank.settings)} operating points, median (largest) over draws")
    print("                              draws   of the mean time   of the stated error")
    for name, found in rows.items():
        share, error = (np.array(found)[:, k] for k in range(2))
        print(
            f"{name:28s} {len(found):6d} {100 * np.median(share):8.1f} % ({100 * share.max():5.1f})"
            f" {np.median(error):10.2f} ({error.max():5.2f})"
        )
    _likeness(emulator)


def _likeness(emulator: BankEmulator) -> None:
    """Print how like times of levels are to the baseline's, angle by angle."""
    print("correlation with the baseline's times, median over levels and operating points")
    print("                         at the first touch   at the start of the force")
    ways = emulator.profiles, _at_start(emulator)
    for name in NAMES:
        levels = emulator.bank.of((name,))
        touch, start = (_correlations(one, levels) for one in ways)
        if np.abs(touch - start).max() > LITTLE:
            print(f"{name:24s} {np.median(touch):18.2f} {np.median(start):27.2f}")


def _at_start(emulator: BankEmulator) -> AngleProfiles:
    """Lay times over the angle at the start of the force, as if rings did not turn."""
    return AngleProfiles(emulator.bank, _Still(EFFECTS, emulator.bank.settings))


class _Still(TouchPhases):
    """Phases of rings that do not turn until the first touch."""

    def of(self, setting: Setting) -> float:
        """Return no phase."""
        return 0.0

    def at(self, parts: Mapping[str, Array], count: int) -> Array:
        """Return no phases, (C, m)."""
        return np.zeros((len(self.settings), count))


def _correlations(laid: AngleProfiles, levels: Sequence[int]) -> Array:
    base, mine = laid.base.logs[:, 0], laid.of(levels).logs
    return np.array(
        [
            np.corrcoef(base[cell], row)[0, 1]
            for cell in range(len(base))
            for row in mine[cell]
            if np.ptp(row) > 0.0
        ]
    )


def _drawn(bank: Bank, names: Sequence[str], generator: np.random.Generator) -> Level:
    """Draw values of effects of which there is a bench."""
    parameters = [p for name in names for p in EFFECTS[name].parameters]
    while True:
        shares = generator.uniform(LEAST, 1.0, len(parameters)).tolist()
        values = tuple(p.at(s) for p, s in zip(parameters, shares, strict=True))
        level = Level(tuple(names), values)
        if _possible(bank, level):
            return level


def _about(bank: Bank, level: Level, generator: np.random.Generator) -> list[Level]:
    """Draw joint levels about values, those of which there is a bench."""
    parameters = [p for name in level.hypothesis for p in EFFECTS[name].parameters]
    middle = np.array([p.share(v) for p, v in zip(parameters, level.values, strict=True)])
    off = ABOUT * generator.standard_normal((USUAL.decision.together, len(parameters)))
    every = [
        Level(
            level.hypothesis,
            tuple(p.at(s) for p, s in zip(parameters, row, strict=True)),
        )
        for row in np.clip(middle + off, 0.0, 1.0).tolist()
    ]
    return [one for one in every if _possible(bank, one)]


def _possible(bank: Bank, level: Level) -> bool:
    try:
        level.setting(EFFECTS, bank.settings[0])
    except DogshapeError:
        return False
    return True


def _times(bank: Bank, levels: Sequence[Level]) -> Array:
    return times_at(forward_plan(EFFECTS), bank.settings, levels, _run)


def _run(blocks: Sequence[Block]) -> list[list[Record]]:
    return [list(run_block(block)) for block in blocks]


def missed(emulator: BankEmulator, level: Level) -> Array:
    """Compare emulated means with direct shifts: misses over plain mean time and stated error."""
    hypothesis = tuple(sorted(level.hypothesis))
    values = np.array([_in_order(level, hypothesis)])
    shares, scores = [], []
    for cell, setting in enumerate(emulator.bank.settings):
        changed = level.setting(EFFECTS, setting)
        block = even_block(changed.clutch, changed.point, ANGLES, (71, cell))
        times = bulk(times_of(replace(changed, delay=setting.delay), list(run_block(block))))
        known = np.isfinite(times)
        if not known.any():
            continue
        weights = changed.weights(block.angles) * known
        true = float((weights * np.where(known, times, 0.0)).sum() / weights.sum())
        found = emulator.at(hypothesis, values, cell)
        plain = emulator.at((), np.zeros((1, 0)), cell).times.mean()
        miss = float(found.times.mean()) - true
        shares.append(miss / float(plain))
        scores.append(miss / float(np.hypot(found.error, found.common)[0]))
    if not shares:
        return np.full(2, np.nan)
    return np.sqrt(np.mean(np.square([shares, scores]), axis=1))


def _in_order(level: Level, hypothesis: Sequence[str]) -> tuple[float, ...]:
    """Return the values effect by effect in another order of the effects."""
    columns = columns_of(level.hypothesis, EFFECTS)
    return tuple(value for name in hypothesis for value in level.values[columns[name]])


if __name__ == "__main__":
    main()
