"""Diagnosis of a bench data set, its update by new readings, and the plan of shifts before both."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, require_shifts
from dogshape.diagnosis.bench.table import COLUMNS
from dogshape.diagnosis.diagnosis import Diagnosis as Inference
from dogshape.diagnosis.inference.outcome import DISTINCT_LOG_ODDS, ShiftPlan, shift_plan
from dogshape.diagnosis.report.wording import chance, findings_record, headline_of, summary
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.diagnose import calibrated_study, gap_update
from dogshape.pipeline.diagnose.bank_diagnosis import (
    BANK,
    BankOptions,
    diagnose_bench,
    load_points,
    predict_field,
)
from dogshape.pipeline.diagnose.consequence import Consequence, compute_consequence, load_candidates
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import Figure, Frame, Result, Table, frame_of
from dogshape.pipeline.reports import gap_page
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.running import receiver
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError, StorageError, number
from dogshape.sim.files import write_frame, writing
from dogshape.sim.units import RPM

SHOWN_HYPOTHESES = 6  #: in the table of an update
SHOWN_RIVALS = 4  #: in a row of a plan
HALF = 0.5  #: share of the strengths from which two effects count as distinguished


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """Causes of a gap with their probabilities, the residuals, and the next test.

    ``consequence`` is the effect of the cause on the best designs of a study, None where none was
    asked, ``folder`` where report, record and table were written, None where nowhere.
    """

    inference: Inference
    consequence: Consequence | None = None
    folder: Path | None = None

    @property
    def verdict(self) -> str:
        """``effect``, ``none``, ``unknown`` or ``ambiguous``."""
        return self.inference.verdict.kind

    @property
    def causes(self) -> tuple[str, ...]:
        """Effects that are part of the cause by the verdict."""
        return tuple(self.inference.verdict.causes)

    def to_parts(self) -> list[str | Table]:
        """Give verdict, hypotheses, residuals and the next test."""
        found, record = self.inference, self.to_dict()
        own = [name for name in found.effects if name not in load()]
        return [
            record["summary"],
            "",
            gap_page.hypothesis_table(found),
            "",
            gap_page.residual_table(found),
            "",
            f"Monte Carlo error of the leading probability: {100 * found.leading_error:.2g} %",
            *(f"own effect {name}: {chance(found.inclusion.get(name, 0.0))}" for name in own),
            "next test: {name}. {why}".format(**record["next_test"]),
            *([self.consequence.sentence] if self.consequence else []),
            *([f"report: {record['report']}"] if self.folder else []),
            *gap_page.examined_lines(found.bench),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap --json`` prints."""
        return {
            **self.inference.to_dict(),
            "summary": summary(self.inference),
            **findings_record(self.inference.bench),
            "so_what": self.consequence.record if self.consequence else None,
            "report": str(self.folder / "report.html") if self.folder else None,
        }

    def to_frame(self) -> Frame:
        """Give a row for each operating point: bench, simulation, gap, prediction, in s."""
        return frame_of(gap_page.cells_of(self.inference))

    def plot(self) -> Figure:
        """Draw bench times, the simulation, and the leading hypothesis at held-out points."""
        return gap_page.cells_figure(gap_page.cells_of(self.inference))

    def calibrated(
        self,
        path: str | Path,
        base: str | None = None,
        draws: int = calibrated_study.DRAWS,
        causes: Sequence[str] | None = None,
    ) -> calibrated_study.CalibratedStudy:
        """Write a study with the cause, and draws from the posterior beside it.

        InputError where the diagnosis names no effect, or none that a study takes; StorageError for
        a file that cannot be written.

        Parameters
        ----------
        path : of the study file, which must not be there yet; its stem is the study's name.
        base : study that takes the effects; None for one of the bench's own clutch and points.
        draws : number of draws, in ``NAME-draws.csv``.
        causes : effects to write, for another set than the most probable one.
        """
        target = Path(path)
        calibrated_study.require_new_study(target)
        made = calibrated_study.calibrated_study(self.inference, target, base, draws, causes)
        made.write(target)
        return made


