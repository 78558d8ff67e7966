"""Score of a field set by its headline figures: their words and aims are sealed with the key.

A case is *clear* where the best refit by a rival leaves a noncentrality of ``CLEAR`` of its truth
(``validation.blind.yardstick``). The code that scores is sealed by its hashes.

A diagnosis counts effects that the data cannot show as absent. So a hypothesis is *as seen* where
it is the truth, or the part of it that the yardstick says the data can show. Names and leading
hypotheses of clear cases are held against the truth itself; the 90 % set, wrong names above 0.95
and advised tests also count what is as seen as right. The probability said of pairs is that by
evidence, before effects count as absent. Shares have Wilson's 95 % interval, means a bootstrap's.
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
NORMAL = 1.959964  #: of a two-sided 95 % interval
DRAWS = 2000  #: of a bootstrap
SHOWN = 0.9  #: power from which data without any effect can show that
SURE = 0.95  #: probability above which nothing may be wrong
OPEN = 0.8  #: probability up to which the cause is open
SCORING = ("score.py", "advised_test.py", "sealed.py")  #: files that score


@dataclass(frozen=True)
class Headline:
    """A headline figure: its name in the score, its words, and from and to where its aim lies.

    One without ends has no aim; it is given beside the others.
    """

    name: str
    words: str
    low: float | None = None
    high: float | None = None
    percent: bool = True

    @property
    def aim(self) -> str:
        """Write the aim."""
        end = self.high if self.low is None else self.low
        if end is None:
            return ""
        text = f"{100.0 * end:.0f} %" if self.percent else f"{end:g}"
        return f"at {'most' if self.low is None else 'least'} {text}"

    def met(self, value: float | None) -> bool | None:
        """Decide whether a value meets the aim; None for no value or no aim."""
        if value is None or not self.aim:
            return None
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


HEADLINES = (
    Headline("named", "clear cause: named", 0.72),
    Headline("leads", "clear cause: leads", 0.92),
    Headline("whole_truth", "named: the whole truth", 0.90),
    Headline("whole_seen", "named: the whole truth that data can show"),
    Headline("wrong_sure", "named above 0.95: wrong", None, 0.0),
    Headline("false_alarms", "no effect: one is named", None, 0.01),
    Headline("none_shown", "no effect, and data can show it: none said", 0.85),
    Headline("unknown", "clear, outside the list: unknown said", 0.85),
    Headline("credible", "90 % set holds the truth", 0.88),
    Headline("sizes", "90 % intervals hold the sizes", 0.85),
    Headline("pairs_said", "pairs: probability said less share right", None, 0.15, percent=False),
    Headline("pairs_lead", "a pair leads: probability said less right", percent=False),
    Headline("test_settles", "cause open: the advised test settles it", 0.50),
    Headline("test_misleads", "cause open: the advised test misleads", None, 0.05),
    Headline("test_foreseen", "advised test: foreseen less realised", None, 0.10, percent=False),
    Headline("cpu_s", "processor time of a decision, s", None, 5.0, percent=False),
    Headline("p_median", "p-value of right answers, median", percent=False),
    Headline("p_uniform", "p-values of right answers against uniform", 0.05, percent=False),
)


def scoring_code() -> dict[str, str]:
    """Hash the files of the scoring code, by name."""
    here = Path(__file__).resolve().parent
    return {name: hashlib.sha256((here / name).read_bytes()).hexdigest() for name in SCORING}


class Interval(TypedDict):
    """Value of ``n`` cases with the ends of its 95 % interval; None where there is no case."""

    value: float | None
    low: float | None
    high: float | None
    n: int


def share(flags: Iterable[bool]) -> Interval:
    """Compute a share with Wilson's 95 % interval: ``value``, ``low``, ``high``, ``n``."""
    given = list(flags)
    n = len(given)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's exact quantile would change the ninth digit of records that are kept.
    p, z2 = sum(given) / n, NORMAL**2
    middle = (p + z2 / (2 * n)) / (1.0 + z2 / n)
    half = NORMAL / (1.0 + z2 / n) * math.sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n))
    return {"value": p, "low": max(0.0, middle - half), "high": min(1.0, middle + half), "n": n}


