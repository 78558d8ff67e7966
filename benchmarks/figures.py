"""Write the tables of README.md and docs that come from kept results and docs/evidence.

    python -m benchmarks.figures

A table stands between two lines, ``<!-- NAME: ... -->`` and ``<!-- end of NAME -->``, which readers
do not see. ``TABLES`` has the function that writes each name.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from benchmarks import constants, field_table
from dogshape.pipeline.record import Record, look_of
from dogshape.pipeline.search.result_schema import StudyRecord

ROOT = Path(__file__).resolve().parents[1]
EVIDENCE = ROOT / "docs" / "evidence"
BLOCK = re.compile(r"(<!-- ([\w ]+): .*-->\n)(.*?)(<!-- end of \2 -->\n)", re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
PAPER = "mq200_paper"
BESTS = ("chosen", "gearbox's")  #: designs of contact_sets.txt
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
        line = next((one.strip() for one in lines if one.strip().startswith(label)), None)
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


def confirmed(study: str, who: str, digits: int = 1) -> str:
    """Write the time of the prototype or the best design at new angles, with the other objective.

    That is the length, or the backlash.
    """
    found, row = result(study)["confirmation"][who], designs(study)[who]
    pair = [found[key] for key in ("expected_shift_time_s", "standard_error_s")]
    time = "none" if None in pair else plus_minus([1e3 * one for one in pair], digits)
    other = f"{row['axial_length_mm']:.1f}" if "axial_length_mm" in row else (
        f"{row['backlash_mm']:.2f}")  # fmt: skip
    return f"{time}; {other} mm"


def designs(study: str) -> dict[str, Any]:
    """Return prototype and best design of a study as the search has them."""
    return {"prototype": result(study)["trials"][0], "best": result(study)["best"]}


def estimate(study: str, who: str, name: str, scale: float = 1e3) -> list[float]:
    """Return an objective at new angles with its standard error."""
    found = result(study)["confirmation"][who]["estimates"][name]
    return [scale * found["value"], scale * found["standard_error"]]


def gain(setting: str, design: str = "chosen") -> str:
    """Write the gain of a design under one of the contact sets."""
    value, error, share = numbers("contact_sets", setting, design)[-3:]
    return f"{plus_minus((value, error))} ({share:.0f} %)"


def size(effect: str, name: str, digits: int = 0, scale: float = 1.0) -> str:
    """Write the 90 % interval of a size on the stand over all plausible hypotheses."""
    found = gap("stand")["sizes"][effect][name]
    return " to ".join(f"{scale * found[end]:.{digits}f}" for end in ("low", "high"))


def part(effect: str) -> str:
    """Write the probability of an effect to be part of the cause, with its standard error."""
    if effect == "unknown":
        rows = gap("stand")["hypotheses"]
        return percent(sum(h["probability"] for h in rows if h["effects"] == ["unknown"]))
    error = max(1.0, 100.0 * gap("stand")["inclusion_error"][effect])
    return f"{100.0 * gap('stand')['inclusion'][effect]:.0f} ± {error:.0f} %"


def rms(bench: str, name: str, digits: int = 0) -> str:
    """Write a root-mean-square gap of a bench."""
    return f"{1e3 * gap(bench)['gap'][f'{name}_rmse_s']:.{digits}f} ms"


def summary(pattern: str) -> str:
    """Return a number of the paragraph on the stand.

    Raises
    ------
    LookupError : the paragraph has no such words.
    """
    found = re.search(pattern, gap("stand")["summary"])
    if found is None:
        raise LookupError(f"the paragraph on the stand has no {pattern!r}")
    return f"{float(found[1]):.0f}"


def field(words: str) -> str:
    """Write a headline figure of the field set with its interval and its number of cases."""
    _, value, n, *_ = next(row for row in field_table.headline_of(field_table.SCORE)
                           if row[0] == words)  # fmt: skip
    return f"{value} of {n}"


def validated() -> dict[str, float]:
    """Return the validation of the bundled surrogate."""
    return dict(read("studies/mq200_paper/surrogate.json")["validation"])


# Tables


def on_the_stand() -> tuple[float, float]:
    """Return measured and simulated time, s, as means over the stand's points with a time."""
    gaps = {
        (one["mismatch_rpm"], one["force_N"]): one["gap_s"]
        for one in gap("stand")["where"]
        if one["gap_s"] is not None
    }
    with (ROOT / "studies/bench/mq200_stand/shifts.csv").open(encoding="utf-8") as file:
        measured = [
            float(row["shift_time_s"])
            for row in csv.DictReader(file)
            if (float(row["mismatch_rpm"]), float(row["force_N"])) in gaps
        ]
    return fmean(measured), fmean(measured) - fmean(gaps.values())


