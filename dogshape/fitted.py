"""A fitted surrogate, judged on designs that its fit did not use."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, require_variables
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import Figure, Frame, Table, percent
from dogshape.pipeline.reports.text import ENGINES, in_ms, time_text
from dogshape.pipeline.store.folder import StudyFolder, default_out, require_targets
from dogshape.pipeline.train.training import fill, train
from dogshape.result import Result
from dogshape.running import receiver
from dogshape.sim.errors import InputError
from dogshape.sim.interface import argument
from dogshape.study import Study
from dogshape.surrogate.store import MIN_Q2, Stored


@dataclass(frozen=True, repr=False)
class Fitted(Result):
    """Surrogate of the expected shift time with its validation, stored in ``path``.

    ``seconds`` is the wall time of simulation, fit and validation in this call.
    """

    config: Setup
    stored: Stored
    path: Path
    seconds: float

    @property
    def engine(self) -> str:
        """Engine that simulated the shifts behind the fit, ``drake`` or ``planar``."""
        return str(self.stored.surrogate.data.physics.get("engine", "drake"))

    def to_parts(self) -> list[str | Table]:
        """Tabulate the validation, with lines on the data, the bias and the file."""
        v = self.stored.validation
        data = self.stored.surrogate.data
        method = "references apart" if v.source == "references" else "designs held out in turn"
        total = f"{v.n} {method}, expected time, s.e. {time_text(v.noise_s)}"
        points = "single operating points"
        rows = [
            (total, f"{v.q2:.3f}", in_ms(v.rmse_s), percent(v.coverage_95)),
            (points, f"{v.q2_points:.3f}", in_ms(v.rmse_points_s), percent(v.coverage_points)),
        ]
        parts: list[str | Table] = [
            f"{len(data)} designs at {len(data.mix.points)} operating points, {data.shifts} shifts",
            Table(("judged by", "Q2", "rmse, ms", "within 95 %"), rows),
        ]
        for quantity, q2 in (("expected times", v.q2), (points, v.q2_points)):
            if q2 < MIN_Q2:
                parts.append(
                    f"warning: Q2 {q2:.3f} of {quantity} explains less than half of their "
                    "variance: useless; raise surrogate.mix_shifts"
                )
        parts.append(
            f"times are of shifts that engage, bias {v.bias_s * 1e3:+.1f} ms; {v.lost} did not, "
            f"where {v.lost_expected:.1f} were expected"
        )
        if v.rank_best is not None:
            parts.append(f"rank correlation of {v.n_best} best designs {v.rank_best:.2f}")
        return [*parts, f"written to {self.path}"]

    def to_dict(self) -> dict[str, Any]:
        """Convert validation, numbers of shifts and file to values of JSON."""
        data = self.stored.surrogate.data
        shifts = dict.fromkeys(ENGINES, 0) | {self.engine: data.shifts}
        return {
            **self.stored.validation.model_dump(),
            "engine": self.engine,
            **{f"shifts_{name}": shifts[name] for name in ENGINES},
            "seconds": self.seconds,
            "designs": len(data),
            "file": str(self.path),
        }

    def plot(self) -> Figure:
        """Draw the main effect of each variable on the expected shift time, ms."""
        from dogshape.pipeline.reports.charts import effects_figure  # noqa: PLC0415
        from dogshape.pipeline.reports.surrogate_findings import effects_of  # noqa: PLC0415

        return effects_figure(effects_of(self.config, self.stored.surrogate).variables)

    def to_frame(self) -> Frame:
        """Tabulate the data of the fit, a row for each design and operating point."""
        return self.stored.surrogate.data.frame()


def fit(
    where: Study | str | Path,
    settings: Sequence[str] | None = None,
    *,
    out: str | Path | None = None,
    jobs: int = 0,
    cluster: str | None = None,
    progress: Progress | bool | None = None,
    engine: str | None = None,
) -> Fitted:
    """Fit the surrogate of a study and validate it on designs outside the fit.

    InputError for settings of a study that was run, or too few designs.
    Example: ``ds.fit("mq200", ["dog.count=18"], progress=True)``

    Parameters
    ----------
    where : folder of results, which is fitted as it is; or a study, its file or its name, for
        which space-filling designs are simulated first into ``results/NAME-space``.
    settings : settings of a study given by file or name, ``["dog.count=18"]``.
    out : file of the surrogate; by default ``surrogate.json`` of the folder.
    jobs, cluster, progress, engine : as in ``Study.expect``.
    """
    start = time.perf_counter()
    target = None if out is None else Path(out)
    listener = receiver(progress)
    require_targets({argument("out"): target})
    if settings and isinstance(where, Study):
        raise InputError("a Study has its settings already; give them to Study, or name the study")
    folder = None if isinstance(where, Study) else StudyFolder(Path(where))
    if folder is None or not folder.manifest.is_file():
        study = where if isinstance(where, Study) else Study(where, settings)
        config = (
            study.config if engine is None else study.replace_keys({"solver.engine": engine}).config
        )
        folder = StudyFolder(default_out(config, "-space"))
        require_variables(config)
        fill(config, folder, jobs, cluster, listener)
    elif settings or engine is not None:
        remedy = "leave it out, or name the study"
        raise InputError(f"{argument('settings')} cannot change a study that was run; {remedy}")
    stored = train(folder, target, say=listener.say)
    seconds = time.perf_counter() - start
    return Fitted(folder.stored_study(), stored, target or folder.surrogate, seconds)
