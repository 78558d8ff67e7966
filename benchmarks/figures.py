"""Write the tables of README.md, docs and paper that come from kept results and docs/evidence.

    python -m benchmarks.figures

A table stands between two lines, ``<!-- NAME: ... -->`` and ``<!-- end of NAME -->``, which readers
do not see. ``TABLES`` has the function that writes each name.
"""

from __future__ import annotations

import csv
import inspect
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any, get_args, get_origin

from pydantic import BaseModel

import dogshape
from benchmarks import constants, field_table
from benchmarks.field_table import EVIDENCE
from dogshape.diagnosis.terms import join_words
from dogshape.pipeline.record import Record
from dogshape.pipeline.search.study_record import StudyRecord
from dogshape.pipeline.simulate.design import OBJECTIVES
from dogshape.sim.clutch_tables import declared_key
from dogshape.sim.effect import Ordinary
from dogshape.sim.effects import EFFECTS
from dogshape.sim.units import unit_of

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(<!-- ([\w ]+): .*-->\n)(.*?)(<!-- end of \2 -->\n)", re.DOTALL)
SAMPLER_CELLS = 9  #: of a row of ``benchmarks.samplers``
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
PAPER = "mq200_paper"
COMPARED_DESIGNS = ("chosen", "gearbox's")  #: designs of contact_sets.txt
#: Settings of contact_sets.txt, and their words.
CONTACTS = {
    "lubricated_steel": "design set",
    "adams2019": "contact of the published model",
    "friction 0.080": "friction a third lower",
    "friction 0.160": "friction a third higher",
    "toothing;": "friction of 0.1 in the ring's toothing",
    "toothing, fork, drag": "the same, a fork of 0.3 kg and a drag of 0.1 N m",
    "dissipation 3 s/m": "faces that throw back",
    "dissipation 1 s/m": "faces that throw back as dry steel",
    "dissipation 60 s/m": "faces that throw back little",
}


# Sources


@cache
def read(path: str) -> Any:
    """Read a JSON file below the root of the project."""
    return json.loads((ROOT / path).read_text(encoding="utf-8"))


def result(study: str) -> Any:
    """Read the result that ``make studies`` keeps of a bundled study."""
    return read(f"studies/{study}/result.json")


def gap(bench: str) -> Any:
    """Read the diagnosis that ``make gaps`` keeps of the bench ``stand`` or ``adams``."""
    return read(f"docs/evidence/gap_{bench}.json")


def numbers(table: str, *labels: str) -> list[float]:
    """Read the numbers behind a label in a table of docs/evidence.

    Parameters
    ----------
    table : name of the file without its ending.
    labels : beginnings of lines, spaces aside: the first line with the last label that comes after
        lines with the others in their order.

    Raises
    ------
    LookupError : the table has no such line.
    """
    lines = iter((EVIDENCE / f"{table}.txt").read_text(encoding="utf-8").splitlines())
    for label in labels:
        line = next((text.strip() for text in lines if text.strip().startswith(label)), None)
        if line is None:
            raise LookupError(f"{table}.txt has no line that begins with {label!r}")
    return [float(word) for word in NUMBER.findall(line[len(labels[-1]) :])]  # type: ignore[index]


