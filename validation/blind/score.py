"""Score of a field set by its headline figures: their words and aims are sealed with the key.

A case is *clear* where the best refit by a rival leaves a noncentrality of ``CLEAR`` of its truth
(``validation.blind.yardstick``). The code that scores is sealed by its hashes.

A diagnosis counts invisible effects as absent. So a hypothesis is *as seen* where it is the truth,
or the part of it that the data can show by the yardstick. Names and leading hypotheses of clear
cases are compared with the truth itself; for the 90 % set, wrong names above 0.95 and advised tests
a hypothesis as seen is right too. An open verdict names *parts*: effects whose probability is above
0.95. The stated probability of pairs is that by evidence, before effects count as absent. Shares
have Wilson's 95 % interval, means and medians a bootstrap's.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from scipy.stats import kstest

from dogshape.validation.blind import sealed
from dogshape.validation.blind.advised_test import Advised

Record = dict[str, Any]  #: key, results and score of a set, as they are kept in JSON
Names = tuple[str, ...]
#: Advised test of the case in a folder, by its truth in the key; None where there is none.
Advise = Callable[[Path, Record, Sequence[Names]], Advised | None]

UNKNOWN: Names = ("unknown",)
CLEAR = 38.0  #: noncentrality from which a truth is clear
NORMAL_95 = 1.959964  #: half width of a 95 % interval, standard deviations
BOOTSTRAP_DRAWS = 2000
MIN_POWER = 0.9  #: from which data without any effect can show that
SURE_PROBABILITY = 0.95  #: above which a name has to be right
OPEN_PROBABILITY = 0.8  #: up to which the cause is open
SCORING_FILES = ("score.py", "advised_test.py", "sealed.py")


@dataclass(frozen=True)
class Headline:
    """Headline figure with its aim; without bounds it has none."""

    name: str  #: in the score
    words: str  #: in a table
    low: float | None = None  #: lower bound of the aim
    high: float | None = None  #: upper bound of the aim
    percent: bool = True

    @property
    def aim(self) -> str:
        """Text of the aim, '' for none."""
        if self.low is not None and self.high is not None:
            return f"{self._text(self.low)} to {self._text(self.high)}"
        if self.low is not None:
            return f"at least {self._text(self.low)}"
        return "" if self.high is None else f"at most {self._text(self.high)}"

    def _text(self, bound: float) -> str:
        return f"{100.0 * bound:.0f} %" if self.percent else f"{bound:g}"

    def meets_aim(self, value: float | None) -> bool | None:
        """Test whether a value meets the aim; None without value or aim."""
        if value is None or not self.aim:
            return None
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


HEADLINES = (
    Headline("single_named", "clear single cause: named", 0.85),
    Headline("pair_named", "clear pair: both named", 0.65),
    Headline("pair_part", "clear pair: at least one named", 0.95),
    Headline("leads", "clear cause: leads", 0.92),
    Headline("true_names", "named, whole or in part: all of it acts", 0.95),
    Headline("whole_truth", "named as the whole: the whole truth", 0.90),
    Headline("whole_seen", "named as the whole: the whole truth that data can show"),
    Headline("wrong_sure", "named above 0.95, whole or in part: wrong", None, 0.0),
    Headline("false_alarms", "no effect: one is named", None, 0.0),
    Headline("none_shown", "no effect, and data can show it: none said", 0.80),
    Headline("outside_silent", "clear, outside the list: no effect named", 0.90),
    Headline("unknown", "clear, outside the list: unknown said", 0.60),
    Headline("credible", "90 % set holds the truth", 0.88),
    Headline("sizes", "90 % intervals hold the sizes", 0.86),
    Headline("pairs_said", "pairs: probability said less share right", None, 0.15, percent=False),
    Headline("test_rise", "cause open: the advised test lifts the truth by", 0.20, percent=False),
    Headline("best_rise", "the same by the best test in hindsight", percent=False),
    Headline("test_misleads", "cause open: the advised test misleads", None, 0.05),
    Headline(
        "test_foreseen", "advised test: gain foreseen less realised", None, 0.10, percent=False
    ),
    Headline("cpu_s", "processor time of a decision, s, median", None, 15.0, percent=False),
    Headline("p_median", "p-value of right answers, median", 0.4, 0.6, percent=False),
    Headline("p_uniform", "p-values of right answers against uniform", 0.05, percent=False),
)


def scoring_code() -> dict[str, str]:
    """Hash the files of the scoring code, by name."""
    folder = Path(__file__).resolve().parent
    return {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in SCORING_FILES
    }


class Interval(TypedDict):
    """Value of ``n`` cases with its 95 % interval; None without cases."""

    value: float | None
    low: float | None
    high: float | None
    n: int


def share(flags: Iterable[bool]) -> Interval:
    """Compute a share of flags with Wilson's 95 % interval."""
    outcomes = list(flags)
    n = len(outcomes)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's exact quantile would change the ninth digit of records that are kept.
    p = sum(outcomes) / n
    z2 = NORMAL_95**2
    centre = (p + z2 / (2 * n)) / (1.0 + z2 / n)
    half_width = NORMAL_95 / (1.0 + z2 / n) * math.sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n))
    return {
        "value": p,
        "low": max(0.0, centre - half_width),
        "high": min(1.0, centre + half_width),
        "n": n,
    }


