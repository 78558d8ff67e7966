"""The objectives of a study as its report shows them: times in ms, margins in percent."""

from __future__ import annotations

from dataclasses import dataclass

from dogshape.pipeline.config.schema import QUANTILE
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import minus, with_error
from dogshape.pipeline.simulate.design import OBJECTIVES, SIMULATED, Objective

QUANTILE_TIME, MARGIN = "shift_time_quantile_s", "smallest_margin"
PEAK_FORCE = "peak_impact_force_N"
#: Units that are shown instead of the stored ones.
SHOWN = {
    PEAK_FORCE: "kN",
    "peak_axial_force_N": "kN",
    MARGIN: "%",
    "smallest_margin_worst": "%",
    "first_try_share": "%",
    "feasible_probability": "%",
}
FACTORS = {"ms": 1e3, "%": 100.0, "kN": 1e-3}  #: from the stored value to the shown one
#: Definition of each simulated objective, after its label; ``{over}`` are all shifts of the mix.
MEANINGS = {
    SIMULATED: "the mean over {over}, tries that fail included",
    QUANTILE_TIME: "the time within which {share} of all shifts engage, over {over}, "
    "tries that fail included",
    "worst_shift_time_s": "the expected shift time at the slowest operating point",
    "slower_than_reference_s": "the most that the expected shift time of any operating point "
    "exceeds that of the reference design",
    "first_try_share": "the share of {over} that engages in time at the first try",
    PEAK_FORCE: "the mean over {over} of each shift's largest contact force of the whole ring",
    "peak_axial_force_N": "the mean over {over} of each shift's largest axial force of the contact",
    "strike_torque_Nm": "the mean over {over} of each shift's largest torque of the contact",
    "impact_impulse_Ns": "the mean over {over} of each shift's hardest impulse",
    "impact_energy_J": "the mean over {over} of the energy that the contact took",
    MARGIN: "the least margin of all checks to their limits, that of the hardest landing "
    "over {over} among them",
}


@dataclass(frozen=True)
class Goal:
    """An objective with its label, the unit that is shown and the factor that leads to it.

    ``share`` is the level of a quantile; ``leading`` marks the objective that decides which
    design is best.
    """

    objective: Objective
    share: float
    leading: bool

    @property
    def name(self) -> str:
        """Key of the objective."""
        return self.objective.name

    @property
    def label(self) -> str:
        """Words for the objective; a quantile has its level."""
        level = f"{100 * self.share:.4g} % " if self.name == QUANTILE_TIME else ""
        return level + self.objective.label

    @property
    def unit(self) -> str:
        """Unit that is shown."""
        own = SHOWN.get(self.name, self.objective.unit)
        return "ms" if own == "s" else own

    @property
    def factor(self) -> float:
        """Shown value over the stored one."""
        return FACTORS.get(self.unit, 1.0)

    @property
    def title(self) -> str:
        """Label and unit, for the head of a column."""
        return f"{self.label}, {self.unit}" if self.unit else self.label

    @property
    def axis(self) -> str:
        """Label and unit for an axis, with the direction where it is not the usual one."""
        return self.title + (" (more is better)" if self.objective.maximise else "")

    @property
    def meaning(self) -> str:
        """Definition of a simulated objective, with ``{over}`` left to fill."""
        return MEANINGS[self.name].replace("{share}", f"{100 * self.share:.4g} %")

    def shown(self, row: Row) -> float:
        """Return the value of a row in the unit that is shown."""
        return self.factor * float(row[self.name])

    def error(self, row: Row) -> float:
        """Return the standard error of a row in the unit that is shown; zero if exact."""
        return self.factor * float(row["standard_errors"].get(self.name) or 0.0)

    def interval(self, row: Row) -> tuple[float, float]:
        """Return the 95 % interval of a simulated design, in the unit that is shown."""
        if self.leading and row.get("low") is not None and row.get("high") is not None:
            return self.factor * float(row["low"]), self.factor * float(row["high"])
        value, half = self.shown(row), 1.96 * self.error(row)
        return value - half, value + half

    def number(self, shown: float) -> str:
        """Print a shown value without its unit, with a real minus."""
        if self.unit in ("ms", "kN"):
            words = f"{shown:.1f}"
        elif self.unit == "%":
            words = f"{shown:.1f}" if abs(shown) < 5.0 else f"{shown:.0f}"
        else:
            words = f"{shown:.4g}" if abs(shown) < 1e3 else f"{shown:.0f}"
        return minus(words)

    def pair(self, shown: float, error: float) -> str:
        """Print a shown value with its standard error, if it has one, without the unit."""
        if not error:
            return self.number(shown)
        if self.unit in ("ms", "kN"):
            return with_error(shown, error)
        return f"{self.number(shown)} ± {self.number(error)}"

    def words(self, shown: float, error: float = 0.0) -> str:
        """Print a shown value with error and unit."""
        return f"{self.pair(shown, error)} {self.unit}".strip()

    def of(self, row: Row) -> str:
        """Print the value of a row with its error, without the unit."""
        return self.pair(self.shown(row), self.error(row))

    def estimate(self, confirmed: Row) -> tuple[float, float]:
        """Return a simulated objective at the new angles, and its error, as shown."""
        found = confirmed["estimates"][self.name]
        return self.factor * found["value"], self.factor * (found["standard_error"] or 0.0)


@dataclass(frozen=True)
class Goals:
    """All objectives of a study in its order."""

    every: tuple[Goal, ...]

    @property
    def leading(self) -> Goal:
        """The objective that decides which design is best."""
        return next(goal for goal in self.every if goal.leading)

    @property
    def others(self) -> list[Goal]:
        """All but the leading one."""
        return [goal for goal in self.every if not goal.leading]

    @property
    def told(self) -> list[Goal]:
        """The leading one, the others, and the expected shift time where it is none of them."""
        found = [self.leading, *self.others]
        if all(goal.name != SIMULATED for goal in found):
            found.append(Goal(OBJECTIVES[SIMULATED], self.leading.share, False))
        return found

    def named(self, name: str) -> Goal:
        """Find an objective by its name."""
        return next(goal for goal in self.told if goal.name == name)


def goals_of(result: Row) -> Goals:
    """List the objectives of a study's result."""
    share = result.get("quantile", QUANTILE)
    names = result["objectives"]
    return Goals(tuple(Goal(OBJECTIVES[n], share, n == result["leading"]) for n in names))
