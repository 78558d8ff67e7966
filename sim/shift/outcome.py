"""How a shift ended: a value, so that what only reads results needs no simulation."""

from __future__ import annotations

from enum import Enum


class Outcome(Enum):
    """End of a shift."""

    ENGAGED = "engaged"
    BLOCKED = "blocked"
    TIMED_OUT = "timed_out"
    DIVERGED = "diverged"

    @property
    def message(self) -> str:
        """Meaning of the outcome, in words."""
        return _MESSAGES[self]


_MESSAGES = {
    Outcome.ENGAGED: "the sliding ring reached full depth",
    Outcome.BLOCKED: "the rings stand still on each other, dog on dog, held by friction",
    Outcome.TIMED_OUT: "full depth was not reached before the time-out",
    Outcome.DIVERGED: "the integration failed",
}

#: Beginning of the reason of a failure that depends on the speed of the machine.
TIME_LIMIT = "no end after solver.time_limit_s"


def depends_on_clock(reason: str) -> bool:
    """Decide whether a failure for this reason may not happen when the shift is simulated again."""
    return reason.startswith(TIME_LIMIT)
