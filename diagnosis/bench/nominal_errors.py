"""Uncertainties of nominal force and mismatch and the clock's step, from the table ``[errors]``.

*Systematic* ones are the same for the whole series, as that of a load cell's gain; those of *each
point* are drawn anew with each setting, as what a valve or a drive stops at.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from dogshape.sim.clutch_tables import Section
from dogshape.sim.errors import DataError, refusal
from dogshape.sim.units import MS, RPM


class ErrorSection(Section):
    """Uncertainties of one kind; each may be left out."""

    force_percent: float | None = None
    force_N: float | None = None
    mismatch_percent: float | None = None
    mismatch_rpm: float | None = None


class ErrorTables(Section):
    """The table ``[errors]``."""

    systematic: ErrorSection | None = None
    each_point: ErrorSection | None = None
    clock_step_ms: float | None = None


@dataclass(frozen=True)
class Tolerance:
    """Standard uncertainties of one kind.

    Parameters
    ----------
    force_share, mismatch_share : of the nominal value.
    force, mismatch : N and rad/s, whatever the nominal value.
    """

    force_share: float = 0.0
    force: float = 0.0
    mismatch_share: float = 0.0
    mismatch: float = 0.0

    def __bool__(self) -> bool:
        """Test that any of them is stated and not zero."""
        return any(getattr(self, f.name) for f in fields(self))


@dataclass(frozen=True)
class NominalErrors:
    """Uncertainties of nominal values; none by default."""

    systematic: Tolerance = Tolerance()
    each_point: Tolerance = Tolerance()

    def __bool__(self) -> bool:
        """Test that any is stated and not zero."""
        return bool(self.systematic) or bool(self.each_point)


EXACT = NominalErrors()
#: Largest uncertainty of each key, with its unit: beyond, a linear law would say nothing.
MOST = {
    "force_percent": (30.0, "%"),
    "force_N": (1e4, "N"),
    "mismatch_percent": (30.0, "%"),
    "mismatch_rpm": (1e3, "1/min"),
}
MOST_STEP = 100.0  #: ms, largest step of a clock: beyond, times are counts of two or three steps


def nominal_errors(path: Path, given: ErrorTables | None) -> NominalErrors:
    """Return the uncertainties of a table; raises DataError for one that cannot be."""
    if given is None:
        return EXACT
    kinds = {
        kind: _tolerance(path, kind, section)
        for kind in ("systematic", "each_point")
        if (section := getattr(given, kind)) is not None
    }
    return NominalErrors(**kinds)


def stated_step(path: Path, given: ErrorTables | None) -> float | None:
    """Read the step of the clock in s, None where none is stated; raises DataError."""
    if given is None or given.clock_step_ms is None:
        return None
    if not 0.0 <= given.clock_step_ms <= MOST_STEP:
        rule = f"it must lie between 0 and {MOST_STEP:g} ms"
        remedy = "give the cycle of the controller that took the times, 0 for none"
        where = f"{path}: errors.clock_step_ms"
        raise DataError(refusal(where, given.clock_step_ms, "ms", rule, remedy))
    return MS * given.clock_step_ms


def _tolerance(path: Path, kind: str, given: ErrorSection) -> Tolerance:
    values = {name: getattr(given, name) or 0.0 for name in MOST}
    for name, value in values.items():
        high, unit = MOST[name]
        if not 0.0 <= value <= high:
            rule = f"it must lie between 0 and {high:g} {unit}"
            remedy = "give a standard uncertainty, half the width of what holds 95 %"
            where = f"{path}: errors.{kind}.{name}"
            raise DataError(refusal(where, value, unit, rule, remedy))
    return Tolerance(
        0.01 * values["force_percent"],
        values["force_N"],
        0.01 * values["mismatch_percent"],
        RPM * values["mismatch_rpm"],
    )
