"""Write all statistical constants of the diagnosis into docs/diagnosis_model.md.

    python -m benchmarks.constants

Settings (``diagnosis.settings``) bring unit, meaning, source and status along. Of what stands in
modules the meaning is the comment at its definition; unit, status and source are here. A number
that is in neither list is refused, and so is an entry without its number.
"""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.stand_file import USUAL_MARGIN
from dogshape.diagnosis.settings import USUAL, told

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "diagnosis_model.md"
BEGIN, END = (
    "<!-- constants: written by benchmarks/constants.py -->\n",
    "<!-- end of constants -->\n",
)
FEW = 6  #: numbers of a list that are all shown
ONE_SET = "one set of an independent engine"

#: Constants that say something of the world, by module: name, unit, status, source.
CHOSEN = {
    "bench.flight_marks": """
        WAYS | of the axial gap | judged | early, middle and late of the flight
        FORCES | of the final force | judged | early, middle and late of the rise
        CLEAR | scatters | judged |
        APART | scatters | judged | one odd trace spoils no mark
        FLOOR | s | judged | rigid flight
        SHARE | of the time | judged | rigid flight
        GAIN | of a reading | judged |
        FORCE_FLOOR | s | judged | rigid flight""",
    "prediction.combination": """
        BLEND | w | judged |
        BEYOND | w | judged | wider than what simulated pairs have
        UNSEEN | w | judged |
        OWN | w | judged |
        KEPT | of the scatter | judged |
        FEW | of the smaller change | judged |""",
    "prediction.level_curves": """
        SHORT | of the prior | judged |
        LENGTHS | of the prior | judged | all are tried
        STEPS | of the variance | judged | all are tried
        SIZES | of ln time | judged | all are summed over
        USUAL | of ln time | judged |""",
    "prediction.level_fit": "SUDDEN | of the prior | judged | shares engaged may fall at once",
    "prediction.together": """
        STATED | of ln time | judged | levels have about so much from their angles
        CLOSE | of the prior | judged |""",
    "prediction.joint_levels": """
        FACTORS | of a length | judged | all are tried
        SCALES | of the error | judged | all are tried
        USUAL | of ln of the scale | judged |
        LONGEST | of the prior | judged |""",
    "prediction.angle_means": "OWN | of the variance | judged |",
    "prediction.flight_table": """
        HALF | of what is missed | judged | every other node left out
        TOUCHED | s | judged | nothing is emulated there
        LAW | of the change | judged | an effect's law is only a law""",
    "prediction.flight": f"CREEP | of the change | measured | {ONE_SET}",
    "prediction.outliers": """
        FAR | distances of quantiles | judged | 4.2 normal deviations
        MIDDLE | share | judged |
        MOST | share | judged | leaves a fifth for the tail
        LEAST | s | judged |
        ENOUGH | shifts | judged |
        PRIOR | shifts | judged |""",
    "likelihood.observations": "LEAST | s | judged | resolution of a shift time",
    "likelihood.drift": """
        INSIDE | probability | judged | usual level
        ALIKE | degrees of freedom | judged | few repeats scatter by chance""",
    "likelihood.discrepancy": "LEAST_SPREAD | of ln force | judged | closer forces tell no line",
    "inference.posterior": "CONTRADICTED | deviations | judged | one in fifty at that distance",
    "inference.parameter_intervals": "INSIDE | probability | judged | usual level",
    "inference.static_readings": """
        LEAST | readings | judged | two lie on any line
        SPREAD | of the value | judged |""",
    "inference.next_test": """
        EXACT | of the prior | judged |
        HOUR | probability an hour | judged |
        WORTH | nat | judged |
        MISLED | probability | judged |
        ABSENT | probability | judged | nobody knows what it is
        SETUP | h | judged | a stand of this kind
        SHIFT | h | judged | a stand of this kind
        TRACING | h | judged | a stand of this kind
        TRACED | shifts | judged |
        DIRECT | h | judged | a stand of this kind
        HOURS | h | judged | `[[tests]]` of bench.toml has those of a stand
        GENERIC | h | judged | `[[tests]]` of bench.toml has those of a stand
        MORE | shifts | judged |""",
    "inference.outcome": "IMITATED | probability | measured | one set of withheld effects",
    "inference.flight_outcome": "STEP | s | judged | 1 kHz",
    "inference.shift_plan": """
        LOT | shifts | judged | a spread wants some
        VISITS | visits | judged | drift shows in three means""",
}
#: Constants of a numerical method, by module, with their units: more would change nothing but cost.
NUMERICAL = {
    "bench.input_errors": "STEP of ln force, ALIKE of a value, APART of a logarithm",
    "bench.flight_marks": "AROUND of a mark, SAMPLES samples",
    "prediction.bank": "ANGLES angles, SHIFT s, ACCURACY 1",
    "prediction.bank_store": "TICK s",
    "prediction.sense_bank": "LEVELS levels, PLANE levels, ANGLES angles, DENSE angles",
    "prediction.combination": "LEAST_SUM of a ratio, LEAST of ln time",
    "prediction.level_curves": "FLOOR of a mean",
    "prediction.recent": "KEPT results",
    "prediction.hypotheses": "TRIED values",
    "prediction.emulator": "PROBES values",
    "prediction.level_fit": "SHARES shares, LEAST of a mean, NONE of a mean",
    "prediction.touch_phases": "NODES nodes, MANY nodes, HALVINGS steps, ROOT 1, "
    "SHORT of the flight",
    "inference.joint_refinement": "DRAWS draws, GRID steps",
    "prediction.levels": "CANDIDATES power of two, TICKS of the prior, TOGETHER of the prior",
    "prediction.flight_table": "NODES nodes, MANY nodes, ALONE nodes, TRIED of the prior",
    "prediction.flight": "TIGHT m/s, CLOSE m, FIRST s, STEP s, ROOM steps, ASIDE m",
    "likelihood.time_parts": "LEAST_FREEDOM degrees of freedom, HIDDEN shifts, "
    "RARE probability, CROWD shifts",
    "likelihood.discrepancy": "JITTER of the variance, NODES of the scale",
    "likelihood.likely_offsets": "LEFT of the variance",
    "likelihood.drift": "ROUNDS rounds",
    "likelihood.scores": "IMPOSSIBLE nat",
    "likelihood.flight_likelihood": "SCALES values",
    "inference.evidence": "FIRST boxes, TOLERANCE of the evidence, ROUNDS rounds, POINTS values, "
    "FIRST_DRAWS values, DRAWS values, SAMPLINGS rounds, ENOUGH draws, HOPELESS nat, SOME draws, "
    "BEHIND nat, DOF degrees of freedom, PRIOR_SHARE of the draws, OUTSIDE values",
    "inference.range_ends": "TRIED of a widening",
    "inference.unknown": "SCALES values, OFFSETS standard errors",
    "inference.equivalence": "DRAWN values",
    "inference.series_drift": "DRAWN values",
    "inference.influence": "DEEP nat, NEAR nat, UNEVEN 1, MOVED of the weight, "
    "WEIGHTY probability, DOUBTFUL of the limit, RISEN probability, WITHIN probability, "
    "LIKELY probability, REPLICATES 1",
    "inference.further_shifts": "DRAWN values",
    "inference.predicted_means": "DRAWN values, SHARES of the distribution",
    "inference.joint_posterior": "DRAWN values, CELLS points, ROOM standard deviations, "
    "WIDEST probability",
    "inference.pareto_tail": "LEAST weights, PRIOR weights, CENTRE 1",
    "inference.classes": "DRAWN values",
    "inference.posterior": "DRAWN values, NEGLIGIBLE probability",
    "inference.predictive_check": "DRAWN values, REPLICATES values, FEW shifts, MOST probability",
    "inference.refits": "VALUES values, FLAT power, MOST replicates, ENOUGH replicates",
    "inference.static_readings": "SURE standard errors, ANY values",
    "inference.next_test": "LEAST probability, FLOWN hypotheses",
    "inference.outcome": "DRAWN outcomes",
    "inference.flight_outcome": "DRAWN values, TABULATED effects",
    "inference.shift_plan": "LOTS lots, TRUTHS values, RIVALS values",
}
#: Numbers that are no constants of the model.
OTHERS = {
    "bench.flight_marks.SIZE": "follows from WAYS and FORCES",
    "prediction.flight.RING": "a place in a state",
    "prediction.flight.RING_RATE": "a place in a state",
    "prediction.flight.ACTUATOR": "a place in a state",
    "prediction.flight.ACTUATOR_RATE": "a place in a state",
    "prediction.bank_store.LATE": "a mark in a file",
    "prediction.bank_store.FORMAT": "a version",
    "prediction.level_curves.ROOT5": "of mathematics",
    "likelihood.time_parts.ROOT": "of mathematics",
    "likelihood.observations.ROUNDING": "of arithmetic",
    "likelihood.flight_likelihood.SHARES": "follows from WAYS and FORCES",
    "inference.sense_posterior.SHOWN": "length of a list in the record",
}


