"""Score of a field set by bands of the yardstick, all aims fixed before it was opened.

``headline`` has the figures of ``validation.blind.figures`` over all cases, and the same by
engine, clutch, kind and form. Shares have Wilson's 95 % interval.

A diagnosis counts effects that are too weak to be seen as none, so what it says is held against the
truth and, beside that, against what the data can show of it, which the key has. Its probabilities
by evidence, before that, are held against the truth itself. The advised test of each ambiguous case
is made by the engine of the case (``validation.blind.advised_test``).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.validation.blind.advised_test import (
    Advised,
    Stage,
    judged_by_test,
    settled_figures,
)
from dogshape.validation.blind.case_marks import Mark, Names, credible_of, mark_of, names_of
from dogshape.validation.blind.figures import CLEAR, HEADLINES, SEEN, SHOWN, scoring_code
from dogshape.validation.blind.intervals import Interval, calibration, mean, share
from dogshape.validation.blind.sealed import manifest_of, opened, results_of
from dogshape.validation.blind.stand import read_points, read_stand

Record = dict[str, Any]  #: key, results and score of a set, as they are kept in JSON

BINS = 10  #: of the calibration
CHANCES = 500  #: draws of its level by chance
SURE = 0.8  #: probability above which a hypothesis is settled on, and AICc counts as naming
NONE: Names = ()
LISTED = ("single", "pair", "three", "beyond", "other")


@dataclass(frozen=True)
class FieldMark:
    """Marks of one case with its engine, clutch and yardstick.

    ``noncentrality`` is 0 without any effect, ``rival`` the hypothesis that leaves it.
    ``open_with_test`` tells that the answer is left open and a test is advised, ``drift`` that a
    drift over the series is said: where there is one, no effect beside it is a right answer.
    ``off`` is by how many margins the engine without any effect is off the simulation, ``power``
    how often data of that size can show that this is within the margin; 0 with an effect.
    ``evidence`` are the probabilities before effects that cannot be seen count as none.
    """

    mark: Mark
    engine: str
    stand: str
    noncentrality: float
    rival: tuple[str, ...]
    open_with_test: bool
    drift: bool = False
    off: float = 0.0
    power: float = 0.0
    evidence: Mapping[Names, float] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Kind of the case."""
        return self.mark.kind

    @property
    def band(self) -> str:
        """Band of the yardstick."""
        if self.kind == "none":
            return "none"
        if self.noncentrality >= CLEAR:
            return "clear"
        return "between" if self.noncentrality >= SEEN else "hidden"

    @property
    def recognised(self) -> bool:
        """Test that what is outside the list is said to be unknown, or a drift to be one."""
        if self.mark.verdict in ("unknown", "refused"):
            return True
        return "drift" in self.mark.outside and self.drift and not self.mark.named

    @property
    def cause_open(self) -> bool:
        """Test that a test is advised to tell causes apart, and not the size of a gap alone."""
        return self.open_with_test and max(self.mark.chances.values()) <= SURE

    @property
    def in_credible(self) -> bool:
        """Test that the 90 % set holds the truth, or all of it that the data can show."""
        return any(one in self.mark.credible for one in (self.mark.truth, *self.mark.also))

    @property
    def leading_by_evidence(self) -> tuple[Names, float]:
        """Most probable hypothesis by evidence, and its probability."""
        return max(self.evidence.items(), key=lambda one: one[1])

    @property
    def named_wrongly(self) -> bool:
        """Test that a cause is named that is not the truth, no more and no less."""
        return self.mark.named and not self.mark.named_right


def score_field(folder: Path) -> Record:
    """Open the key of a field set whose cases are all diagnosed, and score.

    Raises StorageError where the key is not the sealed one, InputError where results are missing.
    """
    results, manifest = results_of(folder), manifest_of(folder)
    key = opened(folder)
    marks = [field_mark(n, truth, key, results[n]) for n, truth in key["cases"].items()]
    answers = {n: result.get("diagnosis", {}) for n, result in results.items()}
    tests = {
        one.mark.name: advised_test(folder, one, key["cases"][one.mark.name], mine)
        for one in marks
        if one.cause_open and "kind" in (mine := answers[one.mark.name])["next_test"]
    }
    foreseen = {name: chance_to_settle(answers[name]) for name in tests}
    found = scored_field(marks, tests, foreseen)
    return {"set": key["set"], "code": code_of(manifest), **found}


