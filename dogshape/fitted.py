"""A fitted surrogate, judged on designs that its fit did not use."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup, load_study, require_variables
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.text import in_ms, time_text
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.train.found_surrogates import space_out
from dogshape.pipeline.train.inquiry import Inquiry
from dogshape.pipeline.train.training import ask_more, fill, train
from dogshape.result import Result
from dogshape.sim.errors import InputError, refusal
from dogshape.study import Study
from dogshape.surrogate.store import Stored
from dogshape.surrogate.validation_figures import LEAST_Q2

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Fitted(Result):
    """Surrogate of the expected shift time with its validation.

    Parameters
    ----------
    config : the study whose designs it was fitted to.
    stored : surrogate, validation, and the scores of the forms that were compared.
    path : file that holds it.
    seconds : what simulating, fitting and judging took in this call, on the clock.
    """

    config: Setup
    stored: Stored
    path: Path
    seconds: float

    @property
    def facts(self) -> dict[str, str]:
        """Validation on designs that the fit did not use, and what was fitted."""
        found = self.stored.validation
        return {
            "Q2": f"{found.q2:.3f}",
            "root-mean-square error": time_text(found.rmse_s),
            "within 95 %": f"{found.coverage_95:.0%} of {found.n} designs",
            "designs": self._designs,
            "shifts": ", ".join(f"{n} of {name}" for name, n in self.engines.items()),
        }

    @property
    def _designs(self) -> str:
        model = self.stored.surrogate
        said = str(len(model.data.designs))
        own = "" if model.own is None else f", {len(model.own.x)} at all of the study's points"
        return said + own

    @property
    def engines(self) -> dict[str, int]:
        """Shifts behind the fit by engine, those of references left out."""
        data = self.stored.surrogate.data
        own = {"drake": 0, "planar": 0}
        if data.levels:
            return {name: data.levels[name] for name in own}
        return {**own, self.config.clutch.solver.engine: data.shifts}

    @property
    def parts(self) -> list[str | Table]:
        """Figures of the validation, and the scores of the forms it was chosen from."""
        v, data = self.stored.validation, self.stored.surrogate.data
        how = "references apart" if v.source == "references" else "designs held out in turn"
        rows = [
            (f"{v.n} {how}, expected time, s.e. {time_text(v.noise_s)}", f"{v.q2:.3f}",
             in_ms(v.rmse_s), f"{v.coverage_95:.0%}"),
            ("single operating points", f"{v.q2_points:.3f}", in_ms(v.rmse_points_s),
             f"{v.coverage_points:.0%}"),
        ]  # fmt: skip
        parts: list[str | Table] = [
            f"{len(data.designs)} designs, {len(data)} operating points, {data.shifts} shifts",
            Table(("judged by", "Q2", "rmse, ms", "within 95 %"), rows),
        ]
        for named, q2 in (("expected times", v.q2), ("single operating points", v.q2_points)):
            if q2 < LEAST_Q2:
                parts.append(
                    f"warning: Q2 {q2:.3f} of {named} explains less than half of their variance: "
                    "useless; raise surrogate.designs or surrogate.mix_shifts"
                )
        parts.append(
            f"times are of shifts that engage, bias {v.bias_s * 1e3:+.1f} ms; {v.lost} did not, "
            f"where {v.lost_expected:.1f} were expected"
        )
        if v.rank_best is not None:
            parts.append(f"rank correlation of {v.n_best} best designs {v.rank_best:.2f}")
        scores = [
            (s["form"], f"{s['log_density']:.3f}", f"{s['log_rmse']:.3f}",
             f"{s['coverage_95']:.0%}")
            for s in self.stored.comparison
        ]  # fmt: skip
        heads = ("form, by designs left out", "mean log density", "rmse of ln t", "within 95 %")
        return [*parts, *([Table(heads, scores)] if scores else []), f"written to {self.path}"]

    def to_dict(self) -> dict[str, Any]:
        """Give the validation, the form, the scores of the forms compared, and the file.

        ``levels`` has the correction of rows in two levels; ``mix_designs`` counts the designs that
        have all of the study's operating points.
        """
        own = self.stored.surrogate.own
        return {
            **self.stored.validation.as_dict(),
            "shifts_drake": self.engines["drake"],
            "shifts_planar": self.engines["planar"],
            "seconds": self.seconds,
            "levels": self.stored.surrogate.data.levels,
            "designs": len(self.stored.surrogate.data.designs),
            "mix_designs": 0 if own is None else len(own.x),
            "form": self.stored.surrogate.form,
            "comparison": list(self.stored.comparison),
            "file": str(self.path),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give the data of the fit, a row for each design and operating point."""
        return self.stored.surrogate.data.frame()


