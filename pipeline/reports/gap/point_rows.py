"""Operating points with measured and predicted times, and their table."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass

import numpy as np

from dogshape.diagnosis.bench.comparison import PointGap
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.terms import NONE
from dogshape.sim.units import RPM

NINETY = 1.645  #: standard errors of a 90 % interval, either side


@dataclass(frozen=True)
class CellRow:
    """One operating point; times and their standard errors in s, None where there is none.

    Parameters
    ----------
    shifts : that have a time.
    engaged, failed, unknown : shifts counted.
    bench_s, bench_error_s : mean on the bench, and its error from the predicted spread.
    simulated_s, simulated_error_s : without any effect.
    gap_s, error_s, z : bench less simulation, its error, and one over the other.
    predicted_s, predicted_error_s : mean of the leading hypothesis, fitted to all other points.
    """

    mismatch_rpm: float
    force_N: float
    shifts: int
    engaged: int
    failed: int
    unknown: int
    bench_s: float | None
    bench_error_s: float | None
    simulated_s: float | None
    simulated_error_s: float | None
    gap_s: float | None
    error_s: float | None
    z: float | None
    predicted_s: float | None
    predicted_error_s: float | None

    @property
    def place(self) -> tuple[float, float]:
        """Mismatch and force."""
        return self.mismatch_rpm, self.force_N


def cells_of(found: Diagnosis) -> list[CellRow]:
    """List the operating points of a diagnosis, in the order of its data set."""
    held_out, nearest = found.held_out, found.fits[found.leading].predicted
    spread = np.sqrt((nearest.sd**2).mean(axis=0))
    errors = found.fits[NONE].predicted.error.mean(axis=0)
    return [
        row_of(
            point,
            simulated_error=_number(errors[k]),
            bench_error=_number(spread[k] / point.cell.n**0.5) if point.cell.n else None,
            predicted=_number(held_out.mean[k]) if found.leading != NONE else None,
            predicted_error=_number(held_out.sd[k]) if found.leading != NONE else None,
        )
        for k, point in enumerate(found.gaps)
    ]


def row_of(
    point: PointGap, simulated_error: float | None, bench_error: float | None = None,
    predicted: float | None = None, predicted_error: float | None = None,
) -> CellRow:  # fmt: skip
    """Write the gap at an operating point as a row; errors and prediction in s."""
    cell = point.cell
    return CellRow(
        mismatch_rpm=cell.point.mismatch / RPM,
        force_N=cell.point.profile.force,
        shifts=cell.n,
        engaged=cell.engaged,
        failed=cell.failed,
        unknown=cell.unknown,
        bench_s=cell.time,
        bench_error_s=bench_error,
        simulated_s=point.mean,
        simulated_error_s=None if point.mean is None else simulated_error,
        gap_s=point.gap,
        error_s=None if point.gap is None else _number(point.standard_error),
        z=None if point.z is None else _number(point.z),
        predicted_s=predicted,
        predicted_error_s=predicted_error,
    )


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def table(cells: list[CellRow]) -> str:
    """Write all operating points as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(CellRow.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(cell) for cell in cells)
    return text.getvalue()


def unreadable(cell: CellRow) -> str:
    """Explain in words the lack of a gap in a cell; empty where it has one."""
    if cell.gap_s is not None:
        return ""
    if cell.bench_s is not None:
        return "not simulated"
    return "not engaged" if cell.failed else "unknown"
