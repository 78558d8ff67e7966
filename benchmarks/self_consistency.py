"""Diagnoses of data drawn from the priors and the likelihood of the diagnosis itself.

    python -m benchmarks.self_consistency [--sets N] [--jobs N] [--kept FILE] [--bank FOLDER]

Each set has a hypothesis of the prior (*unknown* and sets of three effects too), sizes of their
ranges, and data as the likelihood has them: discrepancy, nuisances, errors of effect laws, late
shifts, odd means, spreads, engagement. Points are half of those of ``mq200_adams`` with 3 to 20
shifts each; half of the sets are means. So probabilities must hold. FILE keeps finished sets, from
which a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import kstest

from dogshape.diagnosis.bench.bench_data import Bench, Cell, Reading, load_bench
from dogshape.diagnosis.bench.stand_file import BenchRecord
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.ranking import STRETCHES, hypotheses_of, log_prior
from dogshape.diagnosis.likelihood.likelihood import Likelihood, freedom_of
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.prediction.moments import timely
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, BankOptions, models_of
from dogshape.sim.effects import load
from dogshape.validation.blind.score import share

KEPT = Path("results") / "self_consistency.jsonl"
RECORD = BenchRecord(
    time_zero="command", displacement_at="sleeve", empty_cells="not_made", sense="known"
)
NUMBERS = (3, 20)  #: shifts of a point
LEAST = 5e-3  #: s, of a time


@dataclass(frozen=True)
class Truth:
    """Hypothesis of a data set and the shares of its ranges."""

    hypothesis: Hypothesis
    shares: Array


@dataclass(frozen=True)
class Answer:
    """Figures of one set: truth, what evidence says of it, and what is said."""

    truth: list[str]
    probability: float  #: of the truth
    before: float  #: probability of all hypotheses that are more probable
    leading: list[str]
    leads: float
    pairs: float  #: probability of all pairs
    p: float | None  #: predictive, of the truth
    ranks: list[float]  #: of the true sizes among the draws
    verdict: str
    causes: list[str]
    visible: bool
    seconds: float


@cache
def world(bank: Path = BANK) -> tuple[Bench, Model]:
    """Load the points and their predictions, once in a process."""
    bench = load_bench("mq200_adams")
    cells = tuple(cell for cell in bench.cells if cell.n)[::2]
    bench = replace(bench, cells=cells, record=RECORD, clutch=bench.clutch.with_engine("planar"))
    return bench, models_of(bench, load(), BankOptions(bank=bank))["sleeve"]


@cache
def _priors(key: int) -> tuple[list[Hypothesis], Array]:
    model = _MODELS[key]
    every = [h for size in range(USUAL.most + 1) for h in hypotheses_of(model, size)]
    every.append(UNKNOWN)
    logs = np.array([log_prior(h, model, USUAL, USUAL.reversed_known) for h in every])
    chances = np.exp(logs)
    return every, chances / chances.sum()


_MODELS: dict[int, Model] = {}


def draw_truth(model: Model, generator: np.random.Generator) -> Truth:
    """Draw a hypothesis from the prior and shares of its ranges of which there is a bench."""
    _MODELS[id(model)] = model
    every, chances = _priors(id(model))
    hypothesis = every[int(generator.choice(len(every), p=chances))]
    known = hypothesis
    while known == UNKNOWN:
        known = every[int(generator.choice(len(every), p=chances))]
    size = len(model.space(known).parameters)
    while True:
        shares = generator.random((1, size))
        if model.possible(known, shares)[0]:
            break
    return Truth(hypothesis, shares) if known == hypothesis else Truth((*known, "unknown"), shares)


def draw_cells(
    bench: Bench, model: Model, truth: Truth, generator: np.random.Generator, kind: str
) -> Bench:
    """Draw a data set as the likelihood has it: ``kind`` is ``means`` or ``singles``."""
    blank = [
        Cell(cell.point, (Reading(k + 2, cell.point, 2, 0.1, True),))
        for k, cell in enumerate(bench.cells)
    ]
    plain = replace(bench, cells=tuple(blank))
    likelihood = Likelihood(plain, observe(plain, model), model, USUAL)
    known = tuple(name for name in truth.hypothesis if name != "unknown")
    p = model.predict(known, truth.shares)
    unlisted = "unknown" in truth.hypothesis
    mean = draw_means(likelihood, p, unlisted, generator)
    stretch = float(generator.choice(STRETCHES)) if unlisted else 1.0
    freedom = freedom_of(likelihood._spread_error(p)[0])
    sd = stretch * p.sd[0] * np.sqrt(freedom / generator.chisquare(freedom))
    cells, row = [], 2
    for k, cell in enumerate(bench.cells):
        tried = int(generator.integers(NUMBERS[0], NUMBERS[1] + 1))
        engaged = _count(p.engaged[0, k], (0.01, 0.99), tried, generator)
        late = _count(p.late[0, k], (USUAL.late_least, 0.9), engaged, generator)
        times = mean[k] + sd[k] * _scatter(model, p, k, engaged, generator)
        behind, behind_sd = (part[k] for part in model.behind)
        times[:late] = mean[k] + behind + behind_sd * generator.standard_normal(late)
        times = np.maximum(times, LEAST)
        readings = _readings(cell, row, times, tried, kind=kind, generator=generator)
        row += len(readings)
        cells.append(Cell(cell.point, tuple(readings)))
    return replace(bench, cells=tuple(cells))


def draw_means(
    likelihood: Likelihood, p: Predicted, unlisted: bool, generator: np.random.Generator
) -> Array:
    """Draw the mean of timely shifts at each point, with all errors of the simulation, s, (C,)."""
    simulated = (p.mean - p.delay)[0]
    size = USUAL.discrepancy * abs(generator.standard_normal())
    columns = [size * simulated[:, None] * likelihood.smooth, likelihood.columns(p)[0]]
    own = likelihood.own_variance(p)[0]
    if unlisted:
        wide = float(generator.choice(USUAL.unlisted_sizes))
        length = float(generator.choice(USUAL.unlisted_lengths))
        columns.append(wide * simulated[:, None] * likelihood._unlisted_root(length))
        own = own + (1.0 - USUAL.unlisted_smooth) * (wide * simulated) ** 2
    every = np.hstack(columns)
    found = p.mean[0] + every @ generator.standard_normal(every.shape[1])
    found = found + np.sqrt(own) * generator.standard_normal(len(own))
    odd = generator.random(len(own)) < USUAL.odd_share
    found = found + odd * USUAL.odd_size * p.mean[0] * generator.standard_normal(len(own))
    return np.asarray(np.maximum(found, LEAST))


def _count(
    share_: float, ends: tuple[float, float], whole: int, generator: np.random.Generator
) -> int:
    chance = np.clip(share_, *ends)
    known = USUAL.late_known
    return int(generator.binomial(whole, generator.beta(known * chance, known * (1.0 - chance))))


def _scatter(
    model: Model, p: Predicted, cell: int, count: int, generator: np.random.Generator
) -> Array:
    """Draw times over their deviation, of the baseline or of both modes, (count,)."""
    share, main, narrow = (float(part[0, cell]) for part in (p.minor, p.main, p.narrow))
    if share == 1.0:
        base = timely(model.simulated.baseline, model.far)[cell]
        base = base[np.isfinite(base)]
        return generator.choice((base - base.mean()) / base.std(), count)
    other, whole = -main * (1.0 - share) / share, float(p.sd[0, cell])
    left = whole**2 - (1.0 - share) * (narrow**2 + main**2) - share * other**2
    rare = generator.random(count) < share
    sd = np.where(rare, np.sqrt(max(left / share, 0.0)), narrow)
    return (np.where(rare, other, main) + sd * generator.standard_normal(count)) / whole


def _readings(
    cell: Cell, row: int, times: Array, tried: int, *, kind: str, generator: np.random.Generator
) -> list[Reading]:
    failed = tried - len(times)
    found = [Reading(row, cell.point, failed, None, False)] if failed else []
    if kind == "singles":
        order = generator.permutation(times).tolist()
        return [*(Reading(row, cell.point, 1, t, True) for t in order), *found]
    if len(times):
        spread = float(times.std(ddof=1)) if len(times) > 1 and generator.random() < 0.5 else None
        mean = float(times.mean())
        found.append(Reading(row, cell.point, len(times), mean, True, sd=spread))
    return found


def answer(bench: Bench, model: Model, seed: int) -> Answer:
    """Draw and diagnose a set."""
    generator = np.random.default_rng(seed)
    truth = draw_truth(model, generator)
    kind = "means" if seed % 2 else "singles"
    drawn = draw_cells(bench, model, truth, generator, kind)
    # Sets are drawn as predicted, so pairs must not be simulated.
    return figures(truth, diagnose(drawn, {"sleeve": replace(model, run=None)}))


def figures(truth: Truth, found: Diagnosis) -> Answer:
    """Compare a diagnosis with the truth."""
    cause = UNKNOWN if "unknown" in truth.hypothesis else truth.hypothesis
    own = found.evidence.get(cause, 0.0)
    fitted, ranks = found.fits.get(cause), list[float]()
    if fitted is not None:
        ranks = (fitted.shares < truth.shares).mean(axis=0).tolist()
    leading = max(found.evidence, key=lambda h: found.evidence[h])
    return Answer(
        list(truth.hypothesis),
        own,
        sum(q for q in found.evidence.values() if q > own),
        list(leading),
        found.evidence[leading],
        sum(q for h, q in found.evidence.items() if len(h) == 2),
        fitted.p if fitted is not None else None,
        ranks,
        found.verdict.kind,
        list(found.verdict.causes),
        found.posterior.get(cause, 0.0) > 0.5 * own,
        found.seconds,
    )


def one(bank: Path, seed: int) -> dict[str, Any]:
    """Draw and diagnose a set of the world."""
    # A worker process finds caches by their module, which here is another one's main program.
    from benchmarks import self_consistency as module  # noqa: PLC0415

    return asdict(module.answer(*module.world(bank), seed))


def answers(count: int, jobs: int, kept: Path, bank: Path) -> list[Answer]:
    """Diagnose so many sets; take those that a file has."""
    rows = kept_rows(kept, [(seed,) for seed in range(count)], partial(one, bank), jobs)
    return [Answer(**row) for row in rows.values()]


def in_set(one: Answer, level: float = 0.9) -> bool:
    """Decide whether the set of the most probable hypotheses holds the truth."""
    return one.before < level and one.probability > 0.0


def cause_of(one: Answer) -> tuple[str, ...]:
    """Name the true hypothesis, UNKNOWN where something unlisted acts."""
    return UNKNOWN if "unknown" in one.truth else tuple(one.truth)


def written(given: Iterable[bool]) -> str:
    """Write a share with its interval."""
    found = share(given)
    if found["value"] is None:
        return f"{'-':>20}{0:>6}"
    return f"{found['value']:.3f} ({found['low']:.3f} to {found['high']:.3f}){found['n']:>6}"


def print_figures(found: Sequence[Answer]) -> None:
    """Print what holds if probabilities are right, and what is named."""
    hits = [(a.leads, tuple(a.leading) == cause_of(a)) for a in found]
    ranks = np.array([rank for a in found for rank in a.ranks])
    ps = np.array([a.p for a in found if a.p is not None])
    pairs = [a for a in found if len(a.leading) == 2]
    for name, flags in (
        ("truth in the 90 % set", [in_set(a) for a in found]),
        ("truth in the 50 % set", [in_set(a, 0.5) for a in found]),
        ("leading hypothesis is the truth", [hit for _, hit in hits]),
        ("the same, a pair leads", [tuple(a.leading) == cause_of(a) for a in pairs]),
        ("named: the whole truth", [_right(a) for a in found if a.verdict == "effect"]),
        ("true sizes in 90 % intervals", abs(ranks - 0.5) < 0.45),
        ("predictive p below 0.05", ps < 0.05),
        ("predictive p below 0.01", ps < 0.01),
    ):
        print(f"{name:40}{written(flags)}")
    said = np.mean([p for p, _ in hits])
    print(f"{'probability of the leading one':40}{said:.3f}")
    mean = np.mean([a.leads for a in pairs]) if pairs else float("nan")
    print(f"{'the same, a pair leads':40}{mean:.3f}")
    acting = [a.leads - (tuple(a.leading) == cause_of(a)) for a in found if len(cause_of(a)) == 2]
    print(f"{'a pair acts: probability less right':40}{np.mean(acting):.3f}")
    actual = np.mean([len(cause_of(a)) == 2 for a in found])
    print(f"{'pairs: probability, share':40}{np.mean([a.pairs for a in found]):.3f} {actual:.3f}")
    place = np.minimum((10.0 * np.array([p for p, _ in hits])).astype(int), 9)
    error = abs(np.bincount(place, [p - right for p, right in hits])).sum() / len(hits)
    print(f"{'calibration error, ten bins':40}{error:.3f}")
    print(f"{'ranks uniform, p of Kolmogorov':40}{kstest(ranks, 'uniform').pvalue:.3f}")
    print(f"{'p uniform, p of Kolmogorov':40}{kstest(ps, 'uniform').pvalue:.3f}")
    print(f"{'predictive p, quartiles':40}{np.quantile(ps, (0.25, 0.5, 0.75)).round(2)}")
    seconds = np.array([a.seconds for a in found])
    middle, most = np.quantile(seconds, (0.5, 0.95))
    print(f"{'s of a decision, median and 95 %':40}{middle:.1f} {most:.1f}")


def print_groups(found: Sequence[Answer]) -> None:
    """Print what leads and is named, by the truth."""
    groups = {
        "none": lambda a: not a.truth,
        "one": lambda a: len(cause_of(a)) == 1 and cause_of(a) != UNKNOWN,
        "two": lambda a: len(cause_of(a)) == 2,
        "three": lambda a: len(cause_of(a)) > 2,
        "unknown": lambda a: cause_of(a) == UNKNOWN,
    }
    print(f"\n{'truth':10}{'in 90 % set':>30}{'leads':>30}{'named wholly':>30}{'named wrong':>30}")
    for name, mine in groups.items():
        some = [a for a in found if mine(a)]
        columns = (
            [in_set(a) for a in some],
            [tuple(a.leading) == cause_of(a) for a in some],
            [_right(a) for a in some],
            [not set(a.causes) <= set(a.truth) for a in some],
        )
        print(f"{name:10}" + "".join(f"{written(flags):>30}" for flags in columns))


def _right(one: Answer) -> bool:
    """Decide whether the verdict is the whole truth."""
    cause = cause_of(one)
    said = {"none": NONE, "unknown": UNKNOWN, "effect": tuple(one.causes)}.get(one.verdict)
    return said == cause


def kept_rows(
    path: Path, keys: Iterable[tuple[Any, ...]], work: Callable[..., Any], jobs: int
) -> dict[tuple[Any, ...], Any]:
    """Work out the row of each key that the file lacks, and give the rows of all keys in order.

    Parameters
    ----------
    work : gives the row of a key's parts as JSON; picklable where ``jobs`` is above one.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    known = {tuple(key): row for key, row in map(json.loads, lines)}
    every = list(keys)
    left = [key for key in every if key not in known]
    pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
    with path.open("a", encoding="utf-8") as file:
        for key, row in pool(delayed(_row)(work, key) for key in left):
            known[key] = row
            file.write(json.dumps([key, row]) + "\n")
            file.flush()
    return {key: known[key] for key in every}


def _row(work: Callable[..., Any], key: tuple[Any, ...]) -> tuple[tuple[Any, ...], Any]:
    return key, work(*key)


def main() -> None:
    """Draw, diagnose and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kept", type=Path, default=KEPT)
    parser.add_argument("--bank", type=Path, default=BANK)
    given = parser.parse_args()
    world(given.bank)
    found = answers(given.sets, given.jobs, given.kept, given.bank)
    print(f"{len(found)} sets drawn from the priors and the likelihood\n")
    print_figures(found)
    print_groups(found)


if __name__ == "__main__":
    main()