def mean(values: Iterable[float | None], seed: int = 0) -> Interval:
    """Compute a mean with a bootstrap's 95 % interval; None among the values are left out."""
    given = np.array([v for v in values if v is not None], dtype=float)
    n = len(given)
    if n == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    # By hand: scipy's bootstrap refuses a single value, and a set may have no more.
    generator = np.random.default_rng(seed)
    drawn = given[generator.integers(n, size=(DRAWS, n))].mean(axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return {"value": float(given.mean()), "low": float(low), "high": float(high), "n": n}


@dataclass(frozen=True)
class Mark:
    """Truth of a case beside its diagnosis; hypotheses are names in alphabetical order.

    ``also`` is what the truth looks like to any method, but for causes that data cannot show.
    ``clear`` if no rival can be taken for the truth, ``shown`` if data without any effect can show
    that. ``inside``: for each true size whether its 90 % interval holds it, where the truth leads.
    ``p`` is the predictive p-value of the leading hypothesis.
    """

    name: str
    kind: str
    form: str
    engine: str
    truth: Names
    also: tuple[Names, ...]
    outside: Names
    clear: bool
    shown: bool
    verdict: str
    causes: Names
    posterior: Mapping[Names, float]
    evidence: Mapping[Names, float]
    credible: tuple[Names, ...]
    inside: tuple[bool, ...]
    p: float | None
    cpu: float
    advised: Advised | None = None

    @property
    def top(self) -> Names:
        """Most probable hypothesis; unknown where the data were refused."""
        return max(self.posterior, key=lambda h: self.posterior[h], default=UNKNOWN)

    @property
    def named(self) -> bool:
        """Test that the diagnosis names a cause."""
        return self.verdict == "effect"

    @property
    def seen(self) -> tuple[Names, ...]:
        """Truth, and what of it the data can show."""
        return (self.truth, *self.also)

    @property
    def said_less_right(self) -> float | None:
        """Probability of the leading hypothesis by evidence, less 1 where that is the truth."""
        if not self.evidence:
            return None
        return self.evidence[self.likeliest] - (self.likeliest == self.truth)

    @property
    def likeliest(self) -> Names:
        """Most probable hypothesis by evidence; none where the data were refused."""
        return max(self.evidence, key=lambda h: self.evidence[h], default=())

    def row(self) -> Record:
        """Write the row of the case."""
        record = {
            n: getattr(self, n) for n in ("name", "kind", "form", "engine", "clear", "verdict")
        }
        probability = self.posterior.get(self.top, 1.0)
        more = {"test": asdict(self.advised)} if self.advised else {}
        return record | {
            "truth": list(self.truth),
            "outside": list(self.outside),
            "causes": list(self.causes),
            "top": list(self.top),
            "probability": probability,
            "in_set": any(one in self.credible for one in self.seen),
            "p": self.p,
            **more,
        }


def score_field(
    folder: Path, advise: Advise, jobs: int = 1, advance: sealed.Advance = sealed.ignore
) -> Record:
    """Open the key of a field set whose cases are all diagnosed, and score.

    ``advise`` makes the advised test of a case; it has to be picklable where ``jobs`` is above one.
    Raises StorageError where the key is not the sealed one, InputError where results are missing.
    """
    results, manifest = sealed.results_of(folder), sealed.manifest_of(folder)
    cases = sealed.opened(folder)["cases"].items()
    calls = [(folder, name, truth, results[name], advise) for name, truth in cases]
    marks = sealed.run_all(mark_of, calls, jobs, advance)
    then, now = manifest["scoring_sha256"], scoring_code()
    code = {
        "changed": sorted(n for n in {*then, *now} if then.get(n) != now.get(n)),
        "figures_as_sealed": manifest["figures"] == [asdict(one) for one in HEADLINES],
    }
    return {"code": code, **scored(marks)}


def mark_of(folder: Path, name: str, truth: Record, result: Record, advise: Advise) -> Mark:
    """Hold one result against the truth of its case (of the key)."""
    found: Record = result.get("diagnosis", {})
    every = {tuple(h["effects"]): h for h in found.get("hypotheses", ())}
    yard, causes = truth["yardstick"], tuple(truth["causes"])
    also = between([tuple(p) for p in yard.get("seen_as", ())], causes)
    posterior = {h: float(one["probability"]) for h, one in every.items()}
    top = max(posterior, key=lambda h: posterior[h], default=UNKNOWN)
    sizes = {n: v for values in truth["parameters"].values() for n, v in values.items()}
    given: Record = every.get(top, {}).get("parameters", {}) if top == causes else {}
    open_ = found.get("verdict") == "ambiguous" and posterior[top] <= OPEN and found["next_test"]
    return Mark(
        name=name,
        kind=truth["kind"],
        form=truth["form"],
        engine=truth["engine"],
        truth=causes,
        also=also,
        outside=tuple(truth["outside"]),
        clear=yard.get("noncentrality", 0.0) >= CLEAR,
        shown=yard.get("power", 0.0) >= SHOWN,
        verdict=found.get("verdict", "refused"),
        causes=tuple(sorted(found.get("causes", ()))),
        posterior=posterior,
        evidence={h: float(one["evidence_probability"]) for h, one in every.items()},
        credible=tuple(tuple(sorted(h)) for h in found.get("credible_set", ())),
        inside=tuple(
            given[n]["low"] <= v <= given[n]["high"] for n, v in sizes.items() if n in given
        ),
        p=every.get(top, {}).get("predictive_p"),
        cpu=float(result["cpu_s"]),
        advised=advise(folder / "cases" / name, truth, (causes, *also)) if open_ else None,
    )


def between(seen: Sequence[Names], truth: Names) -> tuple[Names, ...]:
    """List what says no less than data can show of a truth, and less than the truth.

    ``seen`` has the fewest causes that leave nothing visible.
    """
    parts = [p for size in range(len(truth)) for p in itertools.combinations(truth, size)]
    return tuple(part for part in parts if any(set(one) <= set(part) for one in seen))


def scored(marks: Sequence[Mark]) -> Record:
    """Compute all figures from the marks of the cases."""
    head = headline(marks)
    return {
        "cases": len(marks),
        "clear": sum(m.clear for m in marks),
        "headline": [
            {**asdict(one), "aim": one.aim, "figure": head[one.name],
             "met": one.met(head[one.name]["value"])}
            for one in HEADLINES
        ],
        **{
            f"by_{key}": {
                group: headline([m for m in marks if getattr(m, key) == group])
                for group in sorted({getattr(m, key) for m in marks})
            }
            for key in ("form", "engine", "kind")
        },
        "marks": [m.row() for m in marks],
    }  # fmt: skip


def headline(marks: Sequence[Mark]) -> dict[str, Interval]:
    """Compute the headline figures of some cases, by name."""
    listed = [m for m in marks if m.clear and m.kind != "outside"]
    outside = [m for m in marks if m.clear and m.kind == "outside"]
    none, named = [m for m in marks if m.kind == "none"], [m for m in marks if m.named]
    sure = [m for m in named if m.posterior.get(m.top, 0.0) > SURE]
    tests = [m.advised for m in marks if m.advised is not None]
    p = [m.p for m in marks if m.p is not None and m.top in m.seen]
    return {
        "named": share(m.named and m.causes == m.truth for m in listed),
        "leads": share(m.top == m.truth for m in listed),
        "whole_truth": share(m.causes == m.truth for m in named),
        "whole_seen": share(m.causes in m.seen for m in named),
        "wrong_sure": share(m.causes not in m.seen for m in sure),
        "false_alarms": share(m.named for m in none),
        "none_shown": share(m.verdict == "none" for m in none if m.shown),
        "unknown": share(m.verdict in ("unknown", "refused") for m in outside),
        "credible": share(any(one in m.credible for one in m.seen) for m in marks if m.posterior),
        "sizes": share(inside for m in marks for inside in m.inside),
        "pairs_said": mean(m.said_less_right for m in marks if m.kind == "pair"),
        "pairs_lead": mean(m.said_less_right for m in marks if len(m.likeliest) == 2),
        "test_settles": share(one.settled for one in tests),
        "test_misleads": share(one.misled for one in tests),
        "test_foreseen": mean(one.foreseen - one.settled for one in tests),
        "cpu_s": mean(m.cpu for m in marks),
        "p_median": _alone(float(np.median(p)) if p else None, len(p)),
        "p_uniform": _alone(float(kstest(p, "uniform").pvalue) if len(p) > 1 else None, len(p)),
    }


def _alone(value: float | None, n: int) -> Interval:
    return {"value": value, "low": value, "high": value, "n": n}