def average(
    values: Iterable[float | None], statistic: Callable[..., Any] = np.mean, seed: int = 0
) -> Interval:
    """Compute the mean, or the median, of values that are not None.

    The 95 % interval is a bootstrap's.
    """
    sample = np.array([v for v in values if v is not None], dtype=float)
    n = len(sample)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's bootstrap refuses a single value, and a set may have no more.
    generator = np.random.default_rng(seed)
    redrawn = statistic(sample[generator.integers(n, size=(BOOTSTRAP_DRAWS, n))], axis=1)
    low, high = np.quantile(redrawn, (0.025, 0.975))
    return {"value": float(statistic(sample)), "low": float(low), "high": float(high), "n": n}


@dataclass(frozen=True)
class Mark:
    """Truth of a case beside its diagnosis; hypotheses are names in alphabetical order."""

    name: str
    kind: str
    form: str
    engine: str
    truth: Names
    visible: tuple[Names, ...]  #: parts of the truth that the data cannot tell from it
    outside: Names
    clear: bool  #: no rival fits the truth
    shown: bool  #: data without any effect can show that
    verdict: str
    causes: Names  #: named as the whole, or as parts of it
    posterior: Mapping[Names, float]
    evidence: Mapping[Names, float]
    credible: tuple[Names, ...]
    inside: tuple[bool, ...]  #: of each true size: 90 % interval has it, where the truth leads
    p: float | None  #: predictive p-value of the leading hypothesis
    cpu: float  #: processor time, s
    advised: Advised | None = None

    @property
    def top(self) -> Names:
        """Most probable hypothesis; unknown where the data were refused."""
        return max(self.posterior, key=lambda h: self.posterior[h], default=UNKNOWN)

    @property
    def named(self) -> bool:
        """Whether the diagnosis names a cause."""
        return self.verdict == "effect"

    @property
    def seen(self) -> tuple[Names, ...]:
        """Truth, and its parts that the data cannot tell from it."""
        return (self.truth, *self.visible)

    @property
    def overconfidence(self) -> float | None:
        """Probability of the leading hypothesis by evidence, less 1 where that is the truth."""
        if not self.evidence:
            return None
        correct = self.evidence_top == self.truth
        return self.evidence[self.evidence_top] - correct

    @property
    def evidence_top(self) -> Names:
        """Most probable hypothesis by evidence; none where the data were refused."""
        return max(self.evidence, key=lambda h: self.evidence[h], default=())

    @property
    def is_wrong(self) -> bool:
        """Whether a part that is named does not act, or a whole is not the truth as seen."""
        return self.causes not in self.seen if self.named else not {*self.causes} <= {*self.truth}

    @property
    def in_credible_set(self) -> bool:
        """Whether the credible set has the truth as seen."""
        return any(hypothesis in self.credible for hypothesis in self.seen)

    def row(self) -> Record:
        """Return the row of the case."""
        row: Record = {
            "name": self.name,
            "kind": self.kind,
            "form": self.form,
            "engine": self.engine,
            "clear": self.clear,
            "verdict": self.verdict,
            "truth": list(self.truth),
            "outside": list(self.outside),
            "causes": list(self.causes),
            "top": list(self.top),
            "probability": self.posterior.get(self.top, 1.0),
            "in_set": self.in_credible_set,
            "p": self.p,
        }
        if self.advised:
            row["test"] = asdict(self.advised)
        return row


