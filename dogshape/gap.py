"""Diagnosis of a bench data set, its update by new readings, and the plan of shifts before both."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from dogshape.bench.bench_data import Bench, load_bench, require_shifts
from dogshape.bench.bench_draft import BenchDraft, DraftTables, is_table, read_tables
from dogshape.bench.table import COLUMNS, RISE
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.inference.outcome import (
    DISTINCT_LOG_ODDS,
    NextTest,
    ShiftPlan,
    shift_plan,
)
from dogshape.diagnosis.report.wording import (
    cause_sentence,
    chance,
    findings_record,
    headline,
    remarks,
    shrink_sentence,
    summary,
)
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
from dogshape.pipeline.drafts.bench_folder import draft_bench
from dogshape.pipeline.drafts.reading_table import (
    BenchReading,
    assumption_lines,
    left_out_lines,
)
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import Figure, Frame, Table, frame_of
from dogshape.pipeline.reports import gap_page
from dogshape.pipeline.reports.text import bind_units
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.folder_lock import lock_folder
from dogshape.result import Result
from dogshape.running import receiver
from dogshape.sim.errors import InputError, StorageError, number
from dogshape.sim.files import write_frame
from dogshape.sim.interface import argument
from dogshape.sim.units import RPM

TEXT_WIDTH = 80  #: characters of sentences and of the map of a diagnosis
SHOWN_HYPOTHESES = 6  #: in the table of an update
SHOWN_RIVALS = 4  #: in a row of a plan
MIN_DISTINCT_SHARE = 0.5  #: share of strengths from which two causes count as distinguished


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """Causes of a gap with their probabilities, the residuals, and the next test.

    ``consequence`` is the effect of the cause on the best designs of a study, ``folder`` has the
    written report, record and table, ``reading`` is that of a table (``write_bench``);
    None without a study, a folder or a table.
    """

    inference: Inference
    consequence: Consequence | None = None
    folder: Path | None = None
    reading: BenchReading | None = None

    @property
    def verdict(self) -> str:
        """``effect``, ``none``, ``unknown`` or ``ambiguous``."""
        return self.inference.verdict.kind

    @property
    def causes(self) -> tuple[str, ...]:
        """Effects that are part of the cause by the verdict."""
        return tuple(self.inference.verdict.causes)

    @property
    def next_test(self) -> NextTest | None:
        """Bench test that is worth most; None if no test is."""
        return next(iter(self.inference.tests), None)

    @property
    def next_test_line(self) -> str:
        """Line on the next test."""
        test = self.next_test
        return f"next test: {test.name}. {test.why}" if test else "next test: none"

    @property
    def report_file(self) -> Path | None:
        """Written page; None without a folder."""
        return None if self.folder is None else self.folder / "report.html"

    def to_parts(self) -> list[str | Table]:
        """Answer in order: where, which, how far, next test; then the files and the reading."""
        inference = self.inference
        parts: list[str | Table] = [
            headline(inference),
            "",
            *_wrapped(f"where: {inference.where}"),
            "gap in ms (standard errors) over force and mismatch:",
            gap_page.map_table(inference, TEXT_WIDTH),
            "",
            *_wrapped(f"which: {cause_sentence(inference)}"),
            gap_page.effect_table(inference),
        ]
        for remark in remarks(inference):
            parts += _wrapped(remark)
        parts += ["", *_wrapped(f"how far: {shrink_sentence(inference)}")]
        parts += ["", *_wrapped(self.next_test_line)]
        if self.consequence:
            parts += _wrapped(self.consequence.sentence)
        if self.folder:
            parts.append(f"report: {self.report_file}")
        parts += gap_page.examined_lines(inference.bench)
        if self.reading:
            parts.append(f"read: {self.reading.count_text}")
            parts += left_out_lines(self.reading.report.left_out)
            parts += assumption_lines(self.reading.assumed)
        return parts

    def to_dict(self) -> dict[str, Any]:
        """Convert the diagnosis to the record that ``dogshape diagnose --json`` prints."""
        return {
            **self.inference.to_dict(),
            "summary": summary(self.inference),
            "remarks": remarks(self.inference),
            **findings_record(self.inference.bench),
            "so_what": self.consequence.record if self.consequence else None,
            "report": str(self.report_file) if self.report_file else None,
            "reading": self.reading.to_dict() if self.reading else None,
        }

    def to_frame(self) -> Frame:
        """Tabulate bench, simulation, gap and prediction, s, a row for each operating point."""
        return frame_of(gap_page.cells_of(self.inference))

    def plot(self) -> Figure:
        """Draw bench times, the simulation, and the leading hypothesis at held-out points."""
        return gap_page.cells_figure(gap_page.cells_of(self.inference))

    def report(self, path: str | Path, **block: str) -> Path:
        """Write the page of the diagnosis, as ``out`` of ``diagnose`` does; returns its path.

        ``block`` has values of the title block, as in ``StudyResult.report``.
        """
        page = gap_page.compose_page(self.inference, self.consequence, block=block)
        page.save(Path(path))
        return Path(path)

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
        study = calibrated_study.calibrated_study(self.inference, target, base, draws, causes)
        study.write(target)
        return study


def _wrapped(sentence: str) -> list[str]:
    """Break a sentence into lines, between numbers and their units nowhere."""
    lines = textwrap.wrap(
        bind_units(sentence), TEXT_WIDTH, break_long_words=False, break_on_hyphens=False
    )
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _bank_options(
    bank: str | Path | None,
    effects: str | Path | None,
    jobs: int,
    progress: Progress | bool | None,
    **settings: Any,
) -> BankOptions:
    """Build the options of a diagnosis from the arguments of a verb."""
    folder = None if effects is None else Path(effects)
    return BankOptions(Path(bank or BANK), folder, jobs, receiver(progress), **settings)


@contextmanager
def _data_of(
    bench: str | Path | BenchDraft | DraftTables, correct: Sequence[str], listener: Progress
) -> Iterator[tuple[Bench, BenchReading | None]]:
    """Yield the data set and its reading, None for a folder.

    Assumptions of the reading of a table go to ``listener``.
    """
    if isinstance(bench, str | Path):
        if not is_table(bench):
            yield load_bench(bench, correct), None
            return
        bench = BenchDraft(bench)
    tables = read_tables(bench) if isinstance(bench, BenchDraft) else bench
    with draft_bench(tables, correct) as (data, reading):
        for line in assumption_lines(reading.assumed):
            listener.say(line)
        yield data, reading


def diagnose(
    bench: str | Path | BenchDraft | DraftTables,
    *,
    correct: Sequence[str] = (),
    out: str | Path | None = None,
    bank: str | Path | None = None,
    effects: str | Path | None = None,
    study: str | None = None,
    engine: str = "planar",
    seed: int = 1,
    jobs: int = 0,
    progress: Progress | bool | None = None,
) -> Diagnosis:
    """Find which unmodelled effect makes a bench differ from the simulation.

    InputError, DataError or EffectError for a data set, an effect or a study that cannot be used,
    with the remedy. Example: ``ds.diagnose("mq200_stand", out="results/gap", progress=True)``

    Parameters
    ----------
    bench : folder of a data set, name of one that the package brings, path of a table
        (``"measured.csv"``, ``"FILE.xlsx#SHEET"``), or a ``BenchDraft``, which says how to read its
        tables; ``BenchDraft(path)`` is the same as a path. ``DraftTables`` are not read again.
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
    listener = receiver(progress)
    settings = replace(USUAL, seed=seed)
    options = _bank_options(bank, effects, jobs, listener, engine=engine, settings=settings)
    folder = None if out is None else Path(out)
    with _data_of(bench, correct, listener) as (data, reading):
        if folder is not None:
            gap_update.require_no_updates(folder)
            _require_no_study(folder)
        if study is not None:
            load_candidates(study)  # refuses a study without a result before the long work
        with nullcontext() if folder is None else lock_folder(folder):
            inference = diagnose_bench(data, options)
            report_state = f"not written, for lack of {argument('out')}"
            if folder is not None:
                report_state = f"written to {gap_page.publish(inference, folder)}"
                gap_update.keep_data(data, folder, options.effects)
            if study is None:
                return Diagnosis(inference, None, folder, reading)
            next_step = f"The report is {report_state}; next: simulation of the study's designs"
            listener.say(f"{headline(inference)}. {next_step}")
            consequence = compute_consequence(inference, study, options, folder or options.bank)
            if folder is not None:
                gap_page.publish(inference, folder, consequence)
    return Diagnosis(inference, consequence, folder, reading)


