"""Predictive p-values of data that are what the likelihood says: how often they are small.

    python -m benchmarks.predictive_check [--sets N]

Ten single shifts, or their means, at 14 operating points of the published clutch are drawn from the
bundled bank's own times without any effect. *Declared*: with all errors that the likelihood reckons
with, of means, spreads, shares of late shifts, and those that operating points have in common.
*Bare*: with none of them. No parameter is fitted, so p would be uniform for declared data. Two
minutes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, setting_of
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.likelihood.cell_likelihood import CellPredictions, outlier_beta
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.hypotheses import NONE, spaces_of
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.diagnose.bank_diagnosis import Means, banks_of, with_bank_engine
from dogshape.sim.effects import load

FORCES = (235.2, 641.5)  #: N
SHIFTS = 10  #: at each operating point
NOTHING = np.zeros((1, 0))  #: values of no effect


def few(bench: Bench) -> Bench:
    """Return a data set with the operating points of two forces, two shifts at each."""
    points = [c.point for c in bench.cells if round(c.point.profile.force, 1) in FORCES]
    return replace(
        bench, cells=gather([Reading(k + 2, p, 2, 0.1, True) for k, p in enumerate(points)])
    )


def drawn(bench: Bench, problem: Problem, seed: int, *, declared: bool, single: bool) -> Bench:
    """Return a data set without any effect, with or without the declared errors."""
    generator = np.random.default_rng(seed)
    predicted = problem.predictions(NONE, NOTHING)
    points = [cell.point for cell in bench.cells]
    offsets = np.zeros(len(points))
    if declared:
        together = problem.discrepancy.draw(generator)
        offsets = together + predicted.error[:, 0] * generator.standard_normal(len(points))
    readings: list[Reading] = []
    for cell, point in enumerate(points):
        times = _times(predicted, cell, generator, declared=declared, single=single) + offsets[cell]
        groups = [(1, t) for t in times] if single else [(SHIFTS, times.mean())]
        row = len(readings) + 2
        readings += [Reading(row + k, point, n, float(t), True) for k, (n, t) in enumerate(groups)]
    return replace(bench, cells=gather(readings))


def _times(
    predicted: CellPredictions,
    cell: int,
    generator: np.random.Generator,
    *,
    declared: bool,
    single: bool,
) -> Array:
    """Return the times of the shifts of one operating point, but for errors of its mean, s."""
    mean, times = predicted.mean[cell, 0], predicted.times[cell, 0]
    wrong = predicted.shape[cell, 0] * generator.standard_normal() if declared and single else 0.0
    found: Array = mean + np.exp(wrong) * (generator.choice(times, SHIFTS) - mean)
    rate = predicted.outlier_share[cell, 0]
    if declared and single:
        rate = generator.beta(*(part[cell, 0] for part in outlier_beta(predicted)))
    if np.isnan(predicted.behind[cell, 0]):
        return found
    behind = generator.normal(predicted.behind[cell, 0], predicted.behind_sd[cell, 0], SHIFTS)
    return np.where(generator.random(SHIFTS) < rate, found + behind, found)


def main() -> None:
    """Draw, check and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=600)
    given = parser.parse_args()
    effects, means = load(None), Means(jobs=1)
    bench = with_bank_engine(few(load_bench("mq200_adams")), effects, means)
    bank, _ = banks_of(bench, effects, means)
    emulator = BankEmulator(bank)
    problem = Problem(observe(bench), emulator, USUAL)
    (space,) = [s for s in spaces_of({}, setting_of(bench), pairs=[]) if s.hypothesis == NONE]
    print(f"{given.sets} sets each, {len(bench.cells)} operating points, {SHIFTS} shifts at each")
    print("data                          mean p  below 0.05  below 0.01")
    for single in (False, True):
        for declared in (True, False):
            made = (
                drawn(bench, problem, seed, declared=declared, single=single)
                for seed in range(given.sets)
            )
            problems = [Problem(observe(one), emulator, USUAL) for one in made]
            found = np.array([p_value(one, evidence(one, space)) for one in problems])
            name = f"{'single shifts' if single else 'means'}, {'declared' if declared else 'bare'}"
            shares = (found < 0.05).mean(), (found < 0.01).mean()
            print(f"{name:<28}{found.mean():8.2f}{shares[0]:12.3f}{shares[1]:12.3f}")


if __name__ == "__main__":
    main()
