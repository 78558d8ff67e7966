"""Diagnosis of a bench data set: causes of its difference to simulation; update by new readings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from dogshape.diagnosis.bench.bench_data import Bench as BenchData
from dogshape.diagnosis.bench.bench_data import load_bench, require_times
from dogshape.diagnosis.diagnosis import Diagnosis as Inference
from dogshape.diagnosis.report.wording import chance, findings_record, headline_of, summary
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, Means, diagnosed
from dogshape.pipeline.diagnose.calibrated_study import (
    DRAWS,
    CalibratedStudy,
    calibrated_study,
    require_new_study,
)
from dogshape.pipeline.diagnose.consequence import Consequence, price_of, studied
from dogshape.pipeline.diagnose.gap_update import (
    add_update,
    asked_of,
    before_of,
    joined,
    keep_data,
    require_no_updates,
    settle_data,
    update_record,
)
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.record import Table, frame_of
from dogshape.pipeline.reports.gap_page import (
    cells_figure,
    cells_of,
    examined_lines,
    hypothesis_table,
    publish,
    residual_table,
    write_page,
)
from dogshape.pipeline.reports.text import time_text
from dogshape.result import Result
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.files import writing

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go


SHOWN = 6  #: hypotheses in the table of an update


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """Causes of a gap with their probabilities, the residuals, and the next test.

    Parameters
    ----------
    inference : probabilities and fits of the hypotheses, with the data set.
    consequence : effect of the cause on the best designs of a study; None where none was asked.
    folder : where report, record and table were written; None where nowhere.
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

    @property
    def probabilities(self) -> pd.Series:
        """Probability of each hypothesis, the most probable first; names joined by ``+``."""
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        named = {" + ".join(h) or "none": p for h, p in self.inference.posterior.items()}
        return pd.Series(named, name="probability").rename_axis("hypothesis")

    @property
    def facts(self) -> dict[str, str]:
        """Verdict in words, gap before and after, and the next test."""
        found = self.inference
        return {
            "data": found.bench.name,
            "verdict": headline_of(found.verdict, found.effects),
            "gap": time_text(found.held_out.baseline),
            "gap at held-out points": time_text(found.held_out.held_out),
            "next test": found.tests[0].name if found.tests else "none",
        }

    @property
    def parts(self) -> list[str | Table]:
        """Verdict, hypotheses, residuals and the next test."""
        found, record = self.inference, self.to_dict()
        own = [name for name in found.effects if name not in load()]
        return [
            record["summary"],
            "",
            hypothesis_table(found),
            "",
            residual_table(found),
            "",
            f"Monte Carlo error of the leading probability: {found.noise:.3f}",
            *(f"own effect {name}: {chance(found.inclusion.get(name, 0.0))}" for name in own),
            "next test: {name}. {why}".format(**record["next_test"]),
            *([self.consequence.sentence] if self.consequence else []),
            *([f"report: {record['report']}"] if self.folder else []),
            *examined_lines(found.bench),
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

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each operating point: bench, simulation, gap, prediction, in s."""
        return frame_of(cells_of(self.inference))

    def plot(self) -> go.Figure:
        """Draw bench times, the simulation, and the leading hypothesis at held-out points."""
        return cells_figure(cells_of(self.inference))

    def report(self, path: str | Path) -> Path:
        """Write the report as one page that opens offline; give its path."""
        found = self.inference
        write_page(found, Path(path), self.consequence)
        return Path(path)

    def calibrated(
        self,
        path: str | Path,
        base: str | None = None,
        draws: int = DRAWS,
        causes: Sequence[str] | None = None,
    ) -> CalibratedStudy:
        """Write a study with the cause, and draws from the posterior beside it.

        Parameters
        ----------
        path : of the study file, which must not be there yet; its stem is the study's name.
        base : study that takes the effects; None for one of the bench's own clutch and points.
        draws : number of draws, in ``NAME-draws.csv``.
        causes : effects to write, for another set than the most probable one.

        Raises
        ------
        InputError
            The diagnosis names no effect, or none that a study takes; with the remedy.
        StorageError
            The file is there already or cannot be written.
        """
        target = Path(path)
        require_new_study(target)
        made = calibrated_study(self.inference, target, base, draws, causes=causes)
        made.write(target)
        return made


class _Read(Protocol):
    """A bench that was read (``dogshape.Bench``)."""

    @property
    def data(self) -> BenchData: ...


def diagnose(
    bench: str | Path | BenchData | _Read,
    *,
    correct: Sequence[str] = (),
    out: str | Path | None = None,
    bank: str | Path = BANK,
    effects: str | Path | None = None,
    study: str | None = None,
    engine: str = "planar",
    jobs: int = 0,
    progress: Progress = SILENT,
) -> Diagnosis:
    """Find which unmodelled effect makes a bench differ from the simulation.

    Parameters
    ----------
    bench : folder of a data set, name of one that the package brings, or a ``Bench``.
    correct : corrections of units and axes that the user confirms, ``"time=ms"``.
    out : folder for ``report.html``, ``gap.json``, ``cells.csv`` and a copy of the data set, which
        ``update_diagnosis`` joins new readings to; None writes nothing.
    bank : folder of simulations that diagnoses share.
    effects : folder with effects of the user's own.
    study : study, or folder of its results, whose best designs are simulated with the cause.
    engine : of the simulations, ``planar`` or ``drake``, which takes some hours for a clutch.
    jobs : worker processes, 0 for one a core.
    progress : shows the progress of simulations.

    Raises
    ------
    InputError, DataError, EffectError
        For a data set, an effect or a study that cannot be used, with the remedy.
    """
    if isinstance(bench, str | Path):
        given = load_bench(bench, correct)
    elif correct:
        rule = "which was read already; give the corrections where it is read"
        raise InputError(f"corrections {', '.join(correct)} are for a data set, {rule}")
    else:
        given = bench if isinstance(bench, BenchData) else bench.data
    own = None if effects is None else Path(effects)
    means = Means(Path(bank), own, jobs, progress, engine)
    folder = None if out is None else Path(out)
    if folder is not None:
        require_no_updates(folder)
    if study is not None:
        studied(study)  # refuses a study without a result before the long work
    with nullcontext() if folder is None else writing(folder):
        found, where = diagnosed(given, means), "not written, for lack of --out"
        if folder is not None:
            where = f"written to {publish(found, folder)}"
            keep_data(given, folder, means.effects)
        if study is None:
            return Diagnosis(found, None, folder)
        verdict = headline_of(found.verdict, found.effects)
        progress.say(f"{verdict}. The report is {where}; next: simulation of the study's designs")
        price = price_of(found, study, means, folder or Path(bank))
        if folder is not None:
            publish(found, folder, price)
    return Diagnosis(found, price, folder)


@dataclass(frozen=True, repr=False)
class Update(Result):
    """Change of a diagnosis by new readings.

    Parameters
    ----------
    diagnosis : with the new readings.
    record : of this update: new readings, before, after, and why in a sentence.
    folder : of the diagnosis.
    """

    diagnosis: Diagnosis
    record: dict[str, Any]
    folder: Path

    @property
    def facts(self) -> dict[str, str]:
        """Verdict before and after, and why."""
        return {
            "before": self.record["before"]["headline"],
            "now": self.record["after"]["headline"],
            "why": self.record["sentence"],
        }

    @property
    def parts(self) -> list[str | Table]:
        """Probabilities before and now, both verdicts, and the next test."""
        record, frame = self.to_dict(), self.to_frame()
        frame = frame.sort_values("after", ascending=False, kind="stable")[:SHOWN]
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
            *examined_lines(self.diagnosis.inference.bench),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap update --json`` prints."""
        return {
            **self.record,
            "next_test": self.diagnosis.to_dict()["next_test"],
            "report": str(self.folder / "report.html"),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each hypothesis: probability before and after."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        both = {when: self.record[when]["probabilities"] for when in ("before", "after")}
        return pd.DataFrame(both).fillna(0.0).rename_axis("hypothesis")


def update_diagnosis(
    folder: str | Path,
    new: str | Path,
    *,
    bank: str | Path = BANK,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress = SILENT,
) -> Update:
    """Join new readings to the data set of an earlier diagnosis, and diagnose again.

    Parameters
    ----------
    folder : of the earlier diagnosis (``diagnose`` with ``out``).
    new : table with the columns of ``shifts.csv``, in the same units.
    effects : folder with effects of the user's own; that of the earlier diagnosis by default.
    bank, jobs, progress : as in ``diagnose``. The engine is that of the earlier diagnosis, so that
        before and now differ by the readings alone.

    Raises
    ------
    DataError, StorageError
        For a table or a folder that cannot be used, with the remedy. Nothing is changed then.
    """
    place = Path(folder)
    asked = asked_of(place)
    with writing(place):
        bench, sheet = joined(place, Path(new), asked)
        require_times(bench)
        count = len(asked.joined)
        before = before_of(place, count)
        own = effects if effects is not None else asked.effects
        own = None if own is None else Path(own)
        found = diagnosed(bench, Means(Path(bank), own, jobs, progress, before["engine"]))
        record = update_record(before, found, sheet, count)
        publish(found, place, history=add_update(place, record, count))
        settle_data(place)
    return Update(Diagnosis(found, None, place), record, place)
