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

from dogshape.bench.bench_data import Bench, Cell, Reading, load_bench
from dogshape.bench.stand_file import BenchRecord
from dogshape.diagnosis.diagnosis import Inference, diagnose
from dogshape.diagnosis.inference.ranking import hypotheses_of, log_prior
from dogshape.diagnosis.likelihood.likelihood import Likelihood, freedom_of
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.model import Model, Prediction
from dogshape.diagnosis.prediction.moments import mask_late
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, BankOptions, models_of
from dogshape.sim.effects import load
from dogshape.validation.blind.score import share

ANSWERS_FILE = Path("results") / "self_consistency.jsonl"
RECORD = BenchRecord(
    time_zero="command", displacement_at="sleeve", empty_cells="not_made", sense="known"
)
SHIFT_COUNTS = (3, 20)  #: shifts of a point
MIN_TIME_S = 5e-3  #: of a shift


@dataclass(frozen=True)
class Truth:
    """Hypothesis of a data set and the shares of its ranges."""

    hypothesis: Hypothesis
    shares: Array


@dataclass(frozen=True)
class Answer:
    """Figures of a set: truth, its evidence, and the verdict."""

    truth: list[str]
    probability: float  #: of the truth
    before: float  #: probability of all hypotheses that are more probable
    leading: list[str]
    leads: float
    pairs: float  #: probability of all pairs
    p: float | None  #: predictive, of the truth
    checks: dict[str, float]  #: p-value of each part, of the truth
    ranks: list[float]  #: of the true sizes among the draws
    verdict: str
    causes: list[str]
    visible: bool
    seconds: float


@cache
def load_world(bank: Path = BANK) -> tuple[Bench, Model]:
    """Load the points and their predictions, once in a process."""
    bench = load_bench("mq200_adams")
    cells = tuple(cell for cell in bench.cells if cell.n)[::2]
    bench = replace(bench, cells=cells, record=RECORD, clutch=bench.clutch.with_engine("planar"))
    return bench, models_of(bench, load(), BankOptions(bank=bank))["sleeve"]


@cache
def _priors(key: int) -> tuple[list[Hypothesis], Array]:
    model = _MODELS[key]
    hypotheses: list[Hypothesis] = []
    for size in range(USUAL.most + 1):
        hypotheses += hypotheses_of(model, size)
    hypotheses.append(UNKNOWN)
    log_priors = np.array([log_prior(h, model, USUAL, USUAL.reversed_known) for h in hypotheses])
    probabilities = np.exp(log_priors)
    return hypotheses, probabilities / probabilities.sum()


_MODELS: dict[int, Model] = {}


def draw_truth(model: Model, generator: np.random.Generator) -> Truth:
    """Draw a hypothesis from the prior and shares of its ranges of which there is a bench."""
    _MODELS[id(model)] = model
    hypotheses, probabilities = _priors(id(model))
    hypothesis = hypotheses[int(generator.choice(len(hypotheses), p=probabilities))]
    listed = hypothesis
    while listed == UNKNOWN:
        listed = hypotheses[int(generator.choice(len(hypotheses), p=probabilities))]
    size = len(model.space(listed).parameters)
    while True:
        shares = generator.random((1, size))
        if model.possible(listed, shares)[0]:
            break
    if hypothesis == UNKNOWN:
        hypothesis = (*listed, "unknown")
    return Truth(hypothesis, shares)


def draw_cells(
    bench: Bench, model: Model, truth: Truth, generator: np.random.Generator, kind: str
) -> Bench:
    """Draw a data set as the likelihood has it: ``kind`` is ``means`` or ``singles``."""
    blank = [
        Cell(cell.point, (Reading(k + 2, cell.point, 2, 0.1, True),))
        for k, cell in enumerate(bench.cells)
    ]
    blank_bench = replace(bench, cells=tuple(blank))
    likelihood = Likelihood(blank_bench, observe(blank_bench, model), model, USUAL)
    listed = tuple(name for name in truth.hypothesis if name != "unknown")
    p = model.predict(listed, truth.shares)
    unlisted = "unknown" in truth.hypothesis
    mean = draw_means(likelihood, p, unlisted, generator)
    stretch = float(generator.choice(USUAL.unlisted_stretches)) if unlisted else 1.0
    freedom = freedom_of(likelihood._spread_variance(p)[0])
    sd = stretch * p.sd[0] * np.sqrt(freedom / generator.chisquare(freedom))
    cells = []
    row = 2
    for k, cell in enumerate(bench.cells):
        shift_count = int(generator.integers(SHIFT_COUNTS[0], SHIFT_COUNTS[1] + 1))
        engaged = _count(p.engaged_share[0, k], (0.01, 0.99), shift_count, generator)
        late = _count(p.late_share[0, k], (USUAL.late_least, 0.9), engaged, generator)
        times = mean[k] + sd[k] * _scatter(model, p, k, engaged, generator)
        late_delay, late_delay_sd = (part[k] for part in model.baseline.late_delay)
        times[:late] = mean[k] + late_delay + late_delay_sd * generator.standard_normal(late)
        times = np.maximum(times, MIN_TIME_S)
        readings = _readings(cell, row, times, shift_count, kind=kind, generator=generator)
        row += len(readings)
        cells.append(Cell(cell.point, tuple(readings)))
    return replace(bench, cells=tuple(cells))