# Words


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table with a proper minus."""
    lines = [f"| {' | '.join(cells)} |".replace(" -", " \u2212") for cells in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:], ""])


def plus_minus(pair: Sequence[float], digits: int = 1, unit: str = "ms") -> str:
    """Write a value and its standard error."""
    return f"{pair[0]:.{digits}f} \u00b1 {pair[1]:.{digits}f} {unit}"


def percent(share: float, digits: int = 0) -> str:
    """Write a share."""
    return f"{100.0 * share:.{digits}f} %"


def confirmation_text(study: str, who: str, digits: int = 1) -> str:
    """Write the time of the prototype or the best design at new angles, with the other objective.

    That is the length, or the backlash.
    """
    confirmation = result(study)["confirmation"][who]
    row = designs(study)[who]
    pair = [confirmation[key] for key in ("expected_shift_time_s", "standard_error_s")]
    time = "none" if None in pair else plus_minus([1e3 * value for value in pair], digits)
    other_objective = (
        f"{row['axial_length_mm']:.1f}"
        if "axial_length_mm" in row
        else (f"{row['backlash_mm']:.2f}")
    )
    return f"{time}; {other_objective} mm"


def designs(study: str) -> dict[str, Any]:
    """Return prototype and best design of a study as the search has them."""
    return {"prototype": result(study)["trials"][0], "best": result(study)["best"]}


def estimate(study: str, who: str, name: str, scale: float = 1e3) -> list[float]:
    """Return an objective at new angles with its standard error."""
    record = result(study)["confirmation"][who]["estimates"][name]
    return [scale * record["value"], scale * record["standard_error"]]


def gain_text(setting: str, design: str = "chosen") -> str:
    """Write the gain of a design under one of the contact sets."""
    value, error, share = numbers("contact_sets", setting, design)[-3:]
    return f"{plus_minus((value, error))} ({share:.0f} %)"


def size_text(effect: str, name: str, digits: int = 0, scale: float = 1.0) -> str:
    """Write the 90 % interval of a size on the stand over all plausible hypotheses."""
    interval = gap("stand")["sizes"][effect][name]
    return " to ".join(f"{scale * interval[end]:.{digits}f}" for end in ("low", "high"))


def inclusion_text(effect: str) -> str:
    """Write the probability of an effect to be part of the cause, with its standard error."""
    if effect == "unknown":
        rows = gap("stand")["hypotheses"]
        return percent(sum(h["probability"] for h in rows if h["effects"] == ["unknown"]))
    error = max(1.0, 100.0 * gap("stand")["inclusion_error"][effect])
    return f"{100.0 * gap('stand')['inclusion'][effect]:.0f} ± {error:.0f} %"


def rms_text(bench: str, name: str, digits: int = 0) -> str:
    """Write a root-mean-square gap of a bench."""
    return f"{1e3 * gap(bench)['gap'][f'{name}_rmse_s']:.{digits}f} ms"


def headline(words: str) -> tuple[str, str, int]:
    """Read a headline figure of the field set: share, its interval, its number of cases."""
    _, value, count, *_ = next(
        row for row in field_table.headline_of(field_table.SCORE) if row[0] == words
    )
    share, _, interval = value.partition(" (")
    return share, f"({interval}", int(count)


def surrogate_validation() -> dict[str, float]:
    """Return the validation of the bundled surrogate."""
    return dict(read("studies/mq200_paper/surrogate.json")["validation"])


# Tables


@dataclass(frozen=True)
class MeasuredPoint:
    """Times at an operating point of the published bench, s.

    ``gap`` is the measured time less the simulated one; ``model`` and ``model_gap`` are those of
    the published Adams model.
    """

    mismatch_rpm: float
    measured: float
    gap: float
    model: float
    model_gap: float


def measured_points() -> list[MeasuredPoint]:
    """List the operating points that have a time on the stand and in the published model."""
    times = {name: published_times(name) for name in ("stand", "adams")}
    gaps = {name: point_gaps(name) for name in ("stand", "adams")}
    return [
        MeasuredPoint(
            mismatch_rpm=place[0],
            measured=times["stand"][place],
            gap=gaps["stand"][place],
            model=times["adams"][place],
            model_gap=gaps["adams"][place],
        )
        for place in sorted(set(gaps["stand"]) & set(gaps["adams"]))
    ]


def published_times(bench: str) -> dict[tuple[float, float], float]:
    """Read the shift times of a bundled data set by mismatch and force, s."""
    with (ROOT / f"studies/bench/mq200_{bench}/shifts.csv").open(encoding="utf-8") as file:
        return {
            (float(row["mismatch_rpm"]), float(row["force_N"])): float(row["shift_time_s"])
            for row in csv.DictReader(file)
            if row["shift_time_s"]
        }


def point_gaps(bench: str) -> dict[tuple[float, float], float]:
    """Read the gaps of a diagnosis by mismatch and force, s."""
    return {
        (row["mismatch_rpm"], row["force_N"]): row["gap_s"]
        for row in gap(bench)["where"]
        if row["gap_s"] is not None
    }


def measured_beside_simulated() -> str:
    """Write measured and simulated times of the published bench by mismatch."""
    points = measured_points()
    rows = []
    for mismatch in sorted({point.mismatch_rpm for point in points}):
        group = [point for point in points if point.mismatch_rpm == mismatch]
        rows.append((f"{mismatch:.0f} 1/min", *mean_times(group)))
    rows.append((f"all {len(points)} operating points", *mean_times(points)))
    causes = join_words([effect_title(name) for name in gap("stand")["gap"]["hypothesis"]])
    stand_rms = rms_text("stand", "baseline")
    rows.append(("difference, root mean square", "", "", "", stand_rms, model_rms_text()))
    heldout_rms = rms_text("stand", "heldout")
    rows.append((f"the same with {causes}, at held-out points", "", "", "", heldout_rms, ""))
    head = (
        "mismatch",
        "measured",
        "Adams model",
        "simulated",
        "measured less simulated",
        "Adams less simulated",
    )
    named = join_words([effect_title(name) for name in gap("stand")["causes"]])
    verdict = f"the verdict names {named}" if named else "too uncertain for a verdict"
    sentence = f"Most probable causes of the difference: {causes}; {verdict}."
    return f"{markdown(head, rows)}\n{sentence}\n"


def mean_times(points: Sequence[MeasuredPoint]) -> list[str]:
    """Write mean times of points: bench, published model, simulation, and both gaps."""
    measured = fmean(point.measured for point in points)
    stand_gap = fmean(point.gap for point in points)
    model = fmean(point.model for point in points)
    model_gap = fmean(point.model_gap for point in points)
    values = [measured, model, measured - stand_gap, stand_gap, model_gap]
    return [f"{1e3 * value:.0f} ms" for value in values]


def model_rms_text() -> str:
    """Write the root-mean-square difference between the published model and the simulation."""
    squares = [point.model_gap**2 for point in measured_points()]
    return f"{1e3 * fmean(squares) ** 0.5:.0f} ms"


def effect_title(name: str) -> str:
    """Write an effect of the diagnosis in words."""
    return EFFECTS[name].title


def confirmed_time(study: str, who: str) -> list[float]:
    """Return the expected time at new angles of ``best`` or ``prototype`` and its error, ms."""
    record = result(study)["confirmation"][who]
    return [1e3 * record["expected_shift_time_s"], 1e3 * record["standard_error_s"]]


def main_findings() -> str:
    """Write the main results of README.md."""
    best = plus_minus(confirmed_time("mq200", "best"))
    prototype = plus_minus(confirmed_time("mq200", "prototype"))
    gains = [numbers("contact_sets", name, "gearbox's")[-3] for name in CONTACTS]
    v = surrogate_validation()
    rows = [
        (
            "fastest dogs of the MQ200 that pass every check, mean over 28 operating points",
            f"{best}; prototype {prototype}",
            f"with other contact laws {min(gains):.0f} to {max(gains):.0f} ms faster than the "
            "prototype",
        ),
        (
            f"shift time of {v['n']} unseen designs, predicted without simulation",
            f"off by {1e3 * v['rmse_s']:.1f} ms (root mean square)",
            f"{1e3 * v['rmse_points_s']:.1f} ms at single operating points",
        ),
        (
            "shift times of the published Adams model",
            f"off by {numbers('adams', 'adams2019, all')[0]:.1f} % (root mean square) at all "
            "relative angles",
            f"{numbers('adams', 'adams2019, ten')[0]:.1f} % at the ten published angles",
        ),
        diagnosis_row(),
    ]
    return markdown(("question", "answer", "limitation"), rows)


def diagnosis_row() -> tuple[str, str, str]:
    """Write how often the diagnosis names a cause, and how often it is right."""
    whole, interval, named = headline("named as the whole: the whole truth")
    wrong, wrong_interval, sure = headline("named above 0.95, whole or in part: wrong")
    coverage, coverage_interval, sizes = headline("90 % intervals hold the sizes")
    upper_end = float(NUMBER.findall(coverage_interval)[-1])
    width = "too narrow" if upper_end < 90.0 else "wide enough"
    count = field_table.case_count(field_table.SCORE)
    return (
        f"cause hidden in {count} simulated benches",
        f"the diagnosis names causes on {named}; on {whole} {interval} of these they are right and "
        "complete",
        f"of {sure} cases with a cause above 95 %, {wrong} {wrong_interval} are wrong: it does not "
        f"act, or the whole lacks one; 90 % intervals of sizes are {width}: {coverage} "
        f"{coverage_interval} of {sizes} hold the true size",
    )


def ordinary_drags() -> str:
    """Write the ratio of the stand's drag to the drag of bearings and seals."""
    (parameter,) = EFFECTS["drag_torque"].parameters
    assert parameter.ordinary is not None
    drag = gap("stand")["sizes"]["drag_torque"][parameter.name]["mean"]
    return f"{drag / parameter.ordinary.high:.0f}"


