"""A check: a number of a design against its limit, with the rule that it follows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Group = Literal["make", "load", "lock", "impact", "tolerance", "goal"]

#: What the groups are about, in the order of reports.
GROUPS: dict[Group, str] = {
    "make": "can be made",
    "load": "carries the torque",
    "lock": "engages and lets go",
    "impact": "bears dog on dog",
    "tolerance": "keeps contact within tolerances",
    "goal": "keeps the study's own limits",
}


@dataclass(frozen=True)
class Rule:
    """Question of a check.

    Parameters
    ----------
    name : of the check.
    meaning : the value in words.
    formula : of the value.
    source : of formula and limit.
    unit : of value and limit.
    key : of the study file that sets the limit.
    at_most : whether the limit is an upper or a lower one.
    summary : whether the value sums up other checks, such as their smallest margin.
    """

    name: str
    group: Group
    meaning: str
    formula: str
    source: str
    unit: str
    key: str
    at_most: bool
    summary: bool = False


@dataclass(frozen=True)
class Check:
    """Value against limit, both in the unit of ``rule``; of many designs arrays (n,)."""

    rule: Rule
    value: float
    limit: float

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.name

    @property
    def unit(self) -> str:
        """Unit of value and limit."""
        return self.rule.unit

    @property
    def margin(self) -> float:
        """Distance to the limit over the limit; negative when the check fails."""
        left = self.limit - self.value if self.rule.at_most else self.value - self.limit
        return left / (abs(self.limit) + (self.limit == 0.0))  # over 1 where the limit is 0

    @property
    def utilisation(self) -> float:
        """Value over an upper limit, or lower limit over value; 1 at the limit, at most 1000."""
        over, under = (self.value, self.limit) if self.rule.at_most else (self.limit, self.value)
        return min(max(over, 0.0) / under, 1e3) if under > 0.0 else 1e3

    @property
    def fault(self) -> str:
        """Value and limit in words, for a check that fails."""
        value, limit = (f"{one:.4g} {self.unit}".strip() for one in (self.value, self.limit))
        bound = "at most" if self.rule.at_most else "at least"
        return f"{self.rule.meaning} is {value}, but it must be {bound} {limit}"

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.margin >= 0.0


def feasible(checks: Iterable[Check]) -> bool:
    """Decide whether every check passes."""
    return all(check.passed for check in checks)


def smallest_margin(checks: Iterable[Check]) -> Check:
    """Return the check with the smallest margin; one that sums up others names none of them."""
    return min((c for c in checks if not c.rule.summary), key=lambda check: check.margin)