def draw_means(
    likelihood: Likelihood, p: Prediction, unlisted: bool, generator: np.random.Generator
) -> Array:
    """Draw the mean of timely shifts at each point, with all errors of the simulation, s, (C,)."""
    simulated = (p.mean - p.delay)[0]
    size = USUAL.discrepancy * abs(generator.standard_normal())
    discrepancy = size * simulated[:, None] * likelihood.discrepancy_root
    columns = [discrepancy, likelihood.common_errors(p)[0]]
    variance = likelihood.mean_variance(p)[0]
    if unlisted:
        unlisted_size = float(generator.choice(USUAL.unlisted_sizes))
        length = float(generator.choice(USUAL.unlisted_lengths))
        columns.append(unlisted_size * simulated[:, None] * likelihood.unlisted_root(length))
        variance = variance + (1.0 - USUAL.unlisted_smooth) * (unlisted_size * simulated) ** 2
    factors = np.hstack(columns)
    means = p.mean[0] + factors @ generator.standard_normal(factors.shape[1])
    means = means + np.sqrt(variance) * generator.standard_normal(len(variance))
    odd_points = generator.random(len(variance)) < USUAL.odd_share
    odd_errors = odd_points * USUAL.odd_size * p.mean[0]
    means = means + odd_errors * generator.standard_normal(len(variance))
    return np.asarray(np.maximum(means, MIN_TIME_S))


def _count(
    probability: float, bounds: tuple[float, float], total: int, generator: np.random.Generator
) -> int:
    mean = np.clip(probability, *bounds)
    strength = USUAL.late_known
    return int(generator.binomial(total, generator.beta(strength * mean, strength * (1.0 - mean))))


def _scatter(
    model: Model, p: Prediction, cell: int, count: int, generator: np.random.Generator
) -> Array:
    """Draw times over their deviation, of the baseline or of both modes, (count,)."""
    share = float(p.minor_share[0, cell])
    main_mode = float(p.main_offset[0, cell])
    main_sd = float(p.main_sd[0, cell])
    if share == 1.0:
        baseline = model.baseline
        times = mask_late(baseline.simulated.baseline_times, baseline.min_late_delay)
        standard_times = times[cell]
        standard_times = standard_times[np.isfinite(standard_times)]
        deviations = (standard_times - standard_times.mean()) / standard_times.std()
        return generator.choice(deviations, count)
    minor_mode = -main_mode * (1.0 - share) / share
    sd = float(p.sd[0, cell])
    minor_variance = sd**2 - (1.0 - share) * (main_sd**2 + main_mode**2) - share * minor_mode**2
    in_minor = generator.random(count) < share
    mode_sd = np.where(in_minor, np.sqrt(max(minor_variance / share, 0.0)), main_sd)
    mode = np.where(in_minor, minor_mode, main_mode)
    return (mode + mode_sd * generator.standard_normal(count)) / sd


def _readings(
    cell: Cell,
    row: int,
    times: Array,
    shift_count: int,
    *,
    kind: str,
    generator: np.random.Generator,
) -> list[Reading]:
    failed = shift_count - len(times)
    readings = [Reading(row, cell.point, failed, None, False)] if failed else []
    if kind == "singles":
        order = generator.permutation(times).tolist()
        return [*(Reading(row, cell.point, 1, t, True) for t in order), *readings]
    if len(times):
        spread = float(times.std(ddof=1)) if len(times) > 1 and generator.random() < 0.5 else None
        mean = float(times.mean())
        readings.append(Reading(row, cell.point, len(times), mean, True, sd=spread))
    return readings