def chance_to_settle(diagnosis: Record) -> float | None:
    """Read the chance to settle of the test that a diagnosis advises; None where it has none."""
    advised = diagnosis["next_test"]["name"]
    mine = [one["chance_to_settle"] for one in diagnosis["tests"] if one["name"] == advised]
    return mine[0] if mine else None


def advised_test(folder: Path, one: FieldMark, truth: Record, diagnosis: Record) -> Advised:
    """Make the test that a diagnosis advises, with the truth of its case (of the key)."""
    name, grid = one.mark.name, folder / "stands" / one.stand

    def stage() -> Stage:
        return Stage(read_stand(folder / "cases" / name), read_points(grid), one.engine)

    return judged_by_test(name, truth, diagnosis, stage, one.mark.also)


def code_of(manifest: Mapping[str, Any]) -> Record:
    """Compare the scoring code and the list of figures with the sealed ones."""
    sealed, now = manifest.get("scoring_sha256", {}), scoring_code()
    changed = sorted(n for n in {*sealed, *now} if sealed.get(n) != now.get(n))
    figures = [asdict(one) for one in HEADLINES]
    return {"changed": changed, "figures_as_sealed": manifest.get("figures") == figures}


def field_mark(name: str, truth: Record, key: Record, result: Record) -> FieldMark:
    """Hold one result against the truth of its case (of the key)."""
    times = key["references"][f"{truth['engine']}_{truth['stand']}"]["times_s"]
    reference = {"reference_s": [times[k] for k in truth["places"]]}
    yard = truth["yardstick"]
    found = result.get("diagnosis", {})
    advised = bool(found.get("next_test", {}).get("name"))
    mark = mark_of(name, truth, reference, result)
    mark = replace(mark, also=between([names_of(p) for p in yard.get("seen_as", ())], mark.truth))
    evidence = {
        names_of(h["effects"]): float(h["evidence_probability"])
        for h in found.get("hypotheses", [])
    }
    drift = bool((found.get("drift") or {}).get("significant"))
    if drift and "drift" in mark.outside and NONE in mark.chances:
        mark = replace(mark, truth=NONE)
    return FieldMark(
        mark,
        truth["engine"],
        truth["stand"],
        float(yard.get("noncentrality", 0.0)),
        tuple(yard.get("rival", ())),
        mark.verdict == "ambiguous" and advised,
        drift,
        float(yard["engine_off_in_margins"]),
        float(yard.get("power", 0.0)),
        evidence,
    )


def between(seen: Sequence[Names], truth: Names) -> tuple[Names, ...]:
    """List what says no less than data can show of a truth, and no more than the truth.

    ``seen`` has the fewest causes that leave nothing visible; the truth itself is not listed.
    """
    parts = [p for size in range(len(truth)) for p in itertools.combinations(truth, size)]
    return tuple(part for part in parts if any(set(one) <= set(part) for one in seen))


