"""From a data set or a study to a plan of shifts, and the table to fill in at the bench."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.diagnosis.bench.stand_file import BenchRecord, Sensor
from dogshape.diagnosis.bench.table import COLUMNS
from dogshape.diagnosis.inference.shift_plan import Field, ShiftPlan, field_of, shift_plan
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.pipeline.config.study_file import bundled_studies, load_study
from dogshape.pipeline.diagnose.bank_diagnosis import Means, models_of
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.units import RPM


@dataclass(frozen=True)
class Wanted:
    """Plan that is asked for: shifts in all, seed of their order, operating points at most."""

    shifts: int
    seed: int = 1
    points: int | None = None


def points_from(where: str | Path) -> Bench:
    """Return the operating points and the clutch of a data set, or of a study.

    A plan uses no times of a data set. A study is a bench of which no shift is known yet.

    Raises
    ------
    InputError, DataError
        There is neither, or it cannot be read.
    """
    path, root = Path(where), bundled_root() / "bench"
    if (path / "bench.toml").is_file() or (root / str(where)).is_dir():
        return load_bench(where)
    if path.is_file() or (path / "study.toml").is_file() or str(where) in bundled_studies():
        study = load_study(where)
        rows = [Reading(k, point, 1, None, None) for k, point in enumerate(study.points, start=2)]
        return Bench(
            study.name, f"study {where}", study.clutch, gather(rows), None, Sensor(),
            record=BenchRecord(displacement_at="sleeve"),
        )  # fmt: skip
    sets = sorted(p.name for p in root.iterdir() if p.is_dir())
    raise InputError(
        f"there is no data set and no study at {where}: give a folder with bench.toml and "
        f"shifts.csv, a study file, or a bundled name ({', '.join([*sets, *bundled_studies()])})"
    )


def planned(bench: Bench, wanted: Wanted, means: Means) -> ShiftPlan:
    """Plan shifts at the operating points of a bench; simulates what no bank has of its clutch.

    Raises InputError for a number of shifts or points that makes no plan.
    """
    if wanted.points is not None and not 1 <= wanted.points <= len(bench.cells):
        raise InputError(
            f"number of operating points is {wanted.points}, but {bench.name} has "
            f"{len(bench.cells)}; give 1 to {len(bench.cells)}"
        )
    return shift_plan(predicted_field(bench, means), wanted.shifts, wanted.seed, wanted.points)


def predicted_field(bench: Bench, means: Means) -> Field:
    """Predict the effects at the operating points of a bench."""
    bench = replace(bench, clutch=bench.clutch.with_engine(means.engine))
    model = next(iter(models_of(bench, load(means.effects), means).values()))
    # A drift of the data set is none of the shifts that are planned.
    seen = replace(observe(bench, model), drift=None)
    return field_of(Likelihood(bench, seen, model, means.settings))


def sheet(bench: Bench, plan: ShiftPlan) -> str:
    """Write the plan as a ``shifts.csv`` whose times are still to be filled in, a row a shift.

    Its column ``order`` counts the shifts, so that a drift can be seen afterwards.
    """
    lines = [",".join((*COLUMNS[:7], "order"))]
    for place, count in plan.order:
        point = bench.cells[place].point
        values = rounded(point.mismatch / RPM), rounded(point.profile.force), point.profile.rise
        for _ in range(count):
            lines.append(f"{','.join(map(str, values))},1,,,,{len(lines)}")
    return "\n".join(lines) + "\n"