def paper_design() -> str:
    """Write prototype and best design of the paper's study."""
    rows = designs(PAPER)
    angles = ("chamfer_deg", "traction_deg", "braking_deg")

    def design_row(words: str, cell: Callable[[str], str]) -> tuple[str, str, str]:
        return words, cell("prototype"), cell("best")

    table = [
        design_row(
            "chamfer \u03b1, traction \u03b2, braking \u03b3",
            lambda who: ", ".join(f"{rows[who][key]:.2f}\u00b0" for key in angles),
        ),
        design_row(
            "height h, number N",
            lambda who: f"{rows[who]['height_mm']:.3f} mm, {rows[who]['count']:d}",
        ),
        design_row(
            "expected shift time; axial length, root to root",
            lambda who: confirmation_text(PAPER, who, 2),
        ),
        design_row("smallest margin", lambda who: percent(rows[who]["smallest_margin"], 1)),
        design_row(
            "smallest with every tolerance at its worst (all checks but the landing)",
            lambda who: percent(rows[who]["margin_worst_case"]),
        ),
    ]
    return markdown(("", "prototype", "best design"), table)


def contacts() -> str:
    """Write the gains of two designs under each contact set."""
    rows = []
    for name, words in CONTACTS.items():
        restitution = numbers("contact_sets", name)[-2]
        gains = [gain_text(name, design) for design in COMPARED_DESIGNS]
        rows.append((words, f"{restitution:.2f}", *gains))
    limits = [numbers("contact_sets", "friction above", design)[0] for design in COMPARED_DESIGNS]
    limit_texts = [f"{limit:.3f}" for limit in limits]
    rows.append(("friction above which a flank locks", "", *limit_texts))
    head = ("contact and mechanism", "restitution", f"best of `{PAPER}`", "best of `mq200`")
    return markdown(head, rows)


