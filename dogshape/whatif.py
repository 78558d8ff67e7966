"""The live page of a study: fields and sliders, predicted times and all closed-form checks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.check import Quick, misses, simulate_quickly, unmade
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.text import interval_text, time_text
from dogshape.pipeline.reports.whatif_page import designs_of, require_fixed_points, write_whatif
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.store.folder import StudyFolder, default_out, require_targets
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.result import Result
from dogshape.surrogate.learning import condition
from dogshape.surrogate.query import Answer, ask

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

    @property
    def parts(self) -> list[str | Table]:
        """Warnings, then the page."""
        return [*(f"warning: {one}" for one in self.warnings), f"page: {self.page}"]

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
    """Write the live page of a study, whose own design the compiled engine simulates first.

    Predictions are conditioned on its time, and its landing is judged.

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
    folder = StudyFolder(default_out(config))
    page = out or folder.root / "whatif.html"
    require_targets({"--out": page}, folders=True)
    result = folder.stored_result() if folder.result.is_file() else None
    answer = ask(stored.surrogate, config.prototype, study_mix(config), config.physics)
    warnings, own = list(answer.warnings), {}
    if not unmade(config):
        quick = simulate_quickly(config)
        own = _simulated(config, quick)
        warnings += _missed(answer, quick)
        if quick.expected is not None and answer.expected is not None:
            known = condition(stored.surrogate, quick.rows)
            stored = replace(stored, surrogate=known)
    offered = designs_of(config, result, own)
    names = source, command or config.name
    said = warnings[len(answer.warnings) :]
    write_whatif(config, stored, names, (offered, said), page)
    return WhatIf(config, source, page, tuple(offered), tuple(warnings))


def _simulated(config: Setup, quick: Quick) -> dict[str, Any]:
    """Give time and margins of the simulated design with the keys of a row of a front."""
    margins = {one.name: one.margin for one in design_of(config, {}, quick.measured).checks}
    if quick.expected is None:
        return {"margins": margins}
    time, error = quick.expected.time, quick.expected.error
    return {"expected_shift_time_s": time, "standard_error_s": error, "margins": margins}


def _missed(answer: Answer, quick: Quick) -> list[str]:
    """Warn of a surrogate that misses the study's own design."""
    seen, guess = quick.expected, answer.expected
    if seen is None or guess is None or not misses(guess, seen):
        return []
    return [
        f"the surrogate predicted {interval_text(guess.time, guess.low, guess.high)} for the own "
        f"design, whose simulated time is {time_text(seen.time)}; others may be off as much"
    ]
