r"""Error of the rule for two effects, against simulations with both.

    python -m benchmarks.pair_rule

On the three clutches of the blind check each pair of effects is simulated with both at random sizes
between 0.4 and 0.9 of their ranges, at 16 even angles and all operating points. Of the misses of ln
mean and of ln deviation by the rule (``diagnosis.prediction.model``) the root mean square is
printed, that of their ratios to the stated errors, and the mean log density by a Student
distribution of five degrees of freedom, for several multiples of the factors ``pair_error`` and
``pair_spread_error`` of the settings. Three minutes of processor time.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.inference.ranking import REDUNDANT
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.moments import LOG_MEAN, LOG_SD
from dogshape.diagnosis.prediction.simulations import Level, simulate_benches
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, models_of
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.cases import CLUTCHES

SHARES = (0.4, 0.9)  #: range of the sizes
TRIALS = 8  #: sizes, of which the first that exist are simulated
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  #: of the settings
FREEDOM = 5.0  #: degrees of freedom of the misses over their errors


class JointBench(NamedTuple):
    """Bench with two effects: its level and moments, (C, MOMENTS)."""

    model: Model
    level: Level
    moments: Array


def joint_benches(model: Model) -> Iterator[JointBench]:
    """Simulate each pair of effects at a random size."""
    assert model.runner is not None
    generator = np.random.default_rng(1)
    names = sorted(set(model.effects) - model.reading_effects)
    for pair in itertools.combinations(names, 2):
        if set(pair) >= REDUNDANT:
            continue
        space = model.space(pair)
        shares = generator.uniform(*SHARES, (TRIALS, len(space.parameters)))
        for values in space.values(shares[model.possible(pair, shares)]).tolist():
            level = Level(pair, tuple(values))
            with suppress(DogshapeError):  # no such bench at an operating point
                settings = [level.setting(model.effects, setting) for setting in model.settings]
                times = simulate_benches(
                    [settings], model.baseline.simulated, model.runner, is_dense=False
                )
                yield JointBench(model, level, model.baseline.moments_of(times)[0])
                break
        print(" + ".join(pair), file=sys.stderr, flush=True)


def misses_of(bench: JointBench, factor: float) -> Array:
    """Compute misses of ln mean and ln deviation and their stated errors, (4, C).

    ``factor`` is that of both errors of the rule.
    """
    constants = replace(
        USUAL,
        pair_error=factor * USUAL.pair_error,
        pair_spread_error=factor * USUAL.pair_spread_error,
    )
    model = replace(bench.model, constants=constants)
    p = model.predict_values(bench.level.hypothesis, np.array([bench.level.values]))
    level_error = model.baseline.moment_errors[0]
    mean = (p.mean - p.delay)[0]
    return np.array(
        [
            bench.moments[:, LOG_MEAN] - np.log(mean),
            np.hypot(np.hypot(p.error, p.common_error)[0] / mean, level_error[:, LOG_MEAN]),
            bench.moments[:, LOG_SD] - np.log(p.sd[0]),
            np.sqrt(p.log_sd_error[0] ** 2 + USUAL.spread_share**2 + level_error[:, LOG_SD] ** 2),
        ]
    )


def print_misses(benches: Sequence[JointBench]) -> None:
    """Print the table of factors."""
    print(f"{len(benches)} benches; factor, then of ln mean and of ln deviation:")
    print("factor   rms  ratio  log density     rms  ratio  log density")
    for factor in FACTORS:
        columns = np.concatenate([misses_of(bench, factor) for bench in benches], axis=1)
        columns = columns[:, np.isfinite(columns).all(axis=0)]
        cells = []
        for miss, error in (columns[:2], columns[2:]):
            log_density = student.logpdf(miss, FREEDOM, scale=error).mean()
            sizes = [np.sqrt(np.square(values).mean()) for values in (miss, miss / error)]
            cells.append(f"{sizes[0]:5.3f}  {sizes[1]:5.2f}       {log_density:6.3f}")
        print(f"{factor:6.2f} {cells[0]}   {cells[1]}")


def main() -> None:
    """Simulate and print."""
    benches = []
    for folder in CLUTCHES.values():
        bench = load_bench(bundled_root() / folder)
        bench = replace(bench, clutch=bench.clutch.with_engine("planar"))
        model = next(iter(models_of(bench, load(), BankOptions()).values()))
        benches += joint_benches(model)
    print_misses(benches)


if __name__ == "__main__":
    main()