def found() -> str:
    """Write what README.md says was found."""
    best, prototype = (
        plus_minus([1e3 * result("mq200")["confirmation"][who][key]
                    for key in ("expected_shift_time_s", "standard_error_s")])
        for who in ("best", "prototype")
    )  # fmt: skip
    gains = [numbers("contact_sets", name, "gearbox's")[-3] for name in CONTACTS]
    measured, simulated = on_the_stand()
    v = validated()
    rows = [
        ("fastest dogs of the MQ200, mean over 28 operating points",
         f"{best}, prototype {prototype}",
         f"gain with other contact laws: {min(gains):.0f} to {max(gains):.0f} ms"),
        ("prediction of the shift time without simulation",
         f"explains {percent(v['q2'], 1)} of the variance of {v['n']} designs outside the fit",
         f"{percent(v['q2_points'], 1)} at single operating points"),
        ("published Adams model, shift times at all relative angles",
         f"root-mean-square deviation {numbers('adams', 'adams2019, all')[0]:.1f} %",
         f"{numbers('adams', 'adams2019, ten')[0]:.1f} % at the ten published angles"),
        ("published bench, mean over 25 operating points",
         f"simulated {1e3 * simulated:.0f} ms, measured {1e3 * measured:.0f} ms",
         "absolute times need your bench"),
        ("diagnosis of simulated benches with a hidden cause",
         f"a named cause is right and complete in {field('named: the whole truth')} cases",
         f"90 % intervals hold the true size in {field('90 % intervals hold the sizes')}"),
    ]  # fmt: skip
    return markdown(("question", "answer", "limitation"), rows)


def ordinary_drags() -> str:
    """Write the stand's drag in multiples of that of bearings and seals."""
    return summary(r"Drag of [\d.]+ N m is ([\d.]+) times")


def paper_design() -> str:
    """Write prototype and best design of the paper's study."""
    rows = designs(PAPER)
    angles = ("chamfer_deg", "traction_deg", "braking_deg")

    def both(words: str, cell: Callable[[str], str]) -> tuple[str, str, str]:
        return (words, *(cell(who) for who in ("prototype", "best")))

    table = [
        both("chamfer \u03b1, traction \u03b2, braking \u03b3",
             lambda who: ", ".join(f"{rows[who][key]:.2f}\u00b0" for key in angles)),
        both("height h, number N",
             lambda who: f"{rows[who]['height_mm']:.3f} mm, {rows[who]['count']:d}"),
        both("expected shift time; axial length, root to root",
             lambda who: confirmed(PAPER, who, 2)),
        both("smallest margin", lambda who: percent(rows[who]["smallest_margin"], 1)),
        both("smallest with every tolerance at its worst (all checks but the landing)",
             lambda who: percent(rows[who]["margin_worst_case"])),
    ]  # fmt: skip
    return markdown(("", "prototype", "best design"), table)


def contacts() -> str:
    """Write the gains of two designs under each contact set."""
    rows = [
        (words, f"{numbers('contact_sets', name)[-2]:.2f}", *(gain(name, one) for one in BESTS))
        for name, words in CONTACTS.items()
    ]
    limits = (f"{numbers('contact_sets', 'friction above', one)[0]:.3f}" for one in BESTS)
    rows.append(("friction above which a flank locks", "", *limits))
    return markdown(
        ("contact and mechanism", "restitution", f"best of `{PAPER}`", "best of `mq200`"), rows
    )


