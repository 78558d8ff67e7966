"""A check: a number of a design against its limit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """Value against limit, both in ``unit``.

    ``at_most`` tells whether the limit is an upper or a lower one; ``rule`` gives the
    formula with its source.
    """

    name: str
    value: float
    limit: float
    unit: str
    at_most: bool
    rule: str

    @property
    def margin(self) -> float:
        """Share of the limit that is left; negative when the check fails."""
        left = self.limit - self.value if self.at_most else self.value - self.limit
        return left / abs(self.limit) if self.limit else left

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.margin >= 0.0


def feasible(checks: Iterable[Check]) -> bool:
    """Tell whether every check passes."""
    return all(check.passed for check in checks)


def smallest_margin(checks: Iterable[Check]) -> Check:
    """Return the check with the smallest margin."""
    return min(checks, key=lambda check: check.margin)