def fit(
    where: Study | str | Path,
    settings: Sequence[str] | None = None,
    *,
    out: str | Path | None = None,
    choose: bool = False,
    question: str | None = None,
    shifts: int = 1024,
    levels: int | None = None,
    jobs: int = 0,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> Fitted:
    """Fit the surrogate of a study and judge it on designs that it has not seen.

    Parameters
    ----------
    where : folder of results, which is fitted as it is; or a study, its file or its name, of
        which designs that fill the space are simulated first into ``results/NAME-space``.
    settings : settings of a study that is named, ``["dog.count=18"]``.
    out : file of the surrogate; by default ``surrogate.json`` of the folder.
    choose : whether to compare forms of the model and take the best, minutes.
    question : ``best``, ``front`` or ``design``, about which more is simulated first.
    shifts : how many more shifts a question takes.
    levels : of a study, 2 for rows of the compiled engine that pairs with Drake correct
        (``pipeline.train.two_level_rows``), 1 for rows of the study's engine; None for what its
        folder was begun with, else for 2 where the engine is Drake and no question is asked.

    Raises
    ------
    InputError
        For settings of a study that was run, an unknown question, too few designs or pairs,
        levels that the study cannot have.
    """
    begun = time.perf_counter()
    target = None if out is None else Path(out)
    require_targets({"--out": target})
    asked = None if question is None else Inquiry(question, shifts)
    if settings and isinstance(where, Study):
        raise InputError("a Study has its settings already; give them to Study, or name the study")
    folder = None if isinstance(where, Study) else StudyFolder(Path(where))
    if folder is None or not folder.manifest.is_file():
        config = where.config if isinstance(where, Study) else load_study(where, settings)
        folder = StudyFolder(space_out(config))
        require_variables(config)
        count = _levels(config, folder, levels, asked)
        fill(config, folder, jobs, cluster, progress, levels=count)
    elif settings:
        raise InputError(
            "--set cannot change a study that was run; leave it out, or name the study"
        )
    elif levels is not None:
        raise InputError(
            "--levels cannot change a study that was run; leave it out, or name the study"
        )
    if asked is not None:
        _require_one_level(folder)
        ask_more(folder, asked, jobs, cluster, progress)
    stored = train(folder, target, choose=choose, say=progress.say)
    seconds = time.perf_counter() - begun
    return Fitted(folder.stored_study(), stored, target or folder.surrogate, seconds)


def _levels(config: Setup, folder: StudyFolder, levels: int | None, asked: Inquiry | None) -> int:
    """Return the number of levels; InputError for one that the study or its folder cannot have."""
    drake = config.clutch.solver.engine == "drake"
    before = 2 if folder.compiled.exists() else 1 if folder.shifts.exists() else None
    if levels is None:
        return before or (2 if drake and asked is None else 1)
    if levels == 2 and asked is not None:
        raise InputError("--question adds rows of one level; leave it out, or give --levels 1")
    if levels not in (1, 2):
        raise InputError(refusal("--levels", levels, "", "it must be 1 or 2", "give one of them"))
    if levels == 2 and not drake:
        raise InputError(
            "--levels is 2, but a study of the compiled engine has one level; leave out --levels, "
            "or give --engine drake"
        )
    if before not in (None, levels):
        raise InputError(
            f"--levels is {levels}, but {folder.root} was begun with {before}; leave out --levels "
            "to go on, or remove the folder"
        )
    return levels


def _require_one_level(folder: StudyFolder) -> None:
    """Raise InputError for a folder whose rows no question can add to."""
    if folder.compiled.exists():
        raise InputError(
            f"the rows of {folder.root} are of two levels, to which --question adds none; leave it "
            "out, or remove the folder and fit the study with --levels 1"
        )
