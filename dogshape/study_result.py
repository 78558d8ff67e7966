"""Result of a searched study: front, chosen design and its confirmation."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import Figure, Frame, Table
from dogshape.pipeline.reports.charts import front_figure
from dogshape.pipeline.reports.designs import designs_frame
from dogshape.pipeline.reports.headline import headline
from dogshape.pipeline.reports.named_design import named_design, stored_search
from dogshape.pipeline.reports.study_page import publish
from dogshape.pipeline.reports.study_summary import chosen_verdict, summary_tables
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord
from dogshape.pipeline.store.check_records import VerdictRow
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.result import Result
from dogshape.running import receiver
from dogshape.sim.errors import StorageError
from dogshape.sim.files import name_file_in_errors
from dogshape.sim.interface import verb
from dogshape.sim.versions import clone_remedy

#: Keys of the record that ``to_dict`` has.
PRINTED_KEYS = (
    "engine",
    "best",
    "front",
    "n_simulated_shifts",
    "n_simulated_designs",
    "confirmation",
    "audit",
)


@dataclass(frozen=True, repr=False)
class StudyResult(Result):
    """A searched study with its designs, the front, the chosen design and its confirmation.

    ``record`` is the content of ``result.json``, with the keys of ``docs/api/result.md``, ``page``
    the report, None without one, ``seconds_cpu`` the processor time of search, audit and
    report on this machine in this call, None for a result that was read.
    """

    config: Setup
    folder: Path
    record: StudyRecord
    page: Path | None
    seconds_cpu: float | None = None

    @property
    def best(self) -> DesignRow | None:
        """Chosen design, by the keys of ``result.json``; None where none passes every check."""
        return self.record.best

    @property
    def verdict(self) -> VerdictRow | None:
        """Verdict on the chosen design at the new angles; None without a design confirmed."""
        if self.best is None or self.record.confirmation is None:
            return None
        return chosen_verdict(self.config, self.best, self.record.confirmation)

    @property
    def front(self) -> Frame:
        """Designs that no other dominates, best first, a row each."""
        return designs_frame(self.record, list(self.config.variables), self.record.front)

    def to_parts(self) -> list[str | Table]:
        """Describe headline, gain, alternatives, facts and front as in the report."""
        page = self.page or f"none yet, {verb('report')} makes it"
        is_kept = not StudyFolder(self.folder).manifest.exists()  # without the shifts of a report
        parts: list[str | Table] = [headline(self.record)]
        for table in summary_tables(self.config, self.record):
            parts += ["", table]
        for reason, count in self.record.failed_shifts.items():
            parts.append(f"{count} shifts failed and count as not engaged: {reason}")
        return parts if is_kept else [*parts, "", f"report: {page}"]

    def to_dict(self) -> dict[str, Any]:
        """Convert chosen design, verdict, front, confirmation and work counts to values of JSON.

        ``feasible`` is true for a chosen design that passes every standard check.
        """
        verdict = self.verdict
        values = self.record.to_dict()
        return {
            **{key: values[key] for key in PRINTED_KEYS},
            "verdict": None if verdict is None else verdict.to_dict(),
            "feasible": verdict is not None and verdict.passes,
            "seconds_cpu": self.seconds_cpu,
            "report": None if self.page is None else str(self.page),
        }

    def to_frame(self) -> Frame:
        """Tabulate all designs of the search, a row each; missing values were not simulated."""
        return designs_frame(self.record, list(self.config.variables))

    def plot(self, objective: str | None = None) -> Figure:
        """Draw the front: the leading objective against another one, by default the next.

        With one objective alone, against the smallest margin. Example: ``result.plot()``
        """
        return front_figure(self.record, list(self.config.variables), objective or "")

    def data_sheet(self, design: int, path: str | Path, why: str = "", **block: str) -> Path:
        """Write the data sheet of the ``design`` with a number.

        ``path``, ``why`` and ``block`` as in ``Study.data_sheet``.
        Example: ``result.data_sheet(33, "sheet.html", decided_by="E. Fiala")``
        """
        from dogshape.designs import write_data_sheet  # noqa: PLC0415

        searched_design = named_design(f"{self.folder}#{design}")
        return write_data_sheet(searched_design, path, {"why": why, **block})

    def report(
        self,
        path: str | Path | None = None,
        progress: Progress | bool | None = None,
        **block: str,
    ) -> Path:
        """Write the report into the folder of the study, or to ``path``; returns its path.

        ``progress`` as in ``Study.expect``. ``block`` has values of the title block: number,
        revision, date, author, checker and decided_by. InputError for other keys.
        Example: ``result.report(number="4711", author="E. Fiala")``
        """
        page = publish(StudyFolder(self.folder), receiver(progress).say, block)
        if path is None:
            return page
        with name_file_in_errors(Path(path)):
            return Path(shutil.copyfile(page, path))


def load_result(folder: str | Path) -> StudyResult:
    """Read the result of a study from its ``folder``, or the kept one of a bundled study.

    StorageError for a folder without a study, or with damaged files. InputError for a
    ``result.json`` with keys that the schema lacks, or lacking keys of the schema.
    Example: ``ds.load_result("results/mine")``, ``ds.load_result("mq200")`` in a clone
    """
    stored = stored_search(str(folder))
    if stored is None:
        raise StorageError(
            f"there is no study.json in {folder}; run {verb('search')} first"
            f"{clone_remedy(str(folder))}"
        )
    report = StudyFolder(stored.folder).report
    page = report if report.is_file() else None
    return StudyResult(stored.study, stored.folder, stored.record, page)
