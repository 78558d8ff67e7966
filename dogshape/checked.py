"""Closed-form checks of one design, common to a check and a strength."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.tolerance_effects import checks_within
from dogshape.pipeline.simulate.design import Design, Within, weakest_within
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.result import Result
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.locking import blocking_force

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go


@dataclass(frozen=True, repr=False)
class Checked(Result):
    """One design with its checks.

    Parameters
    ----------
    config : the study that was asked.
    design : its dog with every check.
    within : margins left within the tolerances, by check and kind; minus infinity for no dog.
    """

    config: Setup
    design: Design
    within: Within

    @property
    def feasible(self) -> bool:
        """Whether every check passes."""
        return self.design.feasible

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the checks that fail."""
        return tuple(self.design.failed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the design: a root outside its formula's fit, units in doubt."""
        return tuple(notes_of(self.config))

    @property
    def blocking_force_N(self) -> float:
        """Force that the blocking mechanism has to hold, N."""
        return blocking_force(self.config.clutch.dog, self.config.limits.load)

    @property
    def verdict(self) -> dict[str, str]:
        """Facts of the checks: feasible or not, and the smallest margins with their checks."""
        weakest = smallest_margin(self.design.checks)
        open_ones = ", before its landing is simulated" if self.design.not_checked else ""
        told = "yes" if self.feasible else f"no ({', '.join(self.failed)})"
        name, worst = weakest_within(self.config, self.design)
        return {
            "feasible": told + open_ones,
            "smallest margin": f"{weakest.margin:.1%}, {weakest.name}",
            "at worst-case tolerances": "no dog" if math.isinf(worst) else f"{worst:.1%}, {name}",
        }

    def landing_of(self, shifts: int, engine: str) -> list[str]:
        """Explain which shifts the checks of the landing are from; nothing without them."""
        if self.design.not_checked or not shifts:
            return []
        share = self.config.limits.load.landing_share
        taken = "the hardest" if share is None else f"what {share:.3g} of the shifts exceed"
        name = "the compiled engine" if engine == "planar" else "Drake"
        angles = shifts // len(self.config.points)
        return [
            f"landing: {taken} of {shifts} shifts by {name}, {angles} angles at each operating "
            "point; other angles or another number of them ('check' and 'strength' have their own) "
            "give another sample of it"
        ]

    @property
    def record(self) -> dict[str, Any]:
        """Give the checks as JSON takes them."""
        return {
            "feasible": self.design.feasible,
            "not_checked": self.design.not_checked,
            "checks": checks_within(self.design, self.within),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each check: value and limit in ``unit``, margins as shares."""
        import pandas as pd  # noqa: PLC0415  # half a second that a quick answer does not need

        return pd.DataFrame(self.record["checks"])

    def plot(self) -> go.Figure:
        """Draw the margin of each check, and what is left of it in the worst case."""
        from dogshape.pipeline.reports.kit.result_charts import margins  # noqa: PLC0415  # loads plotly

        return margins(self.design.checks, self.within)