def studies() -> str:
    """Write prototype and choice of the bundled studies."""
    time = "expected time; axial length"
    blow = "peak_impact_force_N"
    lash = "time; backlash"

    def other_text(study: str, who: str) -> str:
        length = f"{designs(study)[who]['axial_length_mm']:.1f} mm"
        if study == "mq200_robust":
            return f"{plus_minus(estimate(study, who, 'shift_time_quantile_s'), 1)}; {length}"
        mean = plus_minus(estimate(study, who, "expected_shift_time_s"), 1)
        return f"{mean}; {length}; {plus_minus(estimate(study, who, blow, 1e-3), 2, 'kN')}"

    rows = [
        ("`mq200`: [the default study](#the-default-study)", time, "mq200"),
        (f"`{PAPER}`: [the study of the paper](#the-study-of-the-paper)", time, PAPER),
        (
            "`mq200_actuation`: [shift control too](#shift-control-searched-with-the-shape)",
            time,
            "mq200_actuation",
        ),
        (
            "`mq200_robust`: friction, force and inertia uncertain",
            "95 % quantile of the time; axial length",
            "mq200_robust",
        ),
        ("`mq200_three`: both signs of mismatch", f"{time}; peak impact force", "mq200_three"),
        ("`mq200_both`: both signs, a ridge in the tip and backlash free", lash, "mq200_both"),
        ("`amt`: truck gearbox, pneumatic, up and down", time, "amt"),
        ("`ev_disconnect`: speed-controlled, near zero mismatch", lash, "ev_disconnect"),
        ("`motorcycle`: few undercut dogs with flat tips and play", lash, "motorcycle"),
    ]
    table = []
    for words, objectives, study in rows:
        has_other_objectives = study in ("mq200_robust", "mq200_three")
        text = other_text if has_other_objectives else confirmation_text
        table.append((words, objectives, text(study, "prototype"), text(study, "best")))
    return markdown(("study", "sought", "prototype", "chosen"), table)


