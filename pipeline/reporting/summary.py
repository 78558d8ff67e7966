"""The first lines of the report: what was found, how sure it is, what limits it."""

from __future__ import annotations

from typing import Any

from pipeline.records import is_clear
from pipeline.reporting.names import check_name, percent
from pipeline.reporting.operating import Gain, gains

Row = dict[str, Any]


def ms(seconds: float, digits: int = 1) -> str:
    """Return a time in ms without its unit, with a real minus."""
    return f"{seconds * 1e3:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def headline(result: Row) -> str:
    """Return the one sentence of the study."""
    confirmation, best = result["confirmation"], result["best"]
    if best is None:
        return "No design of this search passes every check, so none was simulated."
    if not confirmation:
        time = f"{ms(best['expected_shift_time_s'])} ± {ms(best['standard_error_s'])} ms"
        return (
            f"The best design so far, number {best['trial']}, shifts in {time} on average. "
            "It has not been confirmed at fresh angles yet."
        )
    gain = abs(confirmation["gain_s"])
    word = "faster" if confirmation["gain_s"] >= 0.0 else "slower"
    if best["prototype"]:
        return "No design of this search is faster than the prototype."
    if not is_clear(confirmation):
        return (
            f"Design {best['trial']} cannot be told from the prototype: {ms(gain)} ± "
            f"{ms(confirmation['gain_standard_error_s'])} ms {word}, less than twice the "
            "standard error."
        )
    share = f"{100 * abs(confirmation['gain_share']):.0f} %"
    return f"Design {best['trial']} shifts {share} {word} than the prototype."


def points_of(result: Row) -> list[str]:
    """Return sentences on a confirmed design: how sure, what limits it, where it is slower."""
    confirmation, best = result["confirmation"], result["best"]
    limits = _limits(best, confirmation)
    if best["prototype"]:
        return [_simulated(result), *limits]
    return [_how_sure(result), *limits, *_slower(gains(confirmation))]


def _how_sure(result: Row) -> str:
    c = result["confirmation"]
    ratio = abs(c["gain_s"]) / c["gain_standard_error_s"] if c["gain_standard_error_s"] else 0.0
    clear = f"Clear: the gain is {ratio:.0f} times its standard error" if is_clear(c) else (
        f"Not clear: the gain is {ratio:.1f} times its standard error"
    )  # fmt: skip
    return f"{clear}. {_simulated(result)}"


def _simulated(result: Row) -> str:
    angles = result["confirmation"]["angles"]
    return (
        f"{result['n_simulated_shifts']} shifts were simulated; the times above are from {angles} "
        "fresh relative angles at each operating point, which the search did not use."
    )


def _limits(best: Row, confirmation: Row) -> list[str]:
    said = (
        f"What limits it: {check_name(best['weakest_check'])}, with a margin of "
        f"{percent(best['smallest_margin'])} to its limit"
    )
    worst = best["margin_worst_case"]
    if worst is not None:
        said += f"; the smallest margin is {percent(worst)} with every tolerance at its worst"
        said += ", so such a part may break a limit" if worst < 0.0 else ""
    failed = [check for check in confirmation["best"]["checks"] if not check["passed"]]
    words = [f"{check_name(check['name'])} ({percent(check['margin'])})" for check in failed]
    extra = [f"At the fresh angles it fails {', '.join(words)}."] if words else []
    return [f"{said}.", *extra]


def _slower(found: list[Gain]) -> list[str]:
    slower = [gain for gain in found if gain.gain_s < 0.0]
    if not slower:
        return [f"Nowhere slower than the prototype, at {len(found)} operating points."]
    clear = [gain for gain in slower if gain.clear]
    rest = len(slower) - len(clear)
    said = f"Slower than the prototype at {len(slower)} of {len(found)} operating points"
    if not clear:
        return [f"{said}, nowhere clearly: each loss is below twice its standard error."]
    places = "; ".join(
        f"{g.mismatch_rpm:.4g} 1/min with {g.force_N:.4g} N by {ms(-g.gain_s)} ± {ms(g.error_s)} ms"
        for g in sorted(clear, key=lambda g: g.gain_s)
    )
    said += f", clearly at {len(clear)}: {places}"
    return [said + (f"; the other {rest} may be chance." if rest else ".")]
