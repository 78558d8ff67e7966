"""Numbers, variables and checks as all pages and tables print them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from dogshape.pipeline.record import MINUS, Bad, percent
from dogshape.sim.strength.checks import RULES, safety_factor
from dogshape.sim.units import UNITS, short, suffix_of, unit_of

#: Variables whose key is no name.
LABELS = {
    "chamfer_deg": "chamfer \N{GREEK SMALL LETTER ALPHA}",
    "traction_deg": "traction flank \N{GREEK SMALL LETTER BETA}",
    "braking_deg": "braking flank \N{GREEK SMALL LETTER GAMMA}",
    "height_mm": "height h",
    "count": "number of dogs N",
    "crest": "place of the ridge c",
    "chamfer_back_deg": "back chamfer \N{GREEK SMALL LETTER ALPHA}\N{SUBSCRIPT TWO}",
    "backlash_mm": "backlash j",
    "force_N": "shift force",
    "mismatch_set_rpm": "set-point of the mismatch",
    "force_factor": "factor on the shift force",
    "rise_factor": "factor on its rise time",
}
#: Blanks of quantities: beside a ±, before a unit, and behind the S of a safety factor.
UNIT = "|".join(map(re.escape, ("±", "%", "dogs", *(one for _, one in UNITS.values() if one))))
BLANK = re.compile(rf"(?<=\d) (?=(?:{UNIT})(?![\w/]))|(?<=±) |(?<=\bS) (?=\d)|(?<=\d N) (?=[ms]\b)")
PLACE = ("mismatch_rpm", "force_N")  #: keys of an operating point
ENGINES = {"drake": "Drake", "planar": "the compiled engine"}  #: words for each engine
#: Checks, events and loads whose key is no name.
CHECKS = {
    "smallest_margin_worst": "smallest margin at worst-case tolerances, landing left out",
    "smallest_margin_statistical": "smallest margin at statistical tolerances, landing left out",
    "slower_than_reference_s": "time lost on the reference",
    "engagement": "engagement in half of the shifts of each operating point",
    "face_contacts": "touches of face on face",
    "strike_mismatch_rpm": "mismatch taken by the hardest strike",
    "residual_mismatch_rpm": "mismatch when the flanks close",
}


def bound(words: Any) -> Any:
    """Keep a number, its error and its unit on one line, by blanks that do not break."""
    return words if type(words) not in (str, Bad) else BLANK.sub("\N{NO-BREAK SPACE}", words)


def minus(words: str) -> str:
    """Replace hyphens in numbers by minus signs."""
    return words.replace("-", MINUS)


MAX_PLACES = 6  #: decimals of a value with a tiny error


def in_ms(seconds: float | None) -> str:
    """Print a time in ms to a tenth, or a dash where there is none."""
    return "-" if seconds is None or math.isnan(seconds) else f"{seconds * 1e3:.1f}"


def with_error(shown: float, error: float, sign: str = "") -> str:
    """Print a value and its standard error: without it where it is zero, as of one shift.

    To a hundredth at most, and to the first digit of a smaller error.
    """
    if not error:
        return minus(f"{shown:{sign}z.1f}")
    places = 2 if error < 0.05 else 1 if error < 9.95 else 0
    if error < 0.01:
        places = min(MAX_PLACES, math.ceil(-math.log10(error)))
    return minus(f"{shown:{sign}z.{places}f} ± {error:.{places}f}")


def ms_with_error(time: float | None, error: float | None, sign: str = "") -> str:
    """Print a time and its standard error, both in s, in ms; a dash where there is none."""
    return "-" if time is None else with_error(1e3 * time, 1e3 * (error or 0.0), sign)


def margin_cell(name: str, margin: float | None, interval: Sequence[float] | None = None) -> str:
    """Print a margin with its interval, check and safety factor S, below zero as bad."""
    if margin is None:
        return ""
    safety = safety_factor(RULES[name], margin) if name in RULES else None
    factor = "" if safety is None else f", S {safety:.2f}"
    ends = f" ({' to '.join(map(percent, interval))})" if interval else ""
    text = f"{percent(margin)}{ends} {check_name(name)}{factor}".strip()
    return Bad(text) if margin < 0.0 else text


def place_name(point: Mapping[str, Any]) -> str:
    """Name the operating point of a record by mismatch and force."""
    return minus("{mismatch_rpm:.4g} 1/min, {force_N:.4g} N".format(**point))


def check_name(name: str) -> str:
    """Name a check in words, without the unit that a quantity's key ends in."""
    return CHECKS.get(name) or name.removesuffix(suffix_of(name)).replace("_", " ")


def label(name: str) -> str:
    """Name a variable for people."""
    return LABELS.get(name) or check_name(name)


def axis(name: str) -> str:
    """Name a variable with its unit."""
    unit = unit_of(name)
    return f"{label(name)}, {unit}" if unit else label(name)


def value(name: str, number: float) -> str:
    """Print a value of a variable with its unit."""
    return f"{short(number)} {unit_of(name)}".strip()


def time_text(seconds: float | None, error: float | None = None) -> str:
    """Print a time in ms, with its standard error where it has one; a dash where there is none."""
    if seconds is None:
        return "-"
    return f"{in_ms(seconds) if error is None else ms_with_error(seconds, error)} ms"


def quantile_words(quantiles: Sequence[Mapping[str, Any]]) -> str:
    """Print the times within which shares of all shifts engage, where twice the error is less.

    ``QuantileRow`` has the keys.
    """
    return ", ".join(
        f"{100 * one['share']:.4g} % of all shifts take at most "
        f"{time_text(one['time_s'], one['standard_error_s'])}"
        for one in quantiles
        if (one["time_s"] or 0.0) > 2.0 * (one["standard_error_s"] or 0.0)
    )


def hang_words(parts: Mapping[str, Any]) -> str:
    """Print the probability of a hang with its interval and its cost; ``HangKeys`` has the keys."""
    mean, low, high = (100.0 * parts[f"hang_probability{end}"] for end in ("", "_low", "_high"))
    words = f"a shift hangs with {mean:.2g} % (95 %: {low:.2f} to {high:.2g} %)"
    if parts["retries_s"] is None:
        return words
    return f"{words}, retries take {time_text(parts['retries_s'], parts['retries_error_s'])}"


def engaged_text(parts: Mapping[str, Any]) -> str:
    """Print the mean of engaged shifts; a dash where an operating point has none."""
    return time_text(parts["engaged_mean_s"], parts["engaged_standard_error_s"])


def interval_text(time: float, low: float, high: float, share: str = "95 %") -> str:
    """Print a time in ms with the interval that holds so much of it; all in s."""
    return f"{time_text(time)} ({share}: {time_text(low)} to {time_text(high)})"