def draw_and_diagnose(bench: Bench, model: Model, seed: int) -> Answer:
    """Draw and diagnose a set."""
    generator = np.random.default_rng(seed)
    truth = draw_truth(model, generator)
    kind = "means" if seed % 2 else "singles"
    drawn_bench = draw_cells(bench, model, truth, generator, kind)
    # Sets are drawn as predicted, so pairs must not be simulated.
    return compare_truth(truth, diagnose(drawn_bench, {"sleeve": replace(model, runner=None)}))


def compare_truth(truth: Truth, diagnosis: Inference) -> Answer:
    """Compare a diagnosis with the truth."""
    cause = UNKNOWN if "unknown" in truth.hypothesis else truth.hypothesis
    probability = diagnosis.evidence.get(cause, 0.0)
    fitted = diagnosis.fits.get(cause)
    ranks = list[float]()
    if fitted is not None:
        ranks = (fitted.shares < truth.shares).mean(axis=0).tolist()
    leading = max(diagnosis.evidence, key=lambda h: diagnosis.evidence[h])
    evidence = diagnosis.evidence
    return Answer(
        truth=list(truth.hypothesis),
        probability=probability,
        before=sum(value for value in evidence.values() if value > probability),
        leading=list(leading),
        leads=evidence[leading],
        pairs=sum(value for h, value in evidence.items() if len(h) == 2),
        p=fitted.p if fitted is not None else None,
        checks=dict(fitted.checks) if fitted is not None else {},
        ranks=ranks,
        verdict=diagnosis.verdict.kind,
        causes=list(diagnosis.verdict.causes),
        visible=diagnosis.posterior.get(cause, 0.0) > 0.5 * probability,
        seconds=diagnosis.seconds,
    )


def diagnose_set(bank: Path, seed: int) -> dict[str, Any]:
    """Draw and diagnose a set of the world."""
    # A worker process finds caches by their module, which here is another one's main program.
    from benchmarks import self_consistency as benchmark  # noqa: PLC0415

    return asdict(benchmark.draw_and_diagnose(*benchmark.load_world(bank), seed))


def diagnose_sets(count: int, jobs: int, path: Path, bank: Path) -> list[Answer]:
    """Diagnose a number of sets that a file lacks; return the answers of all."""
    rows = compute_rows(path, [(seed,) for seed in range(count)], partial(diagnose_set, bank), jobs)
    return [Answer(**row) for row in rows.values()]


def in_credible_set(answer: Answer, level: float = 0.9) -> bool:
    """Decide whether the set of the most probable hypotheses holds the truth."""
    return answer.before < level and answer.probability > 0.0


def cause_of(answer: Answer) -> tuple[str, ...]:
    """Name the true hypothesis, UNKNOWN where something unlisted acts."""
    return UNKNOWN if "unknown" in answer.truth else tuple(answer.truth)


def format_share(flags: Iterable[bool]) -> str:
    """Write a share with its interval."""
    interval = share(flags)
    if interval["value"] is None:
        return f"{'-':>20}{0:>6}"
    bounds = f"{interval['low']:.3f} to {interval['high']:.3f}"
    return f"{interval['value']:.3f} ({bounds}){interval['n']:>6}"