def _require_no_study(folder: Path) -> None:
    """Raise StorageError for a folder of a study, whose report a diagnosis would replace."""
    for file in (StudyFolder(folder).manifest, folder / "study.toml"):
        if file.is_file():
            fault = f"which holds a study ({file.name}), whose report a diagnosis would replace"
            raise StorageError(f"{argument('out')} is {folder}, {fault}; name another folder")


@dataclass(frozen=True, repr=False)
class Update(Result):
    """Change of a diagnosis by new readings.

    ``diagnosis`` includes the new readings, ``record`` has the probabilities before and after, the
    readings and the reason of the change.
    """

    diagnosis: Diagnosis
    record: gap_update.UpdateRecord

    def to_parts(self) -> list[str | Table]:
        """Tabulate probabilities before and after, with both verdicts and the next test."""
        diagnosis = self.diagnosis
        ranking = self.to_frame().sort_values("after", ascending=False, kind="stable")
        leading = ranking[:SHOWN_HYPOTHESES]
        rows = [[row[0], *map(chance, row[1:])] for row in leading.itertuples()]
        return [
            self.record.sentence,
            "",
            Table(("hypothesis", "before", "now"), rows),
            "",
            f"before: {self.record.before.headline}",
            f"now: {self.record.after.headline}",
            diagnosis.next_test_line,
            f"report: {diagnosis.report_file}",
            *gap_page.examined_lines(diagnosis.inference.bench),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Convert the update to the record that ``dogshape update-diagnosis --json`` prints."""
        test = self.diagnosis.next_test
        report = self.diagnosis.report_file
        return {
            **self.record.to_dict(),
            "next_test": test.to_dict() if test else None,
            "report": str(report) if report else None,
        }

    def plot(self) -> Figure:
        """Draw the probabilities of the leading hypotheses before and after the readings."""
        from dogshape.pipeline.reports.result_figures import probabilities_figure  # noqa: PLC0415

        ranking = self.to_frame().sort_values("after", ascending=False, kind="stable")
        leading = ranking[:SHOWN_HYPOTHESES]
        return probabilities_figure(
            leading.index.tolist(), leading.before.tolist(), leading.after.tolist()
        )

    def to_frame(self) -> Frame:
        """Tabulate probabilities before and after, a row for each hypothesis."""
        columns = {
            "before": self.record.before.probabilities,
            "after": self.record.after.probabilities,
        }
        return pd.DataFrame(columns).fillna(0.0).rename_axis("hypothesis")


def update_diagnosis(
    folder: str | Path,
    new: str | Path,
    *,
    bank: str | Path | None = None,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress | bool | None = None,
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
    target = Path(folder)
    request = gap_update.read_request(target)
    with lock_folder(target):
        bench, sheet = gap_update.join_readings(target, Path(new), request)
        require_shifts(bench, times=True)
        count = len(request.joined)
        previous = gap_update.keep_previous(target, count)
        effects = request.effects if effects is None else effects
        options = _bank_options(bank, effects, jobs, progress, engine=previous.engine)
        inference = diagnose_bench(bench, options)
        record = gap_update.update_record(previous, inference, sheet, count)
        history = gap_update.add_update(target, record, count)
        gap_page.publish(inference, target, history=history)
        gap_update.settle_data(target)
    return Update(Diagnosis(inference, None, target), record)


class PlannedVisit(NamedTuple):
    """Visit of an operating point in a plan; its fields are keys of the record."""

    visit: int  #: number, from 1
    mismatch_rpm: float
    force_N: float
    shifts: int
    reference: bool  #: whether the point is the reference, which shows a drift

    @property
    def cells(self) -> list[str]:
        """Cells of the visit's row in a table."""
        return [
            str(self.visit),
            number(self.mismatch_rpm),
            number(self.force_N),
            str(self.shifts),
            "reference" if self.reference else "",
        ]


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """Planned shifts in their order, with the causes that they distinguish.

    ``bench`` has the operating points, ``sheet`` is the table to fill in, None if not written.
    """

    bench: Bench
    inference: ShiftPlan
    sheet: Path | None = None

    @property
    def visits(self) -> list[PlannedVisit]:
        """Visits in their order."""
        visits = []
        for visit, (index, shifts) in enumerate(self.inference.order, start=1):
            point = self.bench.cells[index].point
            visits.append(
                PlannedVisit(
                    visit=visit,
                    mismatch_rpm=point.mismatch / RPM,
                    force_N=point.profile.force,
                    shifts=shifts,
                    reference=index == self.inference.reference,
                )
            )
        return visits

    @property
    def hypotheses(self) -> list[str]:
        """Names of the causes that may be true, ``none`` first."""
        return [h[0] if h else "none" for h in self.inference.field.hypotheses]

    @property
    def distinct_share(self) -> float:
        """Share of pairs of causes and of their strengths that the plan distinguishes."""
        pairs = ~np.eye(len(self.hypotheses), dtype=bool)
        return float(self.inference.distinct_share[pairs].mean())

    def to_parts(self) -> list[str | Table]:
        """Tabulate visits, and rivals of each cause, with the value of the plan."""
        plan = self.inference
        visits = [visit.cells for visit in self.visits]
        names = self.hypotheses
        causes = [_rival_cells(plan, names, truth) for truth in range(1, len(names))]
        cause_heads = (
            "true cause",
            "seen",
            "rivals distinguished",
            "not distinguished in most strengths",
        )
        return [
            Table(("visit", "mismatch, 1/min", "force, N", "shifts", ""), visits),
            "",
            Table(cause_heads, causes),
            "",
            f"{sum(plan.shifts)} shifts at {np.count_nonzero(plan.shifts)} of {len(plan.shifts)} "
            f"operating points, about {number(plan.hours)} h: chance to decide a pair of causes "
            f"rightly {chance(plan.worth)}, {chance(self.distinct_share)} of pairs and strengths "
            "distinguished",
            "distinguished: expected odds of 4.5 : 1 and more for the true cause, over the "
            "strengths of the priors. Combinations of effects are not planned for.",
            *([f"table to fill in: {self.sheet}"] if self.sheet else []),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Convert the plan to the record that ``dogshape plan-shifts --json`` prints."""
        plan = self.inference
        names = self.hypotheses
        reference = self.bench.cells[plan.reference].point
        pairs = ~np.eye(len(names), dtype=bool)
        return {
            "bench": self.bench.name,
            "shifts": sum(plan.shifts),
            "hours": plan.hours,
            "reference": {
                "mismatch_rpm": reference.mismatch / RPM,
                "force_N": reference.profile.force,
            },
            "order": [visit._asdict() for visit in self.visits],
            "worth": plan.worth,
            "told_apart": self.distinct_share,
            "threshold_nats": DISTINCT_LOG_ODDS,
            "hypotheses": names,
            "pairs": [
                {
                    "truth": names[i],
                    "rival": names[j],
                    "log_bayes_factor": float(plan.log_odds[i, j]),
                    "told_apart": float(plan.distinct_share[i, j]),
                }
                for i, j in np.argwhere(pairs).tolist()
            ],
            "sheet": None if self.sheet is None else str(self.sheet),
        }

    def plot(self) -> Figure:
        """Draw the number of planned shifts by operating point."""
        from dogshape.pipeline.reports.result_figures import plan_figure  # noqa: PLC0415

        points = [cell.point for cell in self.bench.cells]
        return plan_figure(
            [point.mismatch / RPM for point in points],
            [point.profile.force for point in points],
            [int(count) for count in self.inference.shifts],
        )

    def to_frame(self) -> Frame:
        """Tabulate operating point and number of shifts, a row for each visit."""
        return pd.DataFrame(self.visits).set_index("visit")


def _rival_cells(plan: ShiftPlan, names: Sequence[str], truth: int) -> list[str]:
    """Count the rivals that the plan distinguishes from a true cause, and list the others."""
    distinct_share = plan.distinct_share[truth]
    rivals = [k for k in range(1, len(distinct_share)) if k != truth]
    rivals.sort(key=distinct_share.__getitem__)
    similar = [names[k] for k in rivals if distinct_share[k] < MIN_DISTINCT_SHARE]
    similar_text = ", ".join(similar[:SHOWN_RIVALS]) or "-"
    if len(similar) > SHOWN_RIVALS:
        similar_text += f" and {len(similar) - SHOWN_RIVALS} more"
    distinguished = f"{len(rivals) - len(similar)} of {len(rivals)}"
    return [names[truth], chance(distinct_share[0]), distinguished, similar_text]


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
    progress: Progress | bool | None = None,
) -> Plan:
    """Plan shifts on a bench: operating points, numbers, order, and the causes they distinguish.

    InputError, DataError or StorageError for a data set, a number or a file that cannot be used,
    with the remedy. Example: ``ds.plan_shifts("mq200_stand", 120, out="to_fill.xlsx")``

    Parameters
    ----------
    where : folder of a data set, study, or name of one that the package brings; its operating
        points are the candidates, its times are not used.
    shifts : total number.
    points : largest number of operating points; None for any number.
    seed : of the order.
    out : CSV or .xlsx file for the table to fill in at the bench, which must not be there yet. It
        is a ``shifts.csv`` without times; its column ``order`` shows a drift afterwards.
    bank, effects, jobs, progress : as in ``diagnose``.
    """
    file = None if out is None else Path(out)
    if file is not None and file.exists():
        fault = f"{argument('out')} is {file}, which is there already"
        raise StorageError(f"{fault}; name another file")
    require_targets({argument("out"): file})
    bench = load_points(where)
    if points is not None and not 1 <= points <= len(bench.cells):
        raise InputError(
            f"number of operating points is {points}, but {bench.name} has {len(bench.cells)}; "
            f"give 1 to {len(bench.cells)}"
        )
    options = _bank_options(bank, effects, jobs, progress)
    plan = shift_plan(predict_field(bench, options), shifts, seed, points)
    if file is not None:
        write_frame(_shift_sheet(bench, plan), file, digits=12)
    return Plan(bench, plan, file)


def _shift_sheet(bench: Bench, plan: ShiftPlan) -> pd.DataFrame:
    """Tabulate the planned shifts, a row each, with empty columns for the readings."""
    rows: list[tuple[float, float, float, int]] = []
    for cell, count in plan.order:
        point = bench.cells[cell].point
        profile = point.profile
        row = (rounded(point.mismatch / RPM), rounded(profile.force), profile.rise, 1)
        rows += [row] * count
    sheet = pd.DataFrame(rows, columns=[*COLUMNS[:4]]).reindex(columns=[*COLUMNS[:7]])
    if bench.clutch.actuator is not None:
        sheet = sheet.drop(columns=RISE)
    return sheet.assign(order=range(1, len(rows) + 1))