def studies() -> str:
    """Write prototype and choice of the bundled studies."""
    time, blow, lash = "expected time; axial length", "peak_impact_force_N", "time; backlash"

    def other(study: str, who: str) -> str:
        length = f"{designs(study)[who]['axial_length_mm']:.1f} mm"
        if study == "mq200_robust":
            return f"{plus_minus(estimate(study, who, 'shift_time_quantile_s'), 1)}; {length}"
        mean = plus_minus(estimate(study, who, "expected_shift_time_s"), 1)
        return f"{mean}; {length}; {plus_minus(estimate(study, who, blow, 1e-3), 2, 'kN')}"

    rows = [
        ("`mq200`: [the default study](#the-default-study)", time, "mq200"),
        (f"`{PAPER}`: [the study of the paper](#the-study-of-the-paper)", time, PAPER),
        ("`mq200_actuation`: [shift control too](#shift-control-searched-with-the-shape)", time,
         "mq200_actuation"),
        ("`mq200_robust`: friction, force and inertia uncertain",
         "95 % quantile of the time; axial length", "mq200_robust"),
        ("`mq200_three`: both signs of mismatch", f"{time}; peak impact force", "mq200_three"),
        ("`mq200_both`: both signs, a ridge in the tip and backlash free", lash, "mq200_both"),
        ("`amt`: truck gearbox, pneumatic, up and down", time, "amt"),
        ("`ev_disconnect`: speed-controlled, near zero mismatch", lash, "ev_disconnect"),
        ("`motorcycle`: few undercut dogs with flat tips and play", lash, "motorcycle"),
    ]  # fmt: skip
    apart = ("mq200_robust", "mq200_three")
    return markdown(
        ("study", "sought", "prototype", "chosen"),
        [
            (words, sought, *((other if study in apart else confirmed)(study, who)
                              for who in ("prototype", "best")))
            for words, sought, study in rows
        ],
    )  # fmt: skip


def stand() -> str:
    """Write the diagnosis of the stand."""
    found, test = gap("stand"), gap("stand")["next_test"]
    sure = {(one["key"], one["value"]): percent(one["probability"]) for one in found["readings"]}
    linkage = "linkage_compliance"
    rows = [
        ("gap of the 25 operating points that have a time, root mean square",
         f"{rms('stand', 'baseline')}; chance alone leaves {rms('stand', 'floor')}"),
        ("gap at held-out points",
         f"{rms('stand', 'heldout')}, of the best rival {rms('stand', 'rival_heldout')}"),
        ("named cause", " and ".join(found["causes"]) or "none"),
        ("**dead time of the actuation**",
         f"{part('actuation_delay')}; {size('actuation_delay', 'delay_s', 0, 1e3)} ms"),
        ("**drag torque on the sliding ring**",
         f"{part('drag_torque')}; {size('drag_torque', 'drag_Nm', 1)} N m, "
         f"{ordinary_drags()} times that of bearings and seals"),
        ("elastic linkage with its mass",
         f"{part(linkage)}; {size(linkage, 'compliance_mm_kN', 1)} mm/kN at the sleeve, "
         f"{size(linkage, 'mass_behind_kg', 1)} kg"),
        ("mass", f"{part('moving_mass')}; {size('moving_mass', 'added_mass_kg')} kg at the sleeve"),
        ("dry friction", f"{part('sleeve_friction')}; {size('sleeve_friction', 'friction_N')} N"),
        ("oil damping",
         f"{part('viscous_damping')}; {size('viscous_damping', 'damping_Ns_m')} N s/m"),
        ("*unknown*", part("unknown")),
        ("times start with the command; sense of the table",
         f"{sure['time_zero', 'command']} and {sure['sense', 'as_noted']}"),
        (f"next test: {test['name']}",
         f"expected to settle it with {percent(test['chance_to_settle'])}, {test['hours']:.1f} h"),
        ("gap of the published simulation, root mean square",
         f"{rms('adams', 'baseline', 1)}; chance alone leaves {rms('adams', 'floor')}"),
    ]  # fmt: skip
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
    head = ("contact", "relative angles", "25 cells: root mean square", "mean",
            "up to 25 1/min: root mean square", "mean", "from 100 1/min: root mean square",
            "mean")  # fmt: skip
    return markdown(head, rows)