def print_figures(answers: Sequence[Answer]) -> None:
    """Print the figures that test the probabilities, and the shares of correct names."""
    hits = [(a.leads, tuple(a.leading) == cause_of(a)) for a in answers]
    ranks = np.concatenate([a.ranks for a in answers])
    ps = np.array([a.p for a in answers if a.p is not None])
    pairs = [a for a in answers if len(a.leading) == 2]
    for name, flags in (
        ("truth in the 90 % set", [in_credible_set(a) for a in answers]),
        ("truth in the 50 % set", [in_credible_set(a, 0.5) for a in answers]),
        ("leading hypothesis is the truth", [hit for _, hit in hits]),
        ("the same, a pair leads", [tuple(a.leading) == cause_of(a) for a in pairs]),
        ("named: the whole truth", [is_right(a) for a in answers if a.verdict == "effect"]),
        ("true sizes in 90 % intervals", abs(ranks - 0.5) < 0.45),
        ("predictive p below 0.05", ps < 0.05),
        ("predictive p below 0.01", ps < 0.01),
    ):
        print(f"{name:40}{format_share(flags)}")
    mean_probability = np.mean([p for p, _ in hits])
    print(f"{'probability of the leading one':40}{mean_probability:.3f}")
    mean = np.mean([a.leads for a in pairs]) if pairs else float("nan")
    print(f"{'the same, a pair leads':40}{mean:.3f}")
    acting = [a.leads - (tuple(a.leading) == cause_of(a)) for a in answers if len(cause_of(a)) == 2]
    print(f"{'a pair acts: probability less right':40}{np.mean(acting):.3f}")
    actual = np.mean([len(cause_of(a)) == 2 for a in answers])
    print(f"{'pairs: probability, share':40}{np.mean([a.pairs for a in answers]):.3f} {actual:.3f}")
    bins = np.minimum((10.0 * np.array([p for p, _ in hits])).astype(int), 9)
    error = abs(np.bincount(bins, [p - right for p, right in hits])).sum() / len(hits)
    print(f"{'calibration error, ten bins':40}{error:.3f}")
    print(f"{'ranks uniform, p of Kolmogorov':40}{kstest(ranks, 'uniform').pvalue:.3f}")
    print(f"{'p uniform, p of Kolmogorov':40}{kstest(ps, 'uniform').pvalue:.3f}")
    print(f"{'predictive p, quartiles':40}{np.quantile(ps, (0.25, 0.5, 0.75)).round(2)}")
    for part in sorted({name for a in answers for name in a.checks}):
        part_ps = np.array([a.checks[part] for a in answers if part in a.checks])
        quartiles = np.quantile(part_ps, (0.25, 0.5, 0.75)).round(2)
        print(
            f"{f'p of {part}: quartiles, below 0.01':40}{quartiles} {format_share(part_ps < 0.01)}"
        )
    seconds = np.array([a.seconds for a in answers])
    median, late_time = np.quantile(seconds, (0.5, 0.95))
    print(f"{'s of a decision, median and 95 %':40}{median:.1f} {late_time:.1f}")


def print_groups(answers: Sequence[Answer]) -> None:
    """Print the shares of correct leading and named hypotheses by size of the truth."""
    groups = {
        "none": lambda a: not a.truth,
        "one": lambda a: len(cause_of(a)) == 1 and cause_of(a) != UNKNOWN,
        "two": lambda a: len(cause_of(a)) == 2,
        "three": lambda a: len(cause_of(a)) > 2,
        "unknown": lambda a: cause_of(a) == UNKNOWN,
    }
    print(f"\n{'truth':10}{'in 90 % set':>30}{'leads':>30}{'named wholly':>30}{'named wrong':>30}")
    for name, belongs in groups.items():
        group = [a for a in answers if belongs(a)]
        columns = (
            [in_credible_set(a) for a in group],
            [tuple(a.leading) == cause_of(a) for a in group],
            [is_right(a) for a in group],
            [not set(a.causes) <= set(a.truth) for a in group],
        )
        print(f"{name:10}" + "".join(f"{format_share(flags):>30}" for flags in columns))


def is_right(answer: Answer) -> bool:
    """Decide whether the verdict is the whole truth."""
    cause = cause_of(answer)
    named = {"none": NONE, "unknown": UNKNOWN, "effect": tuple(answer.causes)}.get(answer.verdict)
    return named == cause


def compute_rows(
    path: Path, keys: Iterable[tuple[Any, ...]], work: Callable[..., Any], jobs: int
) -> dict[tuple[Any, ...], Any]:
    """Work out the row of each key that the file lacks, and give the rows of all keys in order.

    Parameters
    ----------
    work : gives the row of a key's parts as JSON; picklable where ``jobs`` is above one.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    rows = {tuple(key): row for key, row in map(json.loads, lines)}
    all_keys = list(keys)
    open_keys = [key for key in all_keys if key not in rows]
    pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
    with path.open("a", encoding="utf-8") as file:
        for key, row in pool(delayed(_row)(work, key) for key in open_keys):
            rows[key] = row
            file.write(json.dumps([key, row]) + "\n")
            file.flush()
    return {key: rows[key] for key in all_keys}


def _row(work: Callable[..., Any], key: tuple[Any, ...]) -> tuple[tuple[Any, ...], Any]:
    return key, work(*key)


def main() -> None:
    """Draw, diagnose and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kept", type=Path, default=ANSWERS_FILE)
    parser.add_argument("--bank", type=Path, default=BANK)
    arguments = parser.parse_args()
    load_world(arguments.bank)
    answers = diagnose_sets(arguments.sets, arguments.jobs, arguments.kept, arguments.bank)
    print(f"{len(answers)} sets drawn from the priors and the likelihood\n")
    print_figures(answers)
    print_groups(answers)


if __name__ == "__main__":
    main()