def scored_field(
    marks: Sequence[FieldMark],
    tests: Mapping[str, Advised],
    foreseen: Mapping[str, float | None],
) -> Record:
    """Compute all figures from the marks of the cases, and the advised tests of some of them.

    ``foreseen`` has the chance to settle that the diagnosis gives each of these tests.
    """
    head = headline(marks, tests)
    return {
        "cases": len(marks),
        "headline": [
            {**asdict(one), "aim": one.aim, "figure": head[one.name],
             "met": one.met(head[one.name]["value"])}
            for one in HEADLINES
        ],
        "calibration_by_chance": by_chance(marks),
        "size_90": mean(float(len(m.mark.credible)) for m in marks if not m.mark.refused),
        "bands": _split(marks, lambda m: m.band, figures),
        "by_engine": _split(marks, lambda m: m.engine, lambda part: headline(part, tests)),
        "by_clutch": _split(marks, lambda m: m.stand, lambda part: headline(part, tests)),
        "by_kind": _split(marks, lambda m: m.kind, figures),
        "clear_by_kind": _split([m for m in marks if m.band == "clear"], lambda m: m.kind, figures),
        "by_form": _split(marks, lambda m: m.mark.form, figures),
        "outside": _split(
            [m for m in marks if m.kind == "outside"], lambda m: m.mark.outside[0], figures
        ),
        "plain": _plain(marks),
        "advised_test": settled_figures(len(tests), list(tests.values())),
        "advice_foreseen": mean(foreseen.values()),
        "time_s": mean(m.mark.time for m in marks),
        "marks": [_row(m, tests.get(m.mark.name)) for m in marks],
    }  # fmt: skip


def headline(marks: Sequence[FieldMark], tests: Mapping[str, Advised]) -> dict[str, Interval]:
    """Compute the headline figures of some cases, by name; ``tests`` are of any cases."""
    clear = [m for m in marks if m.band == "clear"]
    listed = [m.mark for m in clear if m.kind in LISTED]
    free = [m for m in marks if m.kind == "none"]
    none = [m.mark for m in free]
    replied = [m for m in marks if not m.mark.refused]
    answered = [m.mark for m in replied]
    made = [tests[m.mark.name] for m in marks if m.mark.name in tests]
    return {
        "cause_right": share(m.right_class for m in listed),
        "named_right": share(m.mark.named_right for m in marks if m.mark.named),
        "named_as_seen": share(m.mark.named_as_seen for m in marks if m.mark.named),
        "unknown_recognised": share(m.recognised for m in clear if m.kind == "outside"),
        "false_unknown": share(m.verdict in ("unknown", "refused") for m in listed),
        "both_of_a_pair": share(m.found == 2 for m in listed if m.kind == "pair"),
        "false_alarms": share(m.named for m in none),
        "none_said": share(m.verdict == "none" for m in none),
        "none_said_within": share(m.mark.verdict == "none" for m in free if m.off < 1.0),
        "none_said_shown": share(m.mark.verdict == "none" for m in free if m.power >= SHOWN),
        "coverage_90": share(m.truth in m.credible for m in answered),
        "coverage_90_seen": share(m.in_credible for m in replied),
        "coverage_90_evidence": share(m.mark.truth in credible_of(m.evidence) for m in replied),
        "calibration": calibration([[(m.chances[m.top], m.right)] for m in answered]),
        "calibration_seen": calibration(
            [[(m.chances[m.top], m.top in (m.truth, *m.also))] for m in answered]
        ),
        "calibration_evidence": calibration(
            [[(p, h == m.mark.truth)] for m in replied for h, p in [m.leading_by_evidence]]
        ),
        "named_wrongly_between": share(m.named_wrongly for m in marks if m.band == "between"),
        "left_open": share(m.open_with_test for m in marks if m.band == "hidden"),
        "advice_settled": share(one.settled for one in made),
        "advice_part": share(one.part for one in made),
        "advice_wrong": share(one.wrong and not one.part for one in made),
    }


def figures(marks: Sequence[FieldMark]) -> Record:
    """Compute the figures that any group of cases has."""
    mine = [m.mark for m in marks]
    return {
        "n": len(mine),
        "said": mean(one.leading_by_evidence[1] for one in marks if one.evidence),
        "so": share(one.leading_by_evidence[0] == one.mark.truth for one in marks if one.evidence),
        "said_seen": mean(m.chances[m.top] for m in mine if not m.refused),
        "so_seen": share(m.top in (m.truth, *m.also) for m in mine if not m.refused),
        "top_1": share(m.right for m in mine),
        "top_class": share(m.right_class for m in mine),
        "named": share(m.named for m in mine),
        "named_right": share(m.named_right for m in mine if m.named),
        "named_wrongly": share(m.named_wrongly for m in marks),
        "named_causes_true": share(m.causes_true for m in mine if m.causes),
        "unknown": share(m.verdict in ("unknown", "refused") for m in mine),
        "recognised": share(m.recognised for m in marks),
        "none": share(m.verdict == "none" for m in mine),
        "both_or_all_found": share(m.found == len(m.truth) for m in mine),
        "coverage_90": share(m.truth in m.credible for m in mine if not m.refused),
        "parameter_coverage_90": share(ok for m in mine if m.right for ok in m.inside),
    }