def _means(
    bank: str | Path | None,
    effects: str | Path | None,
    jobs: int,
    progress: Progress | bool,
    **settings: Any,
) -> BankOptions:
    """Build the options of a diagnosis from the arguments of a verb."""
    folder = None if effects is None else Path(effects)
    return BankOptions(Path(bank or BANK), folder, jobs, receiver(progress), **settings)


def diagnose(
    bench: str | Path,
    *,
    correct: Sequence[str] = (),
    out: str | Path | None = None,
    bank: str | Path | None = None,
    effects: str | Path | None = None,
    study: str | None = None,
    engine: str = "planar",
    seed: int = 1,
    jobs: int = 0,
    progress: Progress | bool = False,
) -> Diagnosis:
    """Find which unmodelled effect makes a bench differ from the simulation.

    InputError, DataError or EffectError for a data set, an effect or a study that cannot be used,
    with the remedy. Example: ``ds.diagnose("mq200_stand", out="results/gap", progress=True)``

    Parameters
    ----------
    bench : folder of a data set, or name of one that the package brings.
    correct : corrections of units and axes that the user confirms, ``"time=ms"``.
    out : folder for ``report.html``, ``gap.json``, ``cells.csv`` and a copy of the data set, which
        ``update_diagnosis`` joins new readings to; None writes nothing.
    bank : folder of simulations that diagnoses share; None for one in the user's cache.
    effects : folder with effects of the user's own.
    study : study, or folder of its results, whose best designs are simulated with the cause.
    engine : of the simulations, ``planar`` or ``drake``, which takes some hours for a clutch.
    seed : of the random draws; another one repeats the inference independently.
    jobs, progress : as in ``Study.expect``.
    """
    given, listener = load_bench(bench, correct), receiver(progress)
    settings = replace(USUAL, seed=seed)
    means = _means(bank, effects, jobs, listener, engine=engine, settings=settings)
    folder = None if out is None else Path(out)
    if folder is not None:
        gap_update.require_no_updates(folder)
        _require_no_study(folder)
    if study is not None:
        load_candidates(study)  # refuses a study without a result before the long work
    with nullcontext() if folder is None else writing(folder):
        found, where, price = diagnose_bench(given, means), "not written, for lack of --out", None
        if folder is not None:
            where = f"written to {gap_page.publish(found, folder)}"
            gap_update.keep_data(given, folder, means.effects)
        if study is not None:
            words = f"The report is {where}; next: simulation of the study's designs"
            listener.say(f"{headline_of(found.verdict, found.effects)}. {words}")
            price = compute_consequence(found, study, means, folder or means.bank)
            if folder is not None:
                gap_page.publish(found, folder, price)
    return Diagnosis(found, price, folder)


def _require_no_study(folder: Path) -> None:
    """Raise StorageError for a folder of a study, whose report a diagnosis would write over."""
    for file in (StudyFolder(folder).manifest, folder / "study.toml"):
        if file.is_file():
            fault = f"which holds a study ({file.name}), whose report a diagnosis would replace"
            raise StorageError(f"--out is {folder}, {fault}; name another folder")