@dataclass(frozen=True)
class Constant:
    """A constant with what is told of it."""

    name: str
    value: Any
    unit: str
    meaning: str
    source: str
    status: str

    @property
    def row(self) -> str:
        """Row of the table."""
        cells = f"`{self.name}`", written(self.value), self.unit, self.meaning, self.source
        return "| " + " | ".join([*(cell or "-" for cell in cells), self.status]) + " |\n"


def written(value: Any) -> str:
    """Write a value: numbers, lists of them, and what they belong to."""
    if isinstance(value, Mapping):
        numbers = list(value.values())
        if len(numbers) > FEW:
            return f"{min(numbers):g} to {max(numbers):g}, {len(numbers)} of them"
        return "; ".join(f"{key}: {written(one)}" for key, one in value.items())
    if isinstance(value, np.ndarray):
        value = tuple(value.tolist())
    if isinstance(value, tuple):
        if len(value) > FEW:
            return f"{value[0]:.4g} to {value[-1]:.4g}, {len(value)} values"
        mark = "; " if any(isinstance(one, tuple) for one in value) else ", "
        return mark.join(map(written, value))
    if isinstance(value, str):
        return f"`{value}`"
    return "own" if value is None else f"{value:g}"


def _numeric(value: Any) -> bool:
    if isinstance(value, Mapping):
        return bool(value) and all(map(_numeric, value.values()))
    if isinstance(value, tuple):
        return bool(value) and all(map(_numeric, value))
    return isinstance(value, int | float | np.ndarray) and not isinstance(value, bool)