def score_field(
    folder: Path,
    advise: Advise | None,
    jobs: int = 1,
    advance: sealed.Advance = sealed.ignore,
    results_name: str = sealed.RESULTS,
) -> Record:
    """Open the key of a field set whose cases are all diagnosed, and score.

    ``advise`` makes the advised test of a case; it has to be picklable for ``jobs`` above 1. With
    None, as for the results of another method, no advice is scored. StorageError where the key is
    not the sealed one, InputError where results are missing.
    """
    results = sealed.results_of(folder, results_name)
    manifest = sealed.manifest_of(folder)
    truths = sealed.open_key(folder)["cases"]
    calls = [(folder, name, truth, results[name], advise) for name, truth in truths.items()]
    marks = sealed.run_all(mark_of, calls, jobs, advance)
    sealed_code = manifest["scoring_sha256"]
    code = scoring_code()
    changed = [name for name in {*sealed_code, *code} if sealed_code.get(name) != code.get(name)]
    as_sealed = manifest["figures"] == [asdict(headline) for headline in HEADLINES]
    return {
        "code": {"changed": sorted(changed), "figures_as_sealed": as_sealed},
        **score_marks(marks),
    }


def mark_of(folder: Path, name: str, truth: Record, result: Record, advise: Advise | None) -> Mark:
    """Compare the result of a case with its truth, an entry of the key.

    A result needs verdict, causes, hypotheses with their probabilities, and credible set.
    """
    diagnosis: Record = result.get("diagnosis", {})
    hypotheses = {tuple(h["effects"]): h for h in diagnosis.get("hypotheses", ())}
    yardstick = truth["yardstick"]
    causes = tuple(truth["causes"])
    visible = visible_parts([tuple(part) for part in yardstick.get("seen_as", ())], causes)
    posterior = {h: float(record["probability"]) for h, record in hypotheses.items()}
    evidence = {
        h: float(record.get("evidence_probability", record["probability"]))
        for h, record in hypotheses.items()
    }
    top = max(posterior, key=lambda h: posterior[h], default=UNKNOWN)
    top_record: Record = hypotheses.get(top, {})
    inside = _sizes_inside(truth, top_record) if top == causes else ()
    advised = None
    is_open = diagnosis.get("verdict") == "ambiguous" and posterior[top] <= OPEN_PROBABILITY
    if advise is not None and is_open and diagnosis["next_test"]:
        advised = advise(folder / "cases" / name, truth, (causes, *visible))
    return Mark(
        name=name,
        kind=truth["kind"],
        form=truth["form"],
        engine=truth["engine"],
        truth=causes,
        visible=visible,
        outside=tuple(truth["outside"]),
        clear=yardstick.get("noncentrality", 0.0) >= CLEAR,
        shown=yardstick.get("power", 0.0) >= MIN_POWER,
        verdict=diagnosis.get("verdict", "refused"),
        causes=tuple(sorted(diagnosis.get("causes", ()))),
        posterior=posterior,
        evidence=evidence,
        credible=tuple(tuple(sorted(h)) for h in diagnosis.get("credible_set", ())),
        inside=inside,
        p=top_record.get("predictive_p"),
        cpu=float(result["cpu_s"]),
        advised=advised,
    )


def _sizes_inside(truth: Record, hypothesis: Record) -> tuple[bool, ...]:
    """Test for each true size whether the interval of a hypothesis has it."""
    intervals: Record = hypothesis.get("parameters", {})
    inside = []
    for values in truth["parameters"].values():
        for name, value in values.items():
            if name in intervals:
                inside.append(intervals[name]["low"] <= value <= intervals[name]["high"])
    return tuple(inside)