def by_chance(marks: Sequence[FieldMark], seed: int = 0) -> float | None:
    """Compute the calibration error that right probabilities would have at this number of cases."""
    tops = np.array([m.mark.chances[m.mark.top] for m in marks if not m.mark.refused])
    if not tops.size:
        return None
    came = np.random.default_rng(seed).random((CHANCES, tops.size)) < tops
    place = np.minimum((tops * BINS).astype(int), BINS - 1)
    inside = place[None] == np.arange(BINS)[:, None]
    apart = (tops - came) @ inside.T.astype(float)
    return float(abs(apart).sum(axis=1).mean() / tops.size)


def _split(
    marks: Sequence[FieldMark],
    key: Callable[[FieldMark], str],
    figures_of: Callable[[Sequence[FieldMark]], Any],
) -> Record:
    groups = sorted({key(m) for m in marks})
    return {group: figures_of([m for m in marks if key(m) == group]) for group in groups}


def _plain(marks: Sequence[FieldMark]) -> Record:
    """Count right answers of the plain baselines, beside the diagnosis on the same cases."""
    clear = [m.mark for m in marks if m.band == "clear" and m.kind == "single" and m.mark.weights]
    best = [(m, _heaviest(m)) for m in clear]
    sure = [
        (m.mark, _heaviest(m.mark))
        for m in marks
        if m.mark.weights and m.mark.weights[_heaviest(m.mark)] > SURE
    ]
    return {
        "diagnosis": share(m.right for m in clear),
        "smallest_rmse": share(m.plain == m.truth for m in clear),
        "aicc": share(h == m.truth for m, h in best),
        "aicc_named_right": share(h == m.truth for m, h in sure if h),
        "aicc_false_alarms": share(
            bool(_heaviest(m.mark)) and m.mark.weights[_heaviest(m.mark)] > SURE
            for m in marks
            if m.kind == "none" and m.mark.weights
        ),
        "aicc_calibration": calibration([[(m.weights[h], h == m.truth)] for m, h in best]),
    }


def _heaviest(mark: Mark) -> tuple[str, ...]:
    return max(mark.weights, key=lambda h: mark.weights[h])


def _row(one: FieldMark, test: Advised | None) -> Record:
    mark = one.mark
    return {
        "case": mark.name,
        "engine": one.engine,
        "clutch": one.stand,
        "kind": mark.kind,
        "form": mark.form,
        "truth": list(mark.truth),
        "outside": list(mark.outside),
        "noncentrality": one.noncentrality if math.isfinite(one.noncentrality) else None,
        "rival": list(one.rival),
        "band": one.band,
        "gap_in_errors": mark.gap if math.isfinite(mark.gap) else None,
        "verdict": mark.verdict,
        "causes": list(mark.causes),
        "top": list(mark.top),
        "probability": mark.chances.get(mark.top),
        "probability_of_truth": mark.chances.get(mark.truth, 0.0),
        "right": mark.right,
        "right_class": mark.right_class,
        "in_the_90_set": mark.truth in mark.credible,
        "open_with_test": one.open_with_test,
        "drift_said": one.drift,
        "engine_off_in_margins": one.off,
        "no_less_than_seen": [list(part) for part in (mark.truth, *mark.also)],
        "power": one.power,
        "advised_test": None if test is None else test.as_dict(),
        "time_s": mark.time,
    }
