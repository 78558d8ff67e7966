"""Numbers, variables and checks as all pages and tables print them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from dogshape.pipeline.record import MINUS, Bad, percent
from dogshape.pipeline.store.result_records import ExpectedTime, HangKeys, PlaceRow, QuantileRow
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.expectation import NumericalError
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
#: Blanks of quantities: around a ±, before a unit, and after the S of a safety factor.
UNIT = "|".join(map(re.escape, ("±", "%", "dogs", *(unit for _, unit in UNITS.values() if unit))))
BLANK = re.compile(rf"(?<=\d) (?=(?:{UNIT})(?![\w/]))|(?<=±) |(?<=\bS) (?=\d)|(?<=\d N) (?=[ms]\b)")
MICROMETRES = re.compile(r"\Aum\Z|(?<=\d )um\b|(?<=N/)um\b")
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


def bind_units(words: Any) -> Any:
    """Print quantities with no-break spaces and micro signs; other values than text stay."""
    if type(words) not in (str, Bad):
        return words
    micro = MICROMETRES.sub("\N{MICRO SIGN}m", words)
    return type(words)(BLANK.sub("\N{NO-BREAK SPACE}", micro))


def minus(words: str) -> str:
    """Replace hyphens in numbers by minus signs."""
    return words.replace("-", MINUS)


MAX_DECIMALS = 6  #: of a value with a tiny error


def in_ms(seconds: float | None) -> str:
    """Print a time, s, in ms to a tenth; a dash for None or NaN."""
    return "-" if seconds is None or math.isnan(seconds) else f"{seconds * 1e3:.1f}"


def with_error(value: float, error: float, sign: str = "") -> str:
    """Print a value with its standard error, to the decimals that the error decides.

    A zero error, as of a single shift, is left out; ``sign`` "+" signs positive values.
    """
    if not error:
        return minus(f"{value:{sign}z.1f}")
    decimals = _decimals(error)
    return minus(f"{value:{sign}z.{decimals}f} ± {error:.{decimals}f}")


def _decimals(error: float) -> int:
    """Choose the decimals of a value: at most two, down to the first digit of an error < 0.01."""
    if error < 0.01:
        return min(MAX_DECIMALS, math.ceil(-math.log10(error)))
    if error < 0.05:
        return 2
    return 1 if error < 9.95 else 0


def ms_with_error(time: float | None, error: float | None, sign: str = "") -> str:
    """Print a time and its standard error, s, in ms; a dash for None."""
    if time is None:
        return "-"
    return with_error(1e3 * time, 1e3 * (error or 0.0), sign)


def margin_cell(name: str, margin: float | None, interval: Sequence[float] | None = None) -> str:
    """Print a margin with its interval, check and safety factor S; ``Bad`` below zero."""
    if margin is None:
        return ""
    safety = safety_factor(RULES[name], margin) if name in RULES else None
    factor = "" if safety is None else f", S {safety:.2f}"
    ends = f" ({' to '.join(map(percent, interval))})" if interval else ""
    text = f"{percent(margin)}{ends} {check_name(name)}{factor}".strip()
    return Bad(text) if margin < 0.0 else text


def place_name(point: PlaceRow) -> str:
    """Print mismatch and force of an operating point."""
    return minus(f"{point.mismatch_rpm:.4g} 1/min, {point.force_N:.4g} N")


def check_name(name: str) -> str:
    """Print the name of a check, event or load, without the unit that its key ends in."""
    return CHECKS.get(name) or name.removesuffix(suffix_of(name)).replace("_", " ")


def label(name: str) -> str:
    """Print the name of a variable."""
    if name.startswith(OUTPUT_PREFIX):
        return f"output ring, {label(name.removeprefix(OUTPUT_PREFIX))}"
    return LABELS.get(name) or check_name(name)


def axis(name: str) -> str:
    """Print the name of a variable with its unit."""
    unit = unit_of(name)
    return f"{label(name)}, {unit}" if unit else label(name)


def value(name: str, number: float) -> str:
    """Print a value of a variable with its unit."""
    return f"{short(number)} {unit_of(name)}".strip()


def time_text(seconds: float | None, error: float | None = None) -> str:
    """Print a time, s, in ms with unit, and its standard error unless None; a dash for None."""
    if seconds is None:
        return "-"
    time = in_ms(seconds) if error is None else ms_with_error(seconds, error)
    return f"{time} ms"


def numerical_words(error: NumericalError, standard_error: float | None = None) -> str:
    """Describe a numerical error, and whether the ``standard_error`` of a mean, s, contains it."""
    if math.isnan(error.standard_error):
        return "numerical error unknown: it takes two shifts at least"
    words = (
        f"numerical error {1e3 * error.size:.2g} ms: {error.repeats} shifts repeated at a finer "
        f"tolerance differ by {time_text(error.difference, error.standard_error)} in the mean"
    )
    if error.is_bias:
        if standard_error is None:
            return words
        total = time_text(math.hypot(standard_error, error.size))
        return f"{words}, which ± leaves out: ± {total} with it"
    if not error.flips:
        return words
    flips = "1 of them takes" if error.flips == 1 else f"{error.flips} of them take"
    return f"{words}; {flips} another slot or outcome, a scatter that ± over the angles contains"


def quantile_words(quantiles: Sequence[QuantileRow]) -> str:
    """Print the quantiles of the shift time that exceed twice their standard error."""
    words = []
    for quantile in quantiles:
        time = quantile.time_s
        error = quantile.standard_error_s
        if (time or 0.0) > 2.0 * (error or 0.0):
            share = 100 * quantile.share
            words.append(f"{share:.4g} % of all shifts take at most {time_text(time, error)}")
    return ", ".join(words)


def hang_words(record: HangKeys) -> str:
    """Print the hang probability of a record with 95 % interval and cost."""
    mean, low, high = hang_percents(record)
    words = f"a shift hangs with {mean:.2g} % (95 %: {low:.2f} to {high:.2g} %)"
    if record.retries_s is None:
        return words
    words += f", retries take {time_text(record.retries_s, record.retries_error_s)}"
    if record.judges_hangs:
        return words
    words += ", by too few shifts to judge hangs"
    if isinstance(record, ExpectedTime) and record.not_engaged == 0:
        words += f": those rarer than 1 in {record.shifts} cannot be seen in {record.shifts} shifts"
    return words


def hang_percents(record: HangKeys) -> tuple[float, float, float]:
    """Return the hang probability of a record and the ends of its 95 % interval, %."""
    assert record.hang_probability is not None  # earlier versions have none of the three
    assert record.hang_probability_low is not None
    assert record.hang_probability_high is not None
    return (
        100.0 * record.hang_probability,
        100.0 * record.hang_probability_low,
        100.0 * record.hang_probability_high,
    )


def engaged_text(record: HangKeys) -> str:
    """Print the mean time of engaged shifts, ms; a dash if an operating point has none."""
    return time_text(record.engaged_mean_s, record.engaged_standard_error_s)


def interval_text(time: float, low: float, high: float, share: str = "95 %") -> str:
    """Print a time in ms with its credible interval of a ``share``; all in s."""
    return f"{time_text(time)} ({share}: {time_text(low)} to {time_text(high)})"
