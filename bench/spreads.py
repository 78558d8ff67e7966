"""Spreads of mean shift times: what a column means by its name, as a standard deviation.

What a name leaves open becomes a question with its options.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dogshape.bench.cell_values import Column, squared_time
from dogshape.bench.column_options import PERCENT, PURE_NUMBER, Match
from dogshape.bench.draft_arguments import column_argument, column_placeholder, no_column
from dogshape.bench.quantities import (
    MEAN,
    OTHER_SPREAD,
    SHIFT_TIME_SD,
    STANDARD_DEVIATION,
    STANDARD_ERROR,
    VARIANCE,
    VARIATION,
    has_word,
    plain_words,
)

#: Two or three standard deviations, the number before the word.
_MULTIPLE = rf"\b([23]) ?(?:x |mal |times )?(?:{STANDARD_DEVIATION}|standard deviations)\b"
_UNSETTLED = rf"{MEAN}|max|min|rel\w*|err\w*|confidence|konfidenz\w*|range|[02-9]\w*|\d\d+|k"


def with_spread(
    matches: Sequence[Match], free: Sequence[Column], options: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Convert a spread that its name settles into a standard deviation; ask about others.

    Without one, a coefficient of variation among the ``free`` columns is matched.
    """
    name = "shift_time_sd_s"
    converted: list[Match] = []
    questions: list[str] = []
    by_name = {match.quantity.name: match for match in matches}
    if name not in by_name and name not in options:
        variation, questions = _variation_match(by_name.get("shift_time_s"), free)
        return [*matches, *variation], questions
    for match in matches:
        # A product is a coefficient of variation times the mean already.
        if match.quantity.name != name or name in options or len(match.terms) > 1:
            converted.append(match)
            continue
        deviation = _deviation_of(match, by_name.get("n_shifts"))
        if deviation is not None:
            converted.append(deviation)
        elif not has_word(STANDARD_ERROR, plain_words(match.column.name)):
            questions.append(_open_spread(match.column, by_name.get("shift_time_s")))
    return converted, questions


def _deviation_of(match: Match, count: Match | None) -> Match | None:
    """Convert the match of a spread into a standard deviation; None where its name is open.

    A standard error is open without ``count``, the match of the numbers of shifts.
    """
    column = match.column
    words = plain_words(column.name)
    multiple = re.search(_MULTIPLE, words)
    squared = squared_time(column.strange or "")
    is_variation = has_word(VARIATION, words) and column.unit is None
    is_error = has_word(STANDARD_ERROR, words)
    if squared is not None:
        reason = f"{match.why}; root of the variance"
        return replace(match, terms=((column, squared),), formula="sqrt(c0)", why=reason)
    if is_variation or has_word(VARIANCE, words):
        return None
    if multiple:
        reason = f"{match.why}; {multiple[1]} standard deviations"
        return replace(match, formula=f"c0 / {multiple[1]}", why=reason)
    if is_error and count is not None:
        reason = f"{match.why}; standard error times the root of '{count.head}'"
        terms = (*match.terms, *((counted, PURE_NUMBER) for counted, _ in count.terms))
        formula = "c0 * sqrt(c1)" if count.terms else f"c0 * sqrt({count.formula})"
        return replace(match, terms=terms, formula=formula, why=reason)
    settled = has_word(STANDARD_DEVIATION, words) and not has_word(_UNSETTLED, words)
    return match if settled and not is_error else None


def _open_spread(column: Column, time: Match | None) -> str:
    """Ask for the meaning of a spread with an open name."""
    words = plain_words(column.name)
    if has_word(VARIATION, words) and column.unit is None:
        return _variation_question(column, time)
    if has_word(VARIANCE, words):
        return _variance_question(column)
    return _spread_question(column)


def _variation_match(time: Match | None, free: Sequence[Column]) -> tuple[list[Match], list[str]]:
    """Match a coefficient of variation, whose product with the time is the standard deviation.

    Returns the match, and a question where no unit says percent.
    """
    for column in free:
        words = plain_words(column.name)
        is_other = column.hidden or has_word(OTHER_SPREAD, words)
        if is_other or not has_word(VARIATION, words) or not np.isfinite(column.values).any():
            continue
        is_percent = column.unit is not None and column.unit.text.strip() == "%"
        if not is_percent or time is None or time.formula != "c0":
            return [], [_variation_question(column, time)]
        reason = "name and unit; percent of the mean"
        terms = ((column, PERCENT), *time.terms)
        return [Match(SHIFT_TIME_SD, terms, reason, formula="c0 * c1")], []
    return [], []


def _variation_question(column: Column, time: Match | None) -> str:
    mean = time.head if time is not None and time.formula == "c0" else "TIME"
    percent = column_argument("shift_time_sd_s", f"{column.head} * {mean} / 100")
    share = column_argument("shift_time_sd_s", f"{column.head} * {mean}")
    return (
        f"'{column.head}' is a coefficient of variation; say {percent} for percent of the mean, "
        f"{share} for a share of it, or {no_column('shift_time_sd_s')} to leave it out"
    )


def _variance_question(column: Column) -> str:
    root = column_argument("shift_time_sd_s", f"sqrt({column.head}:ms2)")
    deviation = column_argument("shift_time_sd_s", column.head)
    return (
        f"'{column.head}' is a variance, whose root is the standard deviation, but no unit is "
        f"squared; say {root} or s2, {deviation} where it is a standard deviation, or "
        f"{no_column('shift_time_sd_s')} to leave it out"
    )


def _spread_question(column: Column) -> str:
    single = column_argument("shift_time_sd_s", column.head)
    double = column_argument("shift_time_sd_s", f"{column.head} / 2")
    return (
        f"'{column.head}' may be a standard deviation, a multiple of it, a half width or a range; "
        f"say {single} for one standard deviation, {double} for two, or "
        f"{no_column('shift_time_sd_s')} to leave it out"
    )


def uncounted_means(matches: Sequence[Match], options: Mapping[str, str]) -> list[str]:
    """Ask how many shifts each mean has where no column counts them."""
    by_name = {match.quantity.name: match for match in matches}
    time = by_name.get("shift_time_s")
    if "n_shifts" in by_name or "n_shifts" in options or time is None:
        return []
    spread = by_name.get("shift_time_sd_s")
    means = [column for column, _ in time.terms if has_word(MEAN, plain_words(column.name))]
    if means:
        reason = f"'{means[0].head}' is a mean"
    elif spread is not None:
        reason = f"'{spread.head}' is a spread"
    else:
        return []
    return [
        f"{reason}, so that each row is a mean of shifts, but no column counts them; say "
        f"{column_placeholder('n_shifts')}, or a number for all rows, such as "
        f"{column_placeholder('n_shifts', '5')}"
    ]
