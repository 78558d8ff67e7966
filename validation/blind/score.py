"""Score of a diagnosis on sealed cases: opened once, every figure with its interval.

Shares have Wilson's 95 % interval, means a bootstrap's over cases. ``visible`` are the cases whose
gap is at least two sampling errors of the means (root mean square over the operating points). An
effect of a pair is visible by the same limit beside its fixed partner; by the other yardstick it
needs two standard errors in all after the best fit of its partner alone
(``validation.blind.pair_visibility``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dogshape.diagnosis.inference.classes import in_short
from dogshape.sim.errors import InputError
from dogshape.validation.blind.advised_test import (
    Advised,
    advised_tests,
    settled_figures,
    shifts_asked,
    stage_of,
)
from dogshape.validation.blind.case_marks import Mark, Names, mark_of
from dogshape.validation.blind.equivalence import equivalence_figures, true_means
from dogshape.validation.blind.intervals import calibration, mean, median, share
from dogshape.validation.blind.pair_refit import Seen
from dogshape.validation.blind.pair_visibility import Sizes, partner_gaps, shifts_left
from dogshape.validation.blind.sealed import opened, results_of

Record = dict[str, Any]  #: key, results and score of a set, as they are kept in JSON

VISIBLE = 2.0  #: sampling errors
STRENGTHS = ("none", "barely", "clear", "gross")
KINDS = ("none", "single", "pair", "three", "beyond", "other", "outside")
FORMS = ("means", "singles", "traces")


class Progress(Protocol):
    """Listener to shifts that are to come and to finished ones."""

    def extend(self, count: int) -> None:
        """Expect more shifts."""

    def advance(self, count: int) -> None:
        """Count finished shifts."""


def score(
    folder: Path,
    seen: Callable[[Path], Seen],
    progress: Progress | None = None,
    jobs: int = 1,
) -> Record:
    """Open the key of a set whose cases are all diagnosed, and score.

    Makes the tests that were advised where a case is ambiguous, and what each effect of a pair
    makes by itself. ``seen`` says with what a pair's folder
    is diagnosed. Both are left out of a set that MuJoCo did not make, which has no diagnosis
    that was told anything either.

    Raises StorageError where the key is not the sealed one, InputError where results are missing.
    """
    results = results_of(folder)
    key = opened(folder)
    if key.get("engine", "mujoco") != "mujoco":
        marks = [mark_of(n, truth, key, results[n]) for n, truth in key["cases"].items()]
        first = next(iter(key["cases"]))
        stage = stage_of(folder, key, first)
        true = true_means(stage.stand, stage.points, key["cases"], key["engine"])
        simulated = seen(folder / "cases" / first).simulated(key["points"])
        return {**scored(marks), "equivalence": equivalence_figures(true, simulated, results)}
    if progress is not None:
        progress.extend(shifts_left(folder, key) + shifts_asked(results))
    advance = None if progress is None else progress.advance
    marks = [mark_of(n, truth, key, results[n]) for n, truth in key["cases"].items()]
    sizes = partner_gaps(folder, key, seen, jobs, advance)
    found = scored(marks, advised_tests(folder, key, results, advance), sizes)
    answered = {n: _told(result) for n, result in results.items()}
    beside = [mark_of(n, truth, key, answered[n]) for n, truth in key["cases"].items()]
    return {**found, "told": scored(beside, None, sizes)}


def _told(result: Record) -> Record:
    """Return a result as that of the diagnosis which knew what both engines differ by.

    Raises InputError where it was not made.
    """
    if "diagnosis" not in result:
        return result
    if "told" not in result["diagnosis"]:
        raise InputError(
            "results have no diagnosis that was told what both engines differ by, but the score "
            "needs one for each case; remove the folder results and go on with: "
            "dogshape blind run DIR"
        )
    return {**result, "diagnosis": result["diagnosis"]["told"]}


def scored(
    marks: Sequence[Mark],
    advised: Mapping[str, Advised] | None = None,
    sizes: Mapping[str, Sizes] | None = None,
) -> Record:
    """Compute all figures from the marks of the cases.

    ``advised`` is what advised tests told, and ``sizes`` those of the effects of pairs, both by
    case.
    """
    answered, pairs = advised or {}, sizes or {}
    least = {name: min(size.beside for size in mine.values()) for name, mine in pairs.items()}
    after = {name: min(size.after for size in mine.values()) for name, mine in pairs.items()}
    marks = [replace(m, also=looks_like(m, pairs.get(m.name, {}))) for m in marks]
    visible = [m for m in marks if m.gap >= VISIBLE]
    return {
        "cases": len(marks),
        "all": figures(marks),
        "visible": figures(visible),
        "visible_inside": figures([m for m in visible if m.kind != "outside"]),
        "singles_by_strength": _split(
            [m for m in marks if m.kind == "single"], lambda m: m.strength, STRENGTHS[1:]
        ),
        "by_kind": _split(marks, lambda m: m.kind, KINDS),
        "by_form": _split(marks, lambda m: m.form, FORMS),
        "none": _none(marks),
        "pairs": _pairs(marks),
        "pairs_visible": _pairs(visible),
        "pairs_both_visible": _pairs([m for m in marks if least.get(m.name, 0.0) >= VISIBLE]),
        "pairs_visible_after_refit": _pairs(
            [m for m in marks if after.get(m.name, 0.0) >= VISIBLE]
        ),
        "outside": _outside(marks),
        "outside_visible": _outside(visible),
        "advised_test": {
            "all": _advised(marks, answered),
            "visible": _advised(visible, answered),
        },
        "shrink": _shrink(marks),
        "plain": _plain(marks),
        "confusion": _confusion(marks),
        "time_s": {
            "mean": mean(m.time for m in marks),
            "largest": max((m.time for m in marks), default=None),
        },
        "marks": [_row(m, answered.get(m.name), pairs.get(m.name)) for m in marks],
    }


def looks_like(mark: Mark, sizes: Sizes) -> tuple[Names, ...]:
    """Name the hypothesis that the means of a case show, by the size of each effect.

    That is none below a gap of ``VISIBLE``, and a pair without its effects below that size.
    """
    if mark.gap < VISIBLE:
        return ((),)
    hidden = {name for name, size in sizes.items() if size.beside < VISIBLE}
    return (tuple(n for n in mark.truth if n not in hidden),) if hidden else ()


def figures(marks: Sequence[Mark]) -> Record:
    """Return the figures that any group of cases has."""
    answered = [m for m in marks if not m.refused]
    return {
        "n": len(marks),
        "top_1": share(m.right for m in marks),
        "top_class": share(m.right_class for m in marks),
        "top_class_as_seen": share(m.right_as_seen for m in marks),
        "named": share(m.named for m in marks),
        "precision_when_named": share(m.named_right for m in marks if m.named),
        "precision_as_seen": share(m.named_as_seen for m in marks if m.named),
        "named_causes_true": share(m.causes_true for m in marks if m.causes),
        "coverage_90": share(m.truth in m.credible for m in answered),
        "size_90": mean(float(len(m.credible)) for m in answered),
        "parameter_coverage_90": share(ok for m in answered if m.right for ok in m.inside),
        "calibration_error_of_top": calibration([[(m.chances[m.top], m.right)] for m in answered]),
        "calibration_error_of_top_as_seen": calibration(
            [[(m.chances[m.top], m.top in (m.truth, *m.also))] for m in answered]
        ),
        "log_score": mean(float(np.log(max(1e-6, m.chances.get(m.truth, 0.0)))) for m in answered),
    }


def _split(
    marks: Sequence[Mark], key: Callable[[Mark], str], groups: Sequence[str]
) -> dict[str, Record]:
    parts = {group: [m for m in marks if key(m) == group] for group in groups}
    return {group: figures(part) for group, part in parts.items() if part}


def _none(marks: Sequence[Mark]) -> Record:
    mine = [m for m in marks if m.kind == "none"]
    return {
        "n": len(mine),
        "false_alarms": share(m.named for m in mine),
        "verdict_none": share(m.verdict == "none" for m in mine),
        "verdict_unknown": share(m.verdict == "unknown" for m in mine),
    }


def _pairs(marks: Sequence[Mark]) -> Record:
    mine = [m for m in marks if m.kind == "pair"]
    return {
        "n": len(mine),
        "both_found": share(m.found == 2 for m in mine),
        "one_found_or_both": share(m.found >= 1 for m in mine),
        "top_is_the_pair": share(m.right for m in mine),
        "wrong_effect_named": share(m.named and not set(m.causes) & set(m.truth) for m in mine),
    }


def _outside(marks: Sequence[Mark]) -> Record:
    mine = [m for m in marks if m.kind == "outside"]
    names = sorted({name for m in mine for name in m.outside})
    return {
        "n": len(mine),
        "recognised": share(m.verdict in ("unknown", "refused") for m in mine),
        "refused": share(m.refused for m in mine),
        "wrong_effect_named": share(m.named for m in mine),
        "verdicts": {n: [m.verdict for m in mine if n in m.outside] for n in names},
        "by_kind": {
            n: share(m.verdict in ("unknown", "refused") for m in mine if n in m.outside)
            for n in names
        },
        "named_by_kind": {n: share(m.named for m in mine if n in m.outside) for n in names},
    }


def _advised(marks: Sequence[Mark], answered: Mapping[str, Advised]) -> Record:
    """Count the ambiguous cases that the advised test settles."""
    mine = [m for m in marks if m.verdict == "ambiguous"]
    tested = [(m, answered[m.name]) for m in mine if m.name in answered]
    return {
        **settled_figures(len(mine), [test for _, test in tested]),
        "settled_as_seen": share(t.settled or t.top in m.also for m, t in tested),
    }


def _shrink(marks: Sequence[Mark]) -> Record:
    """Return held-out shrinks; those of the best wrong effect show why shrink names nothing."""
    real = [m for m in marks if m.kind in ("single", "pair") and m.gap >= VISIBLE]
    return {
        "n": len(real),
        "leading": mean(m.shrink for m in real),
        "true": mean(m.true_shrink for m in real),
        "leading_over_true": median(
            (m.shrink or 0.0) / m.true_shrink for m in real if m.true_shrink
        ),
        "leading_where_wrong": mean(m.shrink for m in real if not m.right),
        "best_rival_where_right": mean(m.rival_shrink for m in real if m.right),
        "true_where_right": mean(m.true_shrink for m in real if m.right),
    }


def _plain(marks: Sequence[Mark]) -> Record:
    """Count the right answers of both baselines, beside the diagnosis on the same cases.

    Only cases of one effect count: neither baseline knows pairs or things outside the list.
    """
    mine = [m for m in marks if m.kind == "single" and m.plain is not None]
    seen = [m for m in mine if m.gap >= VISIBLE]
    return {name: _beside(part) for name, part in (("singles", mine), ("visible", seen))}


def _beside(marks: Sequence[Mark]) -> Record:
    best = [(m, max(m.weights, key=lambda h: m.weights[h])) for m in marks if m.weights]
    sure = [(m, h) for m, h in best if m.weights[h] > 0.8]
    return {
        "n": len(marks),
        "diagnosis": share(m.right for m in marks),
        "smallest_rmse": share(m.plain == m.truth for m in marks),
        "aicc": share(h == m.truth for m, h in best),
        "aicc_calibration_error_of_top": calibration(
            [[(m.weights[h], h == m.truth)] for m, h in best]
        ),
        "aicc_precision_above_0.8": share(h == m.truth for m, h in sure),
    }


def _confusion(marks: Sequence[Mark]) -> dict[str, dict[str, int]]:
    """Count the tops of all cases by truth."""
    table: dict[str, Counter[str]] = {}
    for mark in marks:
        table.setdefault(in_short(mark.truth), Counter())[in_short(mark.top)] += 1
    return {truth: dict(table[truth].most_common()) for truth in sorted(table)}


def _row(mark: Mark, advised: Advised | None, sizes: Sizes | None) -> Record:
    every = (sizes or {}).values()
    return {
        "case": mark.name,
        "kind": mark.kind,
        "strength": mark.strength,
        "form": mark.form,
        "truth": list(mark.truth),
        "outside": list(mark.outside),
        "gap_in_errors": mark.gap if np.isfinite(mark.gap) else None,
        "weaker_effect_in_errors": min((size.beside for size in every), default=None),
        "weaker_effect_after_refit_in_errors": min((size.after for size in every), default=None),
        "pair": {name: size.as_dict() for name, size in (sizes or {}).items()},
        "verdict": mark.verdict,
        "top": list(mark.top),
        "probability": mark.chances.get(mark.top),
        "probability_of_truth": mark.chances.get(mark.truth, 0.0),
        "right": mark.right,
        "right_class": mark.right_class,
        "shrink": mark.shrink,
        "advised_test": None if advised is None else advised.as_dict(),
        "time_s": mark.time,
    }