def engines() -> str:
    """Write how far shifts of the compiled engine and of Drake differ, by mismatch."""
    rows = []
    for speed in ("5", "10", "25", "50", "100", "149", "249", "all"):
        _, same, median, most, _, left, *_ = numbers("engines", f"{speed} ")
        rows.append((speed, f"{same:.2f} %", f"{median:.3f} %", f"{most:.2f} %", f"{left:.2f} %"))
    head = ("1/min", "same outcome", "deviation of a shift, median", "90 %",
            "variance left within a point")  # fmt: skip
    return markdown(head, rows)


def samplers() -> str:
    """Write the share of the front that each sampler finds, by processor time."""
    rows = []
    for name in ("TPE", "NSGA-II", "GPSampler", "quasi-random", "own"):
        shares = numbers("samplers", "share of", f"{name} ")[:9]
        rows.append((name, *(f"{one:.3f}" for one in shares[::3]), f"{shares[7]:.3f}"))
    return markdown(("sampler", "0.2 min", "0.4 min", "0.8 min", "least of five"), rows)


def validation() -> str:
    """Write the figures of the bundled surrogate."""
    v = validated()
    row = (
        f"{v['q2']:.3f}", f"{1e3 * v['rmse_s']:.2f} ms", f"{1e3 * v['bias_s']:+.2f} ms",
        percent(v["coverage_95"]), f"{v['q2_points']:.3f}", percent(v["coverage_points"]),
        f"{v['rank_best']:.2f}", f"{1e3 * v['noise_s']:.2f} ms",
    )  # fmt: skip
    head = ("Q\u00b2", "error", "bias", "in 95 %", "Q\u00b2 of points", "in 95 %",
            "rank of the best", "error of a reference")  # fmt: skip
    return markdown(head, [row])


TABLES: dict[str, Callable[[], str | None]] = {
    "found": found,
    "paper design": paper_design,
    "contacts": contacts,
    "studies": studies,
    "stand": stand,
    "blind field": field_table.passage,
    "adams": adams,
    "engines": engines,
    "samplers": samplers,
    "validation": validation,
    "constants": constants.table,
    "keys": lambda: key_table(StudyRecord, "result.json"),
}


def key_table(kind: type[Record], name: str) -> str:
    """Write the keys of a record and of those in it, with units and meanings, as Markdown.

    ``name`` stands for the whole record.
    """
    places: dict[type[BaseModel], list[str]] = {}
    _collect(kind, "", places)
    blocks = []
    for model, paths in places.items():
        title = ", ".join(f"`{path}`" for path in paths if path) or f"`{name}`"
        words = " ".join((model.__doc__ or "").split()).replace("``", "`")
        rows = [
            (f"`{one}`", look_of(model, one)["unit"], str(declared.description))
            for one, declared in model.model_fields.items()
        ]
        blocks.append(f"{title}: {words}\n\n{markdown(('key', 'unit', 'meaning'), rows)}")
    return "\n".join(blocks)


def _collect(model: type[BaseModel], path: str, places: dict[type[BaseModel], list[str]]) -> None:
    """Note where a model stands, then the models that its keys hold."""
    places.setdefault(model, []).append(path)
    if len(places[model]) > 1:
        return  # its keys are known
    for name, declared in model.model_fields.items():
        for inner, mark in _models(declared.annotation):
            _collect(inner, f"{path}.{name}{mark}".removeprefix("."), places)


def _models(annotation: Any, mark: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """Yield the models that a type holds, with the marks of lists and dictionaries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, mark
    mark += {list: "[]", dict: ".*"}.get(get_origin(annotation), "")
    for part in get_args(annotation):
        yield from _models(part, mark)


def filled(page: str) -> str:
    """Put the tables of the sources into the text of a page."""

    def block(match: re.Match[str]) -> str:
        table = TABLES[match[2]]()
        return match[0] if table is None else f"{match[1]}{table}{match[4]}"

    return BLOCK.sub(block, page)


def pages() -> list[Path]:
    """List README.md and the pages of docs."""
    return [
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs" / "api").glob("*.md")),
    ]


if __name__ == "__main__":
    for path in pages():
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