def _names(node: ast.stmt) -> Iterator[str]:
    """Yield the names in capitals that a statement defines by itself, not from the settings."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    value = getattr(node, "value", None)
    used = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)} if value else set()
    if isinstance(node, ast.Assign | ast.AnnAssign) and not used & {"DECISION", "PRIORS", "USUAL"}:
        for target in targets:
            for one in ast.walk(target) if target else ():
                if isinstance(one, ast.Name) and one.id.isupper() and one.id[0] != "_":
                    yield one.id


def _comment(lines: list[str], node: ast.stmt) -> str:
    """Return the comment on a definition, behind it or above it."""
    last = lines[(node.end_lineno or node.lineno) - 1]
    if "#:" in last:
        return last.partition("#:")[2].strip()
    above: list[str] = []
    place = node.lineno - 2
    while place >= 0 and lines[place].startswith("#:"):
        above.insert(0, lines[place][2:].strip())
        place -= 1
    return " ".join(above)


def in_modules() -> dict[str, tuple[Any, str]]:
    """Find all numbers that modules of the model define, with their comments."""
    house, found = ROOT / "diagnosis", {}
    paths = [house / "bench" / name for name in ("flight_marks.py", "input_errors.py")]
    for room in ("prediction", "likelihood", "inference"):
        paths += sorted((house / room).glob("*.py"))
    for path in paths:
        short = ".".join(path.relative_to(house).with_suffix("").parts)
        text = path.read_text(encoding="utf-8")
        module = importlib.import_module(f"dogshape.diagnosis.{short}")
        for node in ast.parse(text).body:
            for name in _names(node):
                value = getattr(module, name)
                if _numeric(value):
                    found[f"{short}.{name}"] = value, _comment(text.splitlines(), node)
    return found


def _listed() -> dict[str, tuple[str, str, str]]:
    """Return unit, status and source by name."""
    found = {}
    for module, block in CHOSEN.items():
        for line in block.strip().splitlines():
            name, unit, status, source = (part.strip() for part in line.split("|"))
            found[f"{module}.{name}"] = unit, status, source
    for module, block in NUMERICAL.items():
        for part in block.split(", "):
            name, _, unit = part.partition(" ")
            found[f"{module}.{name}"] = unit, "numerical", ""
    return found


def constants() -> list[Constant]:
    """List all constants: settings, margins, and numbers of modules; ValueError for a stray one."""
    found = [
        Constant(f"{section}.{name}", value, m["unit"], m["meaning"], m["source"], m["status"])
        for section, name, value, m in told(USUAL)
    ]
    why = "`bench.toml` has that of a stand"
    margin, below = "gap of a mean shift time below which nothing needs doing", "the same, at least"
    found += [
        Constant("margin_percent", 100 * USUAL_MARGIN.share, "%", margin, why, "judged"),
        Constant("margin_ms", 1e3 * USUAL_MARGIN.least, "ms", below, why, "judged"),
    ]
    listed, there = _listed(), in_modules()
    stray = {*there} ^ {*listed, *OTHERS}
    if stray:
        raise ValueError(f"in the code or in the lists only: {', '.join(sorted(stray))}")
    for name, (value, comment) in there.items():
        if name in listed:
            unit, status, source = listed[name]
            found.append(Constant(name, value, unit, comment, source, status))
    return found


def with_constants(page: str) -> str:
    """Replace the table of the page by that of the code."""
    head, _, rest = page.partition(BEGIN)
    table = "| name | value | unit | meaning | source | status |\n|---|---|---|---|---|---|\n"
    table += "".join(one.row for one in constants())
    return head + BEGIN + table + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(with_constants(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
