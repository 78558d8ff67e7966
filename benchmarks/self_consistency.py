"""Diagnoses of data drawn from the diagnosis' own emulator and priors: the ceiling of the method.

    python -m benchmarks.self_consistency [--sets N] [--jobs N] [--kept FILE]

Causes are drawn from the prior probabilities, their sizes from their priors, and data as the
likelihood says, at 6 to 12 operating points of the published clutch at two shift forces, as means
of 3 to 50 shifts or 3 to 20 single ones. So probabilities have to hold what they say, and no other
engine's data can be told apart better. Noncentrality is what the best refit by rivals leaves,
squared standard errors with all errors, the discrepancy included. Finished sets are kept in FILE,
from which a run that was stopped goes on. An hour of processor time for 500 sets.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import kstest, sem

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.diagnose.bank_diagnosis import Means, emulator_of, with_bank_engine
from dogshape.sim.effects import load
from dogshape.validation.blind.intervals import calibration, share
from dogshape.validation.self_consistency import (
    STRONG,
    WEAK,
    Answer,
    World,
    answer,
    as_row,
    draw,
    from_row,
    in_set,
    leading,
    stratified,
)

FORCES = (235.2, 641.5)  #: N
KEPT = Path("results") / "self_consistency.jsonl"
BANDS = ((0.0, WEAK), (WEAK, STRONG), (STRONG, np.inf))


def few(bench: Bench) -> Bench:
    """Select the operating points of two forces, without their times."""
    points = [c.point for c in bench.cells if round(c.point.profile.force, 1) in FORCES]
    rows = [Reading(k + 2, p, 2, 0.1, True) for k, p in enumerate(points)]
    return replace(bench, cells=gather(rows))


@cache
def world() -> World:
    """Load what sets are drawn from, once in a process."""
    effects, means = load(None), Means(jobs=1)
    bench = with_bank_engine(few(load_bench("mq200_adams")), effects, means)
    return World(bench, emulator_of(bench, effects, means)[0], effects)


def one(seed: int) -> tuple[int, Answer]:
    """Draw and diagnose a set."""
    # A worker process finds a cache by its module, which here is another one's main program.
    from benchmarks.self_consistency import world  # noqa: PLC0415

    return seed, answer(world(), draw(world(), np.random.default_rng(seed)))


def answers(count: int, jobs: int, kept: Path) -> list[Answer]:
    """Diagnose so many sets, those that a file has from before left out."""
    known: dict[int, Answer] = {}
    kept.parent.mkdir(parents=True, exist_ok=True)
    if kept.exists():
        rows = [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]
        known = {row["seed"]: from_row(row) for row in rows}
    left = [seed for seed in range(count) if seed not in known]
    pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
    with kept.open("a", encoding="utf-8") as file:
        for seed, found in pool(delayed(one)(seed) for seed in left):
            known[seed] = found
            file.write(json.dumps({"seed": seed, **as_row(found)}) + "\n")
            file.flush()
    return [known[seed] for seed in range(count)]


def told(given: dict[str, float | int | None]) -> str:
    """Write a share with its interval."""
    if given["value"] is None:
        return f"{'-':>20}{0:>5}"
    return f"{given['value']:.2f} ({given['low']:.2f} to {given['high']:.2f}){given['n']:>5}"


def print_calibration(found: Sequence[Answer], chances: Mapping[Hypothesis, float]) -> None:
    """Print what holds if probabilities are what they say, over all sets."""
    ranks = np.concatenate([a.ranks for a in found])
    tops = [max(a.raw, key=lambda h, a=a: a.raw[h]) for a in found]  # type: ignore[misc]
    hits = [(a.raw[top], top == a.cause) for a, top in zip(found, tops, strict=True)]
    fits = np.array([a.fit for a in found if a.fit is not None])
    held = share(in_set(a.raw, a.cause, 0.9) for a in found)
    print("by evidence, before effects that cannot be seen count as none:")
    print(f"  true cause in the 90 % set       {told(held)}")
    print(f"  leading one is the cause         {told(share(hit for _, hit in hits))}")
    print(f"  said on average                  {np.mean([p for p, _ in hits]):.2f}")
    excess = np.array([too_sure(a) for a in found])
    even = stratified(found, chances, too_sure)
    numbers = [sum(len(a.cause) == k for a in found) for k in range(3)]
    expected = [len(found) * sum(p for h, p in chances.items() if len(h) == k) for k in range(3)]
    print(f"  too sure by                      {excess.mean():.3f} +- {sem(excess):.3f}")
    print(f"  the same, numbers as expected    {even[0]:.3f} +- {even[1]:.3f}")
    print(
        "    (sets without an effect, of one, of two: "
        + ", ".join(f"{n} of {e:.0f}" for n, e in zip(numbers, expected, strict=True))
        + " expected)"
    )
    print(
        f"  its calibration error, ten bins  {calibration([[pair] for pair in hits])['value']:.3f}"
    )
    print(f"  true values in 90 % intervals    {told(share(abs(ranks - 0.5) < 0.45))}")
    print(f"  ranks uniform, p of Kolmogorov and Smirnov  {kstest(ranks, 'uniform').pvalue:.2f}")
    print(f"  predictive p of the cause below 0.05  {told(share(fits < 0.05))}")
    print(f"  predictive p of the cause below 0.01  {told(share(fits < 0.01))}")


def too_sure(found: Answer) -> float:
    """Return by how much the probability of what leads exceeds whether it is the cause."""
    top = max(found.raw, key=lambda h: found.raw[h])
    return found.raw[top] - (top == found.cause)


def print_bands(found: Sequence[Answer]) -> None:
    """Print what is found by noncentrality."""
    rows = {
        "cause leads": lambda m: share(leading(a) == a.cause for a in m),
        "cause or its class leads": lambda m: share(
            leading(a) == a.cause or a.cause in a.group for a in m
        ),
        "cause in the 90 % set": lambda m: share(a.cause in a.credible for a in m),
        "named": lambda m: share(a.verdict == "effect" for a in m),
        "named exactly, of named": lambda m: share(
            a.named == a.cause for a in m if a.verdict == "effect"
        ),
        "named is part, of named": lambda m: share(
            set(a.named) <= set(a.cause) for a in m if a.verdict == "effect"
        ),
        "named wrongly, of all": lambda m: share(
            a.verdict == "effect" and not set(a.named) <= set(a.cause) for a in m
        ),
        "unknown said": lambda m: share(a.verdict == "unknown" for a in m),
        "none said": lambda m: share(a.verdict == "none" for a in m),
    }
    groups = [("no effect", [a for a in found if not a.cause])]
    for low, high in BANDS:
        mine = [a for a in found if a.cause and low <= a.noncentrality < high]
        groups.append((f"{low:g} to {high:g}", mine))
    print(f"\n{'noncentrality':<26}" + "".join(f"{name:>29}" for name, _ in groups))
    for name, make in rows.items():
        print(f"{name:<26}" + "".join(f"{told(make(mine)):>29}" for _, mine in groups))


def main() -> None:
    """Draw, diagnose and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kept", type=Path, default=KEPT)
    given = parser.parse_args()
    found = answers(given.sets, given.jobs, given.kept)
    print(f"{given.sets} sets drawn from the emulator and the priors, none or one effect or two")
    print_calibration(found, world().chances)
    print_bands(found)


if __name__ == "__main__":
    main()