def stand() -> str:
    """Write the diagnosis of the stand."""
    diagnosis = gap("stand")
    test = diagnosis["next_test"]
    probability = {
        (reading["key"], reading["value"]): percent(reading["probability"])
        for reading in diagnosis["readings"]
    }
    linkage = "linkage_compliance"
    rows = [
        (
            "gap of the 25 operating points that have a time, root mean square",
            f"{rms_text('stand', 'baseline')}; chance alone leaves {rms_text('stand', 'floor')}",
        ),
        (
            "gap at held-out points",
            f"{rms_text('stand', 'heldout')}, "
            f"of the best rival {rms_text('stand', 'rival_heldout')}",
        ),
        ("named cause", " and ".join(diagnosis["causes"]) or "none"),
        (
            "**dead time of the actuation**",
            f"{inclusion_text('actuation_delay')}; "
            f"{size_text('actuation_delay', 'delay_s', 0, 1e3)} ms",
        ),
        (
            "**drag torque on the sliding ring**",
            f"{inclusion_text('drag_torque')}; {size_text('drag_torque', 'drag_Nm', 1)} N m, "
            f"{ordinary_drags()} times that of bearings and seals",
        ),
        (
            "elastic linkage with its mass",
            f"{inclusion_text(linkage)}; "
            f"{size_text(linkage, 'compliance_mm_kN', 1)} mm/kN at the sleeve, "
            f"{size_text(linkage, 'mass_behind_kg', 1)} kg",
        ),
        (
            "mass",
            f"{inclusion_text('moving_mass')}; "
            f"{size_text('moving_mass', 'added_mass_kg')} kg at the sleeve",
        ),
        (
            "dry friction",
            f"{inclusion_text('sleeve_friction')}; {size_text('sleeve_friction', 'friction_N')} N",
        ),
        (
            "oil damping",
            f"{inclusion_text('viscous_damping')}; "
            f"{size_text('viscous_damping', 'damping_Ns_m')} N s/m",
        ),
        ("*unknown*", inclusion_text("unknown")),
        (
            "times start with the command; sense of the table",
            f"{probability['time_zero', 'command']} and {probability['sense', 'as_noted']}",
        ),
        (
            f"next test: {test['name']}",
            f"expected rise of the answer's probability {percent(test['gain'])}, "
            f"{test['hours']:.1f} h",
        ),
        (
            "gap of the published simulation, root mean square",
            f"{rms_text('adams', 'baseline', 1)}; chance alone leaves {rms_text('adams', 'floor')}",
        ),
    ]
    return markdown(("cause or figure", "probability and 90 % interval, or value"), rows)


def adams() -> str:
    """Write the deviations from the published table."""

    def cells(values: Sequence[float]) -> list[str]:
        return [f"{value:.1f} %" for value in values]

    rows = [
        (
            f"`{contact}`".replace(" in mm`", "`, K in N/mm^1.5"),
            words,
            *cells(numbers("adams", f"{contact}, {name}")),
        )
        for contact, name, words in (
            ("adams2019", "Drake, ten", "ten, Drake"),
            ("adams2019", "ten", "ten"),
            ("adams2019", "all", "all"),
            ("adams_impact", "ten", "ten"),
            ("adams_impact", "all", "all"),
            ("adams_impact in mm", "ten", "ten"),
            ("adams_impact in mm", "all", "all"),
        )
    ]
    head = (
        "contact",
        "relative angles",
        "25 cells: root mean square",
        "mean",
        "up to 25 1/min: root mean square",
        "mean",
        "from 100 1/min: root mean square",
        "mean",
    )
    return markdown(head, rows)


def engines() -> str:
    """Write how far shifts of the compiled engine and of Drake differ, by mismatch."""
    rows = []
    for speed in ("5", "10", "25", "50", "100", "149", "249", "all"):
        _, same, median, quantile_90, _, residual, *_ = numbers("engines", f"{speed} ")
        rows.append(
            (speed, f"{same:.2f} %", f"{median:.3f} %", f"{quantile_90:.2f} %", f"{residual:.2f} %")
        )
    head = (
        "1/min",
        "same outcome",
        "deviation of a shift, median",
        "90 %",
        "variance left within a point",
    )
    return markdown(head, rows)


