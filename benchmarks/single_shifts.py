"""Density of single shifts: how evenly data of the emulator's own are scored at their true values.

    python -m benchmarks.single_shifts [--sets N]

3 to 16 single shifts at each of 14 operating points of the published clutch are drawn from the
bundled bank as the likelihood says, under six causes of any strength. Scores of means and spreads
should be normal: a root mean square of one, 2.3 % below -2 and 0.13 % below -3. *One normal law* is
the density without modes and with outliers always late; *modes* is what the diagnosis takes
(``diagnosis.likelihood.mean_density``). Of densities of the same times the right one has the
largest mean log likelihood at the truth. Some ten seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from unittest import mock

import numpy as np

from benchmarks.drawn_sets import source
from benchmarks.self_consistency import World, world
from dogshape.diagnosis.bench.bench_data import setting_of
from dogshape.diagnosis.likelihood import time_parts
from dogshape.diagnosis.likelihood.cell_likelihood import log_times
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.mean_density import log_sphere, time_scores
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.prediction.hypotheses import NONE, spaces_for
from dogshape.diagnosis.terms import Array, Hypothesis

FEWEST, MOST = 3, 16  #: shifts at an operating point
CAUSES: tuple[Hypothesis, ...] = (
    NONE,
    ("sleeve_friction",),
    ("contact_friction",),
    ("viscous_damping",),
    ("moving_mass",),
    ("reversed_mismatch",),
)
Drawn = tuple[Observed, CellPredictions]


def drawn(whole: World, cause: Hypothesis, seed: int) -> Drawn:
    """Draw single shifts of a cause of some strength, with what they come from."""
    (space,) = spaces_for((cause,), whole.effects, setting_of(whole.bench))
    generator = np.random.default_rng(seed)
    count = int(generator.integers(FEWEST, MOST + 1))
    one = source(whole, space, count, generator, single=True)
    error = one.said.error[:, 0]
    return one.drawn(error * generator.standard_normal(error.size), generator).seen, one.said


def scored(sets: Sequence[Drawn]) -> tuple[Array, Array]:
    """Score each operating point, (cells, 3), and compute the log likelihood of each set.

    Columns are the scores of mean and spread, and whether outliers are seen.
    """
    rows, logs = [], []
    for seen, said in sets:
        means, spreads, _ = time_scores(seen, said, np.zeros_like(said.mean))
        outliers = np.array([times.size > 0 for times in seen.outlier_times])
        rows.append(np.column_stack([means[:, 0], spreads[:, 0], outliers])[seen.freedom > 0])
        # What one mean and deviation leave open is the same whatever the density is.
        logs.append(float((log_times(seen, said)[:, 0] - log_sphere(seen)).sum()))
    return np.concatenate(rows), np.array(logs)


def main() -> None:
    """Draw, score and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=50)
    count, whole = parser.parse_args().sets, world()
    sets = [drawn(whole, cause, seed) for cause in CAUSES for seed in range(count)]
    print(
        f"{len(sets)} sets of {FEWEST} to {MOST} single shifts at {len(whole.bench.cells)} points"
    )
    print(f"{'':<37}{'means':>14}{'spreads':>22}")
    print(
        f"{'density, operating points':<30}{'number':>7}{'rms':>6}{'< -3':>8}{'rms':>7}"
        f"{'< -2':>7}{'< -3':>8}"
    )
    for name, plain in (("one normal law", True), ("modes", False)):
        with ExitStack() as stack:
            if plain:
                patch = mock.patch.object
                stack.enter_context(patch(time_parts, "_with_modes", lambda found, *_: found))
                nowhere = property(lambda seen: np.zeros(seen.cells, dtype=bool))
                stack.enter_context(patch(Observed, "divided", nowhere))
            rows, logs = scored(sets)
        outliers = rows[:, 2] > 0.0
        for which, marked in (("no outliers", ~outliers), ("outliers", outliers)):
            means, spreads = rows[marked, 0], rows[marked, 1]
            print(
                f"{name + ', ' + which:<30}{marked.sum():>7d}{_rms(means):>6.2f}"
                f"{(means < -3.0).mean():>8.2%}{_rms(spreads):>7.2f}{(spreads < -2.0).mean():>7.1%}"
                f"{(spreads < -3.0).mean():>8.2%}"
            )
        print(f"{name}: mean log likelihood of a set {logs.mean():.2f}")


def _rms(scores: Array) -> float:
    return float(np.sqrt((scores**2).mean()))


if __name__ == "__main__":
    main()