@dataclass(frozen=True, repr=False)
class Update(Result):
    """Change of a diagnosis by new readings.

    ``diagnosis`` is that with the new readings, ``record`` has them, before, after, and why.
    """

    diagnosis: Diagnosis
    record: dict[str, Any]

    def to_parts(self) -> list[str | Table]:
        """Give probabilities before and now, both verdicts, and the next test."""
        record, frame = self.to_dict(), self.to_frame()
        frame = frame.sort_values("after", ascending=False, kind="stable")[:SHOWN_HYPOTHESES]
        rows = [[row[0], *map(chance, row[1:])] for row in frame.itertuples()]
        return [
            self.record["sentence"],
            "",
            Table(("hypothesis", "before", "now"), rows),
            "",
            f"before: {self.record['before']['headline']}",
            f"now: {self.record['after']['headline']}",
            "next test: {name}. {why}".format(**record["next_test"]),
            f"report: {record['report']}",
            *gap_page.examined_lines(self.diagnosis.inference.bench),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap update --json`` prints."""
        after = self.diagnosis.to_dict()
        return {**self.record, "next_test": after["next_test"], "report": after["report"]}

    def to_frame(self) -> Frame:
        """Give a row for each hypothesis: probability before and after."""
        both = {when: self.record[when]["probabilities"] for when in ("before", "after")}
        return pd.DataFrame(both).fillna(0.0).rename_axis("hypothesis")


def update_diagnosis(
    folder: str | Path,
    new: str | Path,
    *,
    bank: str | Path | None = None,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress | bool = False,
) -> Update:
    """Join new readings to the data set of an earlier diagnosis, and diagnose again.

    DataError or StorageError for a table or a folder that cannot be used, with the remedy. Nothing
    is changed then. Example: ``ds.update_diagnosis("results/gap", "new.csv")``

    Parameters
    ----------
    folder : of the earlier diagnosis (``diagnose`` with ``out``).
    new : CSV or .xlsx table with the columns of ``shifts.csv``, in the same units.
    effects : folder with effects of the user's own; that of the earlier diagnosis by default.
    bank, jobs, progress : as in ``diagnose``. The engine is that of the earlier diagnosis, so that
        before and now differ by the readings alone.
    """
    place = Path(folder)
    asked = gap_update.read_request(place)
    with writing(place):
        bench, sheet = gap_update.join_readings(place, Path(new), asked)
        require_shifts(bench, times=True)
        count = len(asked.joined)
        before = gap_update.keep_previous(place, count)
        effects = asked.effects if effects is None else effects
        means = _means(bank, effects, jobs, progress, engine=before["engine"])
        found = diagnose_bench(bench, means)
        record = gap_update.update_record(before, found, sheet, count)
        gap_page.publish(found, place, history=gap_update.add_update(place, record, count))
        gap_update.settle_data(place)
    return Update(Diagnosis(found, None, place), record)


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """Shifts to make, in their order, and the causes that they distinguish.

    ``bench`` has the operating points, ``sheet`` is the table to fill in; None for none.
    """

    bench: Bench
    inference: ShiftPlan
    sheet: Path | None = None

    def to_parts(self) -> list[str | Table]:
        """Give visits in their order, the rivals of each cause, and the worth of the plan."""
        record, plan, causes = self.to_dict(), self.inference, []
        visits = [
            [str(one["visit"]), number(one["mismatch_rpm"]), number(one["force_N"]),
             str(one["shifts"]), "reference" if one["reference"] else ""]
            for one in record["order"]
        ]  # fmt: skip
        names = record["hypotheses"]
        for truth, apart in enumerate(plan.distinct_share[1:], start=1):
            others = [k for k in range(1, len(apart)) if k != truth]
            left = [names[k] for k in sorted(others, key=apart.__getitem__) if apart[k] < HALF]
            more = f" and {len(left) - SHOWN_RIVALS} more" if len(left) > SHOWN_RIVALS else ""
            rivals = ", ".join(left[:SHOWN_RIVALS]) or "-"
            whole = f"{len(others) - len(left)} of {len(others)}"
            causes.append([names[truth], chance(apart[0]), whole, f"{rivals}{more}"])
        return [
            Table(("visit", "mismatch, 1/min", "force, N", "shifts", ""), visits),
            "",
            Table(
                ("true cause", "seen", "rivals distinguished",
                 "not distinguished in most strengths"), causes,
            ),
            "",
            f"{record['shifts']} shifts at {np.count_nonzero(plan.shifts)} of {len(plan.shifts)} "
            f"operating points, about {number(plan.hours)} h: chance to decide a pair of causes "
            f"rightly {chance(plan.worth)}, {chance(record['told_apart'])} of pairs and strengths "
            "distinguished",
            "distinguished: expected odds of 4.5 : 1 and more for the true cause, over the "
            "strengths of the priors. Combinations of effects are not planned for.",
            *([f"table to fill in: {self.sheet}"] if self.sheet else []),
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap plan --json`` prints."""
        plan = self.inference
        names = [h[0] if h else "none" for h in plan.field.hypotheses]
        places = [{"mismatch_rpm": one.point.mismatch / RPM, "force_N": one.point.profile.force}
                  for one in self.bench.cells]  # fmt: skip
        pairs = ~np.eye(len(names), dtype=bool)
        return {
            "bench": self.bench.name,
            "shifts": sum(plan.shifts),
            "hours": plan.hours,
            "reference": places[plan.reference],
            "order": [
                {"visit": k, **places[at], "shifts": n, "reference": at == plan.reference}
                for k, (at, n) in enumerate(plan.order, start=1)
            ],
            "worth": plan.worth,
            "told_apart": float(plan.distinct_share[pairs].mean()),
            "threshold_nats": DISTINCT_LOG_ODDS,
            "hypotheses": names,
            "pairs": [
                {"truth": names[i], "rival": names[j],
                 "log_bayes_factor": float(plan.log_odds[i, j]),
                 "told_apart": float(plan.distinct_share[i, j])}
                for i, j in np.argwhere(pairs).tolist()
            ],
            "sheet": None if self.sheet is None else str(self.sheet),
        }  # fmt: skip

    def to_frame(self) -> Frame:
        """Give a row for each visit: operating point and shifts."""
        return pd.DataFrame(self.to_dict()["order"]).set_index("visit")


def plan_shifts(
    where: str | Path,
    shifts: int,
    *,
    points: int | None = None,
    seed: int = 1,
    out: str | Path | None = None,
    bank: str | Path | None = None,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress | bool = False,
) -> Plan:
    """Plan shifts on a bench: operating points, numbers, order, and the causes they distinguish.

    InputError, DataError or StorageError for a data set, a number or a file that cannot be used,
    with the remedy. Example: ``ds.plan_shifts("mq200_stand", 120, out="to_fill.xlsx")``

    Parameters
    ----------
    where : folder of a data set, study, or name of one that the package brings; its operating
        points are the candidates, and times that it may have are not looked at.
    shifts : in all.
    points : operating points that are used, at most; None for any number.
    seed : of the order.
    out : CSV or .xlsx file for the table to fill in at the bench, which must not be there yet. It
        is a ``shifts.csv`` without times; its column ``order`` shows a drift afterwards.
    bank, effects, jobs, progress : as in ``diagnose``.
    """
    file = None if out is None else Path(out)
    if file is not None and file.exists():
        raise StorageError(f"--out is {file}, which is there already; name another file")
    require_targets({"--out": file})
    bench = load_points(where)
    if points is not None and not 1 <= points <= len(bench.cells):
        raise InputError(
            f"number of operating points is {points}, but {bench.name} has {len(bench.cells)}; "
            f"give 1 to {len(bench.cells)}"
        )
    means = _means(bank, effects, jobs, progress)
    plan = shift_plan(predict_field(bench, means), shifts, seed, points)
    if file is not None:
        todo = [bench.cells[place].point for place, count in plan.order for _ in range(count)]
        rows = [(rounded(p.mismatch / RPM), rounded(p.profile.force), p.profile.rise, 1)
                for p in todo]  # fmt: skip
        sheet = pd.DataFrame(rows, columns=[*COLUMNS[:4]]).reindex(columns=[*COLUMNS[:7]])
        write_frame(sheet.assign(order=range(1, len(rows) + 1)), file, digits=12)
    return Plan(bench, plan, file)