def history() -> str:
    """Write the CPU times of each version."""
    with (EVIDENCE / "history.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    head = (
        "version",
        "compiled shift",
        "Drake shift",
        "ratio",
        "first use",
        "`check`",
        "`expect` to 1 %",
        "load of a core by others",
        "processor",
    )
    cells = [
        (
            f"{row['version']} ({row['date']})",
            f"{row['compiled_shift_ms']} ms",
            f"{row['drake_shift_ms']} ms",
            row["ratio"],
            f"{row['first_use_s']} s",
            f"{row['check_s']} s",
            f"{row['expect_s']} s",
            row["load_per_core"],
            row["processor"],
        )
        for row in rows
    ]
    return markdown(head, cells)


def samplers() -> str:
    """Write the share of the front and the best time of each sampler, by problem."""
    rows = []
    for line in (EVIDENCE / "samplers.txt").read_text("utf-8").splitlines():
        cells = re.split(r"\s{2,}", line)
        if len(cells) == SAMPLER_CELLS and cells[-1] != "min":
            problem, sampler, _, half, whole, _, best, *_ = cells
            intervals = (cell.replace(", ", " to ") for cell in (half, whole, best))
            rows.append((problem, sampler, *intervals))
    return markdown(("problem", "sampler", "half of the time", "all", "best time, ms"), rows)


def validation() -> str:
    """Write the figures of the bundled surrogate."""
    v = surrogate_validation()
    row = (
        f"{v['q2']:.3f}",
        f"{1e3 * v['rmse_s']:.2f} ms",
        f"{1e3 * v['bias_s']:+.2f} ms",
        percent(v["coverage_95"]),
        f"{v['q2_points']:.3f}",
        percent(v["coverage_points"]),
        f"{v['rank_best']:.2f}",
        f"{1e3 * v['noise_s']:.2f} ms",
    )
    head = (
        "Q\u00b2",
        "error",
        "bias",
        "in 95 %",
        "Q\u00b2 of points",
        "in 95 %",
        "rank of the best",
        "error of a reference",
    )
    return markdown(head, [row])


def effects() -> str:
    """Write name, meaning, priors and sources of each effect."""
    rows = []
    for effect in EFFECTS.values():
        priors = [
            f"`{parameter.name}` {parameter.low:g} to {parameter.high:g}, {parameter.scale}"
            for parameter in effect.parameters
        ]
        rows.append(
            (
                f"`{effect.name}`",
                f"**{effect.title}**: {effect.meaning}",
                "<br>".join(priors) or "none",
                "<br>".join(parameter.source for parameter in effect.parameters),
            )
        )
    head = ("effect", "name in reports, meaning", "parameters and prior", "source of the range")
    return markdown(head, sorted(rows))


def effect_parameters() -> str:
    """Write ordinary range and direct test of each parameter of the effects."""
    rows = []
    for effect in EFFECTS.values():
        errors = {error.parameter: error for error in effect.test.errors}
        for parameter in effect.parameters:
            ordinary = parameter.ordinary
            error = errors[parameter.name]
            parts = [f"{100.0 * error.relative:g} %"] if error.relative else []
            parts.append(f"{error.absolute:g} {unit_of(error.parameter)}".rstrip())
            rows.append(
                (
                    f"`{parameter.name}`",
                    ordinary_range(ordinary) if ordinary else "",
                    ordinary.source if ordinary else "",
                    effect.test.name,
                    " and ".join(parts),
                    error.source,
                )
            )
    head = ("parameter", "ordinary", "ordinary source", "direct test", "standard error", "source")
    return markdown(head, sorted(rows))


def ordinary_range(ordinary: Ordinary) -> str:
    """Write an ordinary range."""
    if math.isinf(ordinary.low):
        return f"up to {ordinary.high:g}"
    return f"{ordinary.low:g} to {ordinary.high:g}"


def objectives() -> str:
    """Write the quantities that a search minimises, maximises or bounds."""
    rows = [
        (
            f"`{objective.name}`",
            f"{objective.label}; **maximised**" if objective.maximise else objective.label,
            "shifts" if objective.simulated else "closed form",
        )
        for objective in OBJECTIVES.values()
    ]
    return markdown(("quantity", "meaning", "from"), rows)


