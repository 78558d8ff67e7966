"""Headline figures of a field set: their words and aims, fixed and sealed with the key.

Bands go by the yardstick, the noncentrality that the best refit by a rival leaves of a truth
(``validation.blind.yardstick``): *clear* from 38, *between* from 9, else *hidden*. The code that
scores is sealed by its hashes.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

CLEAR, SEEN = 38.0, 9.0  #: noncentralities from which bands begin
SHOWN = 0.9  #: how often data of a size can show that no gap is there, from which they do
#: Files that score, beside this one.
SCORING = (
    "figures.py",
    "score.py",
    "case_marks.py",
    "advised_test.py",
    "intervals.py",
)


@dataclass(frozen=True)
class Headline:
    """A headline figure: its name in the score, its words, and from and to where its aim lies.

    One without ends has no aim; it is given beside the others.
    """

    name: str
    words: str
    low: float | None
    high: float | None

    @property
    def aim(self) -> str:
        """Write the aim, a share in percent."""
        if self.low is None and self.high is None:
            return ""
        unit = "" if self.name.startswith("calibration") else " %"
        parts = [f"{one:g}" if not unit else f"{100.0 * one:.0f}" for one in self._ends]
        if self.low is not None and self.high is not None:
            return f"{parts[0]} to {parts[1]}{unit}"
        return f"{'at least' if self.high is None else 'at most'} {parts[0]}{unit}"

    @property
    def _ends(self) -> list[float]:
        return [end for end in (self.low, self.high) if end is not None]

    def met(self, value: float | None) -> bool | None:
        """Decide whether a value meets the aim; None for no value."""
        if value is None or not self._ends:
            return None
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


HEADLINES = (
    Headline("cause_right", "clear: cause or its class leads", 0.95, None),
    Headline("named_right", "named exactly, of all that is named, outside included", 0.97, None),
    Headline("named_as_seen", "named exactly, but for causes that data cannot show", 0.97, None),
    Headline("unknown_recognised", "clear, outside the list: unknown", 0.90, None),
    Headline("false_unknown", "clear, of the list: unknown said", None, 0.02),
    Headline("both_of_a_pair", "clear pairs: both found", 0.80, None),
    Headline("false_alarms", "no effect: one is named", None, 0.02),
    Headline("none_said", "no effect: none within the margin said", 0.90, None),
    Headline("none_said_within", "the same, of engines within the margin themselves", None, None),
    Headline("none_said_shown", "no effect, and data can show it: none said", 0.90, None),
    Headline("coverage_90", "90 % set holds the truth", 0.85, 0.95),
    Headline("coverage_90_seen", "90 % set holds the truth, but for such causes", 0.85, 0.95),
    Headline("coverage_90_evidence", "90 % set by evidence holds the truth", 0.85, 0.95),
    Headline("calibration", "calibration error of the leading one", None, 0.05),
    Headline("calibration_seen", "calibration error, but for such causes", None, 0.05),
    Headline("calibration_evidence", "calibration error by evidence", None, 0.05),
    Headline("named_wrongly_between", "between: named wrongly", None, 0.05),
    Headline("left_open", "hidden: left open with a test that would tell", None, None),
    Headline("advice_settled", "cause left open: the advised test settles it", 0.75, None),
    Headline("advice_part", "cause left open: it settles on a part of the truth", None, None),
    Headline("advice_wrong", "cause left open: it settles on what is not true", None, 0.05),
)


def scoring_code() -> dict[str, str]:
    """Hash the files of the scoring code, by name."""
    here = Path(__file__).resolve().parent
    return {name: hashlib.sha256((here / name).read_bytes()).hexdigest() for name in SCORING}
