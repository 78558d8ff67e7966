"""Headline figures of a field set: their words and aims, fixed and sealed with the key.

A case is *clear* where the best refit by a rival leaves a noncentrality of ``CLEAR`` of its truth
(``validation.blind.yardstick``). The code that scores is sealed by its hashes.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

CLEAR = 38.0  #: noncentrality from which a truth is clear
SHOWN = 0.9  #: power from which data without any effect can show that
SURE = 0.95  #: probability above which nothing may be wrong
OPEN = 0.8  #: probability up to which the cause is open
#: Files that score, beside this one.
SCORING = ("figures.py", "score.py", "advised_test.py", "intervals.py", "sealed.py")


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