def public_names() -> str:
    """Write the public names of the package with the arguments of functions and methods."""
    inherited = method_calls(dogshape.Result)
    rows = []
    for name in dogshape.__all__:
        member = getattr(dogshape, name)
        if not inspect.isclass(member):
            rows.append((f"`{name}`", f"`({argument_names(member)})`"))
            continue
        calls = method_calls(member)
        if issubclass(member, dogshape.Result) and member is not dogshape.Result:
            calls = ["those of `Result`", *(call for call in calls if call not in inherited)]
        rows.append((f"`{name}`", ", ".join(calls)))
    return markdown(("name", "arguments, or methods of a class"), rows)


def method_calls(kind: type) -> list[str]:
    """Write the public methods of a class with the names of their arguments."""
    return [
        f"`.{name}({argument_names(method)})`"
        for name, method in inspect.getmembers(kind, callable)
        if not name.startswith("_") and (inspect.isfunction(method) or inspect.ismethod(method))
    ]


def argument_names(function: Callable[..., Any]) -> str:
    """Write the names of a function's arguments; those behind ``*`` are given by name."""
    marks = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    words = []
    behind_star = False
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY and not behind_star:
            words.append("*")
        behind_star |= parameter.kind in (
            inspect.Parameter.KEYWORD_ONLY,
            inspect.Parameter.VAR_POSITIONAL,
        )
        words.append(f"{marks.get(parameter.kind, '')}{parameter.name}")
    return ", ".join(word for word in words if word != "self")


TABLES: dict[str, Callable[[], str | None]] = {
    "measured": measured_beside_simulated,
    "found": main_findings,
    "paper measured": measured_beside_simulated,
    "paper found": main_findings,
    "paper design": paper_design,
    "contacts": contacts,
    "studies": studies,
    "stand": stand,
    "blind field": field_table.passage,
    "adams": adams,
    "engines": engines,
    "history": history,
    "samplers": samplers,
    "validation": validation,
    "constants": constants.table,
    "effects": effects,
    "effect parameters": effect_parameters,
    "objectives": objectives,
    "public names": public_names,
    "keys": lambda: key_table(StudyRecord, "result.json"),
}


def key_table(kind: type[Record], name: str) -> str:
    """Write the keys of a record and of those in it, with units and meanings, as Markdown.

    ``name`` stands for the whole record.
    """
    paths_by_model: dict[type[BaseModel], list[str]] = {}
    _collect(kind, "", paths_by_model)
    blocks = []
    for model, paths in paths_by_model.items():
        title = ", ".join(f"`{path}`" for path in paths if path) or f"`{name}`"
        words = " ".join((model.__doc__ or "").split()).replace("``", "`")
        rows = [
            (f"`{key}`", declared_key(model, key).unit, str(declared.description))
            for key, declared in model.model_fields.items()
        ]
        blocks.append(f"{title}: {words}\n\n{markdown(('key', 'unit', 'meaning'), rows)}")
    return "\n".join(blocks)


def _collect(
    model: type[BaseModel], path: str, paths_by_model: dict[type[BaseModel], list[str]]
) -> None:
    """Note where a model stands, then the models that its keys hold."""
    paths_by_model.setdefault(model, []).append(path)
    if len(paths_by_model[model]) > 1:
        return  # its keys are known
    for name, declared in model.model_fields.items():
        for inner, mark in _models(declared.annotation):
            _collect(inner, f"{path}.{name}{mark}".removeprefix("."), paths_by_model)


def _models(annotation: Any, mark: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """Yield the models that a type holds, with the marks of lists and dictionaries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, mark
    mark += {list: "[]", dict: ".*"}.get(get_origin(annotation), "")
    for inner in get_args(annotation):
        yield from _models(inner, mark)


def fill_tables(page: str) -> str:
    """Put the tables of the sources into the text of a page."""

    def block(match: re.Match[str]) -> str:
        table = TABLES[match[2]]()
        return match[0] if table is None else f"{match[1]}{table}{match[4]}"

    return BLOCK.sub(block, page)


def pages() -> list[Path]:
    """List README.md, the paper and the pages of docs."""
    return [
        ROOT / "README.md",
        ROOT / "paper" / "paper.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs" / "api").glob("*.md")),
    ]


if __name__ == "__main__":
    for path in pages():
        path.write_text(fill_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
