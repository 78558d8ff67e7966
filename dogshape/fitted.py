"""A fitted surrogate, judged on designs that its fit did not use."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study, require_variables
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import Frame, Result, Table, percent
from dogshape.pipeline.reports.text import ENGINES, in_ms, time_text
from dogshape.pipeline.store.folder import StudyFolder, default_out, require_targets
from dogshape.pipeline.train.training import fill, train
from dogshape.running import receiver
from dogshape.sim.errors import InputError
from dogshape.study import Study
from dogshape.surrogate.store import MIN_Q2, Stored


@dataclass(frozen=True, repr=False)
class Fitted(Result):
    """Surrogate of the expected shift time with its validation, stored in ``path``.

    ``seconds`` is the time on the clock that simulating, fitting and judging took in this call.
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
        """Give the figures of the validation."""
        v, data = self.stored.validation, self.stored.surrogate.data
        how = "references apart" if v.source == "references" else "designs held out in turn"
        rows = [
            (f"{v.n} {how}, expected time, s.e. {time_text(v.noise_s)}", f"{v.q2:.3f}",
             in_ms(v.rmse_s), percent(v.coverage_95)),
            ("single operating points", f"{v.q2_points:.3f}", in_ms(v.rmse_points_s),
             percent(v.coverage_points)),
        ]  # fmt: skip
        judged = {"expected times": v.q2, "single operating points": v.q2_points}
        rank = f"rank correlation of {v.n_best} best designs {v.rank_best or 0.0:.2f}"
        return [
            f"{len(data)} designs at {len(data.mix.points)} operating points, {data.shifts} shifts",
            Table(("judged by", "Q2", "rmse, ms", "within 95 %"), rows),
            *(
                f"warning: Q2 {q2:.3f} of {named} explains less than half of their variance: "
                "useless; raise surrogate.mix_shifts"
                for named, q2 in judged.items() if q2 < MIN_Q2
            ),
            f"times are of shifts that engage, bias {v.bias_s * 1e3:+.1f} ms; {v.lost} did not, "
            f"where {v.lost_expected:.1f} were expected",
            *([] if v.rank_best is None else [rank]),
            f"written to {self.path}",
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Give the validation, what was fitted, and the file."""
        data = self.stored.surrogate.data
        return {
            **self.stored.validation.model_dump(),
            "engine": self.engine,
            **{f"shifts_{name}": data.shifts * (name == self.engine) for name in ENGINES},
            "seconds": self.seconds,
            "designs": len(data),
            "file": str(self.path),
        }

    def to_frame(self) -> Frame:
        """Give the data of the fit, a row for each design and operating point."""
        return self.stored.surrogate.data.frame()


def fit(
    where: Study | str | Path,
    settings: Sequence[str] | None = None,
    *,
    out: str | Path | None = None,
    jobs: int = 0,
    cluster: str | None = None,
    progress: Progress | bool = False,
) -> Fitted:
    """Fit the surrogate of a study and judge it on designs that it has not seen.

    InputError for settings of a study that was run, or too few designs.
    Example: ``ds.fit("mq200", ["dog.count=18"], progress=True)``

    Parameters
    ----------
    where : folder of results, which is fitted as it is; or a study, its file or its name, of
        which designs that fill the space are simulated first into ``results/NAME-space``.
    settings : settings of a study that is named, ``["dog.count=18"]``.
    out : file of the surrogate; by default ``surrogate.json`` of the folder.
    jobs, cluster, progress : as in ``Study.expect``.
    """
    begun = time.perf_counter()
    target, told = None if out is None else Path(out), receiver(progress)
    require_targets({"--out": target})
    if settings and isinstance(where, Study):
        raise InputError("a Study has its settings already; give them to Study, or name the study")
    folder = None if isinstance(where, Study) else StudyFolder(Path(where))
    if folder is None or not folder.manifest.is_file():
        config = where.config if isinstance(where, Study) else load_study(where, settings)
        folder = StudyFolder(default_out(config, "-space"))
        require_variables(config)
        fill(config, folder, jobs, cluster, told)
    elif settings:
        remedy = "leave it out, or name the study"
        raise InputError(f"--set cannot change a study that was run; {remedy}")
    stored = train(folder, target, say=told.say)
    seconds = time.perf_counter() - begun
    return Fitted(folder.stored_study(), stored, target or folder.surrogate, seconds)
