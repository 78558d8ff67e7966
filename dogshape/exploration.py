"""Exploration of a surrogate: effects, sensitivity indices and slices; nothing is simulated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.reports.surrogate.figures import effects_figure
from dogshape.pipeline.reports.surrogate.page import write_page
from dogshape.pipeline.reports.surrogate.record import explored
from dogshape.pipeline.reports.surrogate.slices import bases_of, rivals_of
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.train.found_surrogates import stored_surrogate
from dogshape.result import Result, ms

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go


@dataclass(frozen=True, repr=False)
class Exploration(Result):
    """Predictions of the surrogate: what each variable does, what matters, slices.

    Parameters
    ----------
    config : the study that was asked.
    surrogate : file of the surrogate.
    found : effects, Sobol indices, slices and validation, times in s and all else in edge units.
    page : the page that was written; None where none was.
    """

    config: Setup
    surrogate: Path
    found: dict[str, Any]
    page: Path | None = None

    @property
    def facts(self) -> dict[str, str]:
        """Time of the study's own design, mean over the box about it, and what moves it most."""
        near, frame = self.found["indices"][0], self.found["effects"]["variables"]
        own = self.found["slices"][0]["operating"][0]
        strongest = max(frame, key=lambda one: one["span_s"])
        return {
            "study's own design": own["reason"] or ms(own["expected_shift_time_s"]),
            "mean over the box about it": ms(near["mean_s"]),
            "standard deviation in the box": ms(near["sd_s"]),
            "strongest variable": f"{strongest['variable']} ({ms(strongest['span_s'])})",
        }

    def to_dict(self) -> dict[str, Any]:
        """Give effects, indices, slices, and the files of page and surrogate."""
        page = None if self.page is None else str(self.page)
        return {"file": page, "surrogate": str(self.surrogate), **self.found}

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each variable: its fastest value, its span, s, and its Sobol indices."""
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        effects = {one["variable"]: one for one in self.found["effects"]["variables"]}
        keys = ("fastest", "span_s", "span_by_chance_s", "distinguishable")
        rows = [
            {**{key: effects.get(one["variable"], {}).get(key) for key in keys}, **one}
            for one in self.found["indices"][0]["inputs"]
        ]
        return pd.DataFrame(rows).set_index("variable")

    def plot(self) -> go.Figure:
        """Draw the effect of each variable on the expected shift time."""
        return effects_figure(self.found["effects"])

    def report(self, path: str | Path) -> Path:
        """Write the page, which opens offline; give its path."""
        write_page(replace(self, page=Path(path)).to_dict(), Path(path))
        return Path(path)


def explore_surrogate(
    config: Setup,
    surrogate: Path | None = None,
    out: Path | None = None,
    progress: Progress = SILENT,
) -> Exploration:
    """Explore the surrogate of a study about its own design and the front in ``results/NAME``.

    Parameters
    ----------
    surrogate : file of the surrogate; None for that of the study's results, or the package's.
    out : the page; None writes none.

    Raises
    ------
    InputError, DataError
        Where there is no surrogate, or one of other physics.
    """
    stored, source = stored_surrogate(config, surrogate)
    folder = StudyFolder(default_out(config))
    require_targets({"--out": out}, folders=True)
    result = folder.stored_result() if folder.result.is_file() else None
    bases = bases_of(config, result)
    offered = {"front_designs": len(rivals_of(config, result)), "front_shown": len(bases) - 1}
    found = Exploration(
        config, source, {**offered, **explored(config, stored, bases, progress.say)}
    )
    return found if out is None else replace(found, page=found.report(out))
