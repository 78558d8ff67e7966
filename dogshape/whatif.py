"""The live page of a study: fields and sliders, predicted times and all closed-form checks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.whatif.page import require_fixed_points, write_whatif
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.store.output_files import require_targets
from dogshape.pipeline.train.found_surrogates import stored_surrogate
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.result import Result
from dogshape.surrogate.query import ask

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class WhatIf(Result):
    """A page that answers "what if" at once, offline.

    Parameters
    ----------
    config : the study that was asked.
    surrogate : file of the surrogate that predicts the times of the page.
    page : the page.
    offered : designs that one may begin with, in edge units, with their simulated times in s.
    warnings : what speaks against trusting the time of the study's own design.
    """

    config: Setup
    surrogate: Path
    page: Path
    offered: tuple[dict[str, Any], ...]
    warnings: tuple[str, ...] = ()

    @property
    def facts(self) -> dict[str, str]:
        """The page, and how many designs it offers."""
        return {"page": str(self.page), "designs to begin with": str(len(self.offered))}

    def to_dict(self) -> dict[str, Any]:
        """Give the files of page and surrogate, and the designs to begin with."""
        return {
            "file": str(self.page),
            "surrogate": str(self.surrogate),
            "operating_points": len(self.config.points),
            "designs": list(self.offered),
            "warnings": list(self.warnings),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each design that one may begin with."""
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        return pd.DataFrame(self.offered).set_index("name")


def write_what_if(
    config: Setup,
    out: Path | None = None,
    surrogate: Path | None = None,
    command: str = "",
) -> WhatIf:
    """Write the live page of a study.

    Parameters
    ----------
    out : the page; None for ``results/NAME/whatif.html``.
    surrogate : file of the surrogate; None for that of the study's results, or the package's.
    command : study and ``--set`` as the command line has them, for the commands that the page
        shows; the study's name where it is empty.

    Raises
    ------
    InputError, DataError
        Where there is no surrogate, or one of other physics; for a study that searches its
        operation.
    """
    require_fixed_points(config)
    stored, source = stored_surrogate(config, surrogate)
    answer = ask(stored.surrogate, config.prototype, study_mix(config), config.physics)
    folder = StudyFolder(default_out(config))
    page = out or folder.root / "whatif.html"
    require_targets({"--out": page}, folders=True)
    result = folder.stored_result() if folder.result.is_file() else None
    offered = write_whatif(config, stored, (source, command or config.name), result, page)
    return WhatIf(config, source, page, tuple(offered), answer.warnings)