def visible_parts(smallest: Sequence[Names], truth: Names) -> tuple[Names, ...]:
    """List proper subsets of a truth with all causes of a smallest visible part.

    ``smallest`` are the subsets with the fewest causes that the data cannot tell from the truth.
    """
    parts = []
    for size in range(len(truth)):
        for part in itertools.combinations(truth, size):
            if any(set(causes) <= set(part) for causes in smallest):
                parts.append(part)
    return tuple(parts)


def score_marks(marks: Sequence[Mark]) -> Record:
    """Compute all figures from the marks of the cases."""
    figures = headline(marks)
    rows = []
    for figure in HEADLINES:
        interval = figures[figure.name]
        row = {**asdict(figure), "aim": figure.aim, "figure": interval}
        rows.append({**row, "met": figure.meets_aim(interval["value"])})
    groups = {f"by_{key}": _headline_by(marks, key) for key in ("form", "engine", "kind")}
    return {
        "cases": len(marks),
        "clear": sum(m.clear for m in marks),
        "headline": rows,
        **groups,
        "marks": [m.row() for m in marks],
    }


def _headline_by(marks: Sequence[Mark], key: str) -> dict[str, dict[str, Interval]]:
    """Compute the headline figures of groups of cases by a field of their marks."""
    values = sorted({getattr(m, key) for m in marks})
    return {value: headline([m for m in marks if getattr(m, key) == value]) for value in values}


def headline(marks: Sequence[Mark]) -> dict[str, Interval]:
    """Compute the headline figures of cases, by name."""
    listed = [m for m in marks if m.clear and m.kind != "outside"]
    singles = [m for m in listed if m.kind == "single"]
    pairs = [m for m in listed if m.kind == "pair"]
    outside = [m for m in marks if m.clear and m.kind == "outside"]
    none = [m for m in marks if m.kind == "none"]
    named = [m for m in marks if m.named]
    in_part = [m for m in marks if m.named or m.causes]
    sure = [m for m in in_part if not m.named or m.posterior.get(m.top, 0.0) > SURE_PROBABILITY]
    tests = [m.advised for m in marks if m.advised is not None]
    p_values = [m.p for m in marks if m.p is not None and m.top in m.seen]
    p_median = float(np.median(p_values)) if p_values else None
    p_uniform = float(kstest(p_values, "uniform").pvalue) if len(p_values) > 1 else None
    return {
        "single_named": share(m.named and m.causes == m.truth for m in singles),
        "pair_named": share(m.named and m.causes == m.truth for m in pairs),
        "pair_part": share(not {*m.truth}.isdisjoint(m.causes) for m in pairs),
        "leads": share(m.top == m.truth for m in listed),
        "true_names": share({*m.causes} <= {*m.truth} for m in in_part),
        "whole_truth": share(m.causes == m.truth for m in named),
        "whole_seen": share(m.causes in m.seen for m in named),
        "wrong_sure": share(m.is_wrong for m in sure),
        "false_alarms": share(m.named for m in none),
        "none_shown": share(m.verdict == "none" for m in none if m.shown),
        "outside_silent": share(not m.causes for m in outside),
        "unknown": share(m.verdict in ("unknown", "refused") for m in outside),
        "credible": share(m.in_credible_set for m in marks if m.posterior),
        "sizes": share(inside for m in marks for inside in m.inside),
        "pairs_said": average(m.overconfidence for m in marks if m.kind == "pair"),
        "test_rise": average(test.rise for test in tests),
        "best_rise": average(test.best_rise for test in tests),
        "test_misleads": share(test.misled for test in tests),
        "test_foreseen": average(test.foreseen - test.realised for test in tests),
        "cpu_s": average((m.cpu for m in marks), np.median),
        "p_median": _without_interval(p_median, len(p_values)),
        "p_uniform": _without_interval(p_uniform, len(p_values)),
    }


def _without_interval(value: float | None, n: int) -> Interval:
    return {"value": value, "low": value, "high": value, "n": n}
