"""Plan of bench tests before any is made: shifts, their order, and the causes they distinguish."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench as BenchData
from dogshape.diagnosis.bench.table import COLUMNS
from dogshape.diagnosis.inference.shift_plan import APART, ShiftPlan, shift_plan
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, Means, points_from, predicted_field
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.record import Table
from dogshape.pipeline.store.folder import require_targets
from dogshape.result import Result
from dogshape.sim.errors import InputError, StorageError, number
from dogshape.sim.files import write_whole
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    import pandas as pd

SHOWN = 4  #: rivals in a row
HALF = 0.5  #: share of the strengths from which two effects count as distinguished


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """Shifts to make, in their order, and the causes that they distinguish.

    Parameters
    ----------
    bench : operating points and clutch that it is for.
    inference : the plan.
    sheet : where the table to fill in was written; None where nowhere.
    """

    bench: BenchData
    inference: ShiftPlan
    sheet: Path | None = None

    @property
    def facts(self) -> dict[str, str]:
        """Number of shifts and operating points, work, and worth of the plan."""
        plan = self.inference
        return {
            "shifts": str(sum(plan.shifts)),
            "operating points": str(np.count_nonzero(plan.shifts)),
            "work": f"{plan.hours:.1f} h",
            "decides a pair rightly": f"{plan.worth:.0%}",
        }

    @property
    def parts(self) -> list[str | Table]:
        """Visits in their order, what distinguishes each cause, and the worth of the plan."""
        plan, causes = self.inference, []
        visits = [
            [str(one["visit"]), number(one["mismatch_rpm"]), number(one["force_N"]),
             str(one["shifts"]), "reference" if one["reference"] else ""]
            for one in self._visits
        ]  # fmt: skip
        names = self._names
        for truth in range(1, len(names)):
            seen, apart, left = self.unlike(truth)
            more = f" and {len(left) - SHOWN} more" if len(left) > SHOWN else ""
            rivals = ", ".join(names[k] for k in left[:SHOWN]) or "-"
            whole = f"{len(apart)} of {len(apart) + len(left)}"
            causes.append([names[truth], f"{seen:.0%}", whole, f"{rivals}{more}"])
        return [
            Table(("visit", "mismatch, 1/min", "force, N", "shifts", ""), visits),
            "",
            Table(
                ("true cause", "seen", "rivals distinguished",
                 "not distinguished in most strengths"), causes,
            ),
            "",
            f"{sum(plan.shifts)} shifts at {np.count_nonzero(plan.shifts)} of {plan.field.cells} "
            f"operating points, about {number(plan.hours)} h: chance to decide a pair of causes "
            f"rightly {plan.worth:.1%}, {self.told_apart:.0%} of pairs and strengths distinguished",
            "distinguished: expected odds of 4.5 : 1 and more for the true cause, over the "
            "strengths of the priors. Combinations of effects are not planned for.",
            *([f"table to fill in: {self.sheet}"] if self.sheet else []),
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap plan --json`` prints."""
        plan, names = self.inference, self._names
        return {
            "bench": self.bench.name,
            "shifts": sum(plan.shifts),
            "hours": plan.hours,
            "reference": self._point(plan.reference),
            "order": self._visits,
            "worth": plan.worth,
            "told_apart": self.told_apart,
            "threshold_nats": APART,
            "hypotheses": names,
            "pairs": [
                {
                    "truth": names[i],
                    "rival": names[j],
                    "log_bayes_factor": float(plan.log_odds[i, j]),
                    "told_apart": float(plan.apart[i, j]),
                }
                for i, j in np.argwhere(~np.eye(len(names), dtype=bool)).tolist()
            ],
            "sheet": None if self.sheet is None else str(self.sheet),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each visit: operating point and shifts."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame(self._visits).set_index("visit")

    @property
    def told_apart(self) -> float:
        """Share of ordered pairs and strengths that the plan distinguishes."""
        apart = self.inference.apart
        return float(apart[~np.eye(len(apart), dtype=bool)].mean())

    def unlike(self, truth: int) -> tuple[float, list[int], list[int]]:
        """Return the share of strengths that are seen, the distinct rivals, and the others."""
        apart = self.inference.apart[truth]
        others = sorted((k for k in range(1, len(apart)) if k != truth), key=apart.__getitem__)
        distinct = [k for k in others if apart[k] >= HALF]
        return float(apart[0]), distinct, others[: len(others) - len(distinct)]

    @property
    def _visits(self) -> list[dict[str, Any]]:
        again = self.inference.reference
        return [
            {"visit": k, **self._point(place), "shifts": n, "reference": place == again}
            for k, (place, n) in enumerate(self.inference.order, start=1)
        ]

    @property
    def _names(self) -> list[str]:
        return [h[0] if h else "none" for h in self.inference.field.hypotheses]

    def _point(self, place: int) -> dict[str, float]:
        point = self.bench.cells[place].point
        return {"mismatch_rpm": point.mismatch / RPM, "force_N": point.profile.force}


def plan_shifts(
    where: str | Path,
    shifts: int,
    *,
    points: int | None = None,
    seed: int = 1,
    out: str | Path | None = None,
    bank: str | Path = BANK,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress = SILENT,
) -> Plan:
    """Plan shifts on a bench: operating points, numbers, order, and the causes they distinguish.

    Parameters
    ----------
    where : folder of a data set, study, or name of one that the package brings; its operating
        points are the candidates, and times that it may have are not looked at.
    shifts : in all.
    points : operating points that are used, at most; None for any number.
    seed : of the order.
    out : file for the table to fill in at the bench, which must not be there yet. It is a
        ``shifts.csv`` without times; its column ``order`` shows a drift afterwards.
    bank, effects, jobs, progress : as in ``diagnose``.

    Raises
    ------
    InputError, DataError, StorageError
        For a data set, a number or a file that cannot be used, with the remedy.
    """
    file = None if out is None else Path(out)
    if file is not None and file.exists():
        raise StorageError(f"--out is {file}, which is there already; name another file")
    require_targets({"--out": file})
    bench = points_from(where)
    if points is not None and not 1 <= points <= len(bench.cells):
        raise InputError(
            f"number of operating points is {points}, but {bench.name} has {len(bench.cells)}; "
            f"give 1 to {len(bench.cells)}"
        )
    means = Means(Path(bank), None if effects is None else Path(effects), jobs, progress)
    plan = shift_plan(predicted_field(bench, means), shifts, seed, points)
    if file is not None:
        lines = [",".join((*COLUMNS[:7], "order"))]
        for place, count in plan.order:
            point = bench.cells[place].point
            values = rounded(point.mismatch / RPM), rounded(point.profile.force), point.profile.rise
            for _ in range(count):
                lines.append(f"{','.join(map(str, values))},1,,,,{len(lines)}")
        write_whole(file, "\n".join(lines) + "\n")
    return Plan(bench, plan, file)
