"""A searched study: its front, its chosen design and what confirmed it."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.charts import front_figure
from dogshape.pipeline.reports.data_sheet import named_design
from dogshape.pipeline.reports.designs import MARGIN, designs_frame, goals_of
from dogshape.pipeline.reports.study_page import gained, headline, publish, summary_tables
from dogshape.pipeline.search.result_schema import require_result
from dogshape.pipeline.simulate.executor import end_workers
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.study import Run, run_study
from dogshape.result import Result
from dogshape.sim.clutch_tables import validate
from dogshape.sim.shift.conclusion import depends_on_clock

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go


PRINTED_KEYS = (
    "engine", "best", "front", "n_simulated_shifts", "n_simulated_designs", "confirmation", "audit",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class StudyResult(Result):
    """A searched study: the designs it tried, the front, the chosen design and its confirmation.

    Parameters
    ----------
    config : the study that was searched.
    folder : holds shifts, trials, surrogate and report (``pipeline.store.folder``).
    record : content of ``result.json``; its keys with units are in ``docs/studies.md``.
    page : the report; None where none was made.
    seconds_cpu : processor time of search, audit and report on this machine in this call, s; None
        for a result that was read.
    """

    config: Setup
    folder: Path
    record: dict[str, Any]
    page: Path | None
    seconds_cpu: float | None = None

    @property
    def best(self) -> dict[str, Any] | None:
        """Chosen design, a row of ``result.json``; None where no design passes every check."""
        best: dict[str, Any] | None = self.record["best"]
        return best

    @property
    def front(self) -> pd.DataFrame:
        """Designs that no other dominates, best first, a row each."""
        return designs_frame(self.record, list(self.config.variables), self.record["front"])

    @property
    def trials(self) -> pd.DataFrame:
        """All designs of the search, a row each; values that were not simulated are missing."""
        return designs_frame(self.record, list(self.config.variables))

    @property
    def confirmation(self) -> dict[str, Any] | None:
        """Re-simulation of prototype and front at new angles; None before the search has ended."""
        found: dict[str, Any] | None = self.record["confirmation"]
        return found

    @property
    def facts(self) -> dict[str, str]:
        """Headline, leading objective of the chosen design, its gain, and the effort."""
        facts = {"result": headline(self.record)}
        for goal, _, chosen, gain in gained(self.record)[:1]:
            facts[goal.label] = goal.words(*chosen)
            facts["gain over the prototype"] = goal.words(*gain)
        return facts | {
            "front": f"{len(self.record['front'])} designs",
            "designs simulated": str(self.record["n_simulated_designs"]),
            "shifts": str(self.record["n_simulated_shifts"]),
        }

    @property
    def parts(self) -> list[str | Table]:
        """Headline, gain, alternatives, facts and front, as the report has them."""
        parts: list[str | Table] = [headline(self.record)]
        for table in summary_tables(self.config, self.record):
            parts += ["", table]
        for reason, count in self.record["failed_shifts"].items():
            again = "; --resume simulates them again" if depends_on_clock(reason) else ""
            parts.append(f"{count} shifts failed and count as not engaged: {reason}{again}")
        page = self.page or "none yet, 'dogshape report' makes it"
        return [*parts, "", f"report: {page}"]

    def to_dict(self) -> dict[str, Any]:
        """Give chosen design, front, confirmation, and how much was simulated."""
        report = None if self.page is None else str(self.page)
        own = {"seconds_cpu": self.seconds_cpu, "report": report}
        return {key: self.record[key] for key in PRINTED_KEYS} | own

    def to_frame(self) -> pd.DataFrame:
        """Give all designs of the search (``trials``)."""
        return self.trials

    def plot(self, objective: str | None = None) -> go.Figure:
        """Draw the front: the leading objective against another one, by default the next.

        With one objective alone, against the smallest margin.
        """
        others = [goal.name for goal in goals_of(self.record)[1:]] or [MARGIN]
        return front_figure(self.record, list(self.config.variables), objective or others[0])

    def data_sheet(self, design: int, path: str | Path, why: str = "") -> Path:
        """Write the data sheet of a design (``dogshape.designs.write_data_sheet``)."""
        from dogshape.designs import write_data_sheet  # noqa: PLC0415

        return write_data_sheet(named_design(f"{self.folder}#{design}"), path, why)

    def report(self, path: str | Path | None = None, *, progress: Progress = SILENT) -> Path:
        """Write the report; give its path.

        It stands in the folder of the study. Elsewhere the page is copied with the pages of
        single shifts that it links.
        """
        if path is not None:
            require_targets({"the report": Path(path)})
        written = publish(StudyFolder(self.folder), progress.say)
        if path is None:
            return written
        shutil.copyfile(written, path)
        linked, beside = self.folder / "shifts", Path(path).parent / "shifts"
        if linked.is_dir() and linked.resolve() != beside.resolve():
            shutil.copytree(linked, beside, dirs_exist_ok=True)
        return Path(path)


def search_study(config: Setup, how: Run) -> StudyResult:
    """Search a study, or go on with it.

    Raises
    ------
    InputError
        For an unknown objective, or a study without variables.
    StorageError
        For a folder or storage that holds another study, or one that is not to be resumed.
    EngineError
        Where the audit of its shifts finds that the compiled engine and Drake do not agree; result
        and report are written.
    """
    begun = sum(os.times()[:4])
    record = run_study(config, how)
    end_workers()
    page = how.folder.report if how.report else None
    return StudyResult(config, how.folder.root, record, page, sum(os.times()[:4]) - begun)


def load_result(folder: str | Path) -> StudyResult:
    """Read the result of a study from its folder.

    Raises
    ------
    StorageError
        For a folder without a study, or with damaged files.
    InputError
        For a ``result.json`` with keys that the schema lacks, or lacking keys of the schema.
    """
    stored = StudyFolder(Path(folder))
    config, record = stored.stored_study(), stored.stored_result()
    require_result(record, str(stored.result))
    page = stored.report if stored.report.is_file() else None
    return StudyResult(config, stored.root, record, page)


def with_effort(config: Setup, trials: int | None, seed: int | None) -> Setup:
    """Copy a study with another number of trials, another seed of the search, or both."""
    given = {"trials": trials, "seed": seed}
    changed = {key: value for key, value in given.items() if value is not None}
    if not changed:
        return config
    content = config.file.model_dump(exclude_none=True)
    content["search"] |= changed
    return build_study(validate(StudyFile, content, f"search of '{config.name}'"))
