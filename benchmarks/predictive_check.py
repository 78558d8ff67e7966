"""Predictive p-values of data that are what the likelihood says: how often they are small.

    python -m benchmarks.predictive_check [--sets N]

Ten single shifts, or their means, at 14 operating points of the published clutch are drawn from the
bundled bank as the likelihood says: without any effect, or with one of any strength, which is then
fitted. *Posterior* is the p-value at values of the posterior, *refits* that of replicates that are
fitted anew, and the *smaller* of both is what the diagnosis takes. *Off* are the same data whose
cells are each moved by 5 % besides, independently, which nothing known explains. Three minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks.drawn_sets import source
from benchmarks.self_consistency import World, world
from dogshape.diagnosis.bench.bench_data import setting_of
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.refits import calibrated_p
from dogshape.diagnosis.likelihood.replicates import offsets_of
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import NONE, Space, spaces_for
from dogshape.diagnosis.terms import Array, Hypothesis

SHIFTS = 10  #: at each operating point
OFF = 0.05  #: of the mean time
CAUSES: tuple[Hypothesis, ...] = (NONE, ("sleeve_friction",), ("contact_friction",))


def drawn(whole: World, space: Space, seed: int, *, single: bool, off: float) -> Problem:
    """Draw a data set of a hypothesis, at values of its prior."""
    generator = np.random.default_rng(seed)
    one = source(whole, space, SHIFTS, generator, single=single)
    mean = one.said.mean[:, 0]
    offsets = offsets_of(one.said, one.blank.discrepancy, generator)
    offsets = offsets + off * mean * generator.standard_normal(mean.size)
    return one.drawn(offsets, generator)


def p_values(problems: Sequence[Problem], space: Space) -> Array:
    """Return the p-values of all three kinds, (sets, 3)."""
    found = []
    for problem in problems:
        one = evidence(problem, space)
        both = p_value(problem, one), calibrated_p(problem, one)
        found.append((*both, min(both)))
    return np.array(found)


def main() -> None:
    """Draw, check and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=30)
    count = parser.parse_args().sets
    whole = world()
    print(f"{count} sets each, {len(whole.bench.cells)} operating points, {SHIFTS} shifts at each")
    kinds = ("posterior", "refits", "smaller")
    print(f"{'':<38}" + "".join(f"{name:>20}" for name in kinds))
    print(f"{'data':<38}" + f"{'below 0.05':>12}{'0.01':>8}" * len(kinds))
    for off in (0.0, OFF):
        for cause in CAUSES:
            (space,) = spaces_for((cause,), whole.effects, setting_of(whole.bench))
            for single in (False, True):
                made = [drawn(whole, space, k, single=single, off=off) for k in range(count)]
                found = p_values(made, space)
                shares = [((one < 0.05).mean(), (one < 0.01).mean()) for one in found.T]
                name = f"{'off, ' if off else ''}{' '.join(cause) or 'none'}"
                name += ", single shifts" if single else ", means"
                print(f"{name:<38}" + "".join(f"{a:>12.3f}{b:>8.3f}" for a, b in shares))


if __name__ == "__main__":
    main()
