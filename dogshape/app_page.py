"""Content of the live page: its fields, and results of the package as cards and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from dash import dcc, html

from dogshape.check import Check, Checked, hinge_lines
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Figure, percent
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.text import check_name, label, time_text
from dogshape.pipeline.store.result_records import check_table as record_table
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.units import unit_of
from dogshape.surrogate.model import Expected

Children = list[Any]
HINGES = 3  #: assumptions that the card of the margins names


@dataclass(frozen=True)
class Number:
    """A number of the page: a key of the study file, or of the question where it has no dot.

    ``value`` stands in its field at the start, ``ends`` are those of its slider.
    """

    key: str
    group: str
    value: float
    ends: tuple[float, float]
    words: str = ""

    @property
    def text(self) -> str:
        """Text of the field at the start."""
        return f"{self.value:.6g}"


def number_field(one: Number) -> html.Div:
    """Lay out a number: label, field, unit, slider, and the sentence on a wrong value."""
    name, (low, high) = one.key.rpartition(".")[2], one.ends
    if not low < high:
        reach = 0.2 * abs(one.value) or 1.0
        low, high = one.value - reach, one.value + reach
    step = 1 if name == "count" else (high - low) / 400
    field, slider = ({"number": one.key, "kind": kind} for kind in ("field", "slider"))
    return html.Div([
        html.Label(one.words or label(name)),
        dcc.Input(one.text, "text", id=field, debounce=0.4),
        html.Span(unit_of(name)),
        dcc.Slider(low, high, step, marks=None, value=one.value, id=slider,
                   allow_direct_input=False, tooltip={"placement": "bottom"}),
        html.P(id={"fault": one.key}, className="bad"),
    ], className="number")  # fmt: skip


def layout(config: Setup, numbers: Sequence[Number], front: Figure | None) -> html.Div:
    """Lay out the page of a study with what it knows."""
    name, still = config.name, cast(Any, {"displayModeBar": False})
    fields = {group: [number_field(n) for n in numbers if n.group == group]
              for group in ("dog", "point", "friction", "shift")}  # fmt: skip
    where = {"all": f"all {len(config.points)} operating points of the study",
             "one": "one operating point"}  # fmt: skip
    aside = html.Aside([
        html.H2("Dogs"), html.Button("reset to the study", id="back"), *fields["dog"],
        html.H2("Operating points"), dcc.RadioItems(where, "all", id="where"), *fields["point"],
        html.H2("Friction"), *fields["friction"],
        html.H2("Single shift"), *fields["shift"], html.P(id="shift-link"),
    ])  # fmt: skip
    cards = {"predicted": "chosen", "simulated": "gain", "margins": ""}
    main = html.Main([
        html.Div([html.Div(id=one, className=f"card {kind}") for one, kind in cards.items()],
                 className="cards"),
        html.P(id="refused", className="bad"), html.Div(id="cautions"),
        html.Img(id="section", alt="Section of both rings, unrolled at the mean radius"),
        html.H2("Checks"), html.Div(id="checks", className="scroll"),
        html.P("Margin: distance to the limit over the limit. A check shows its formula, source "
               "and key where the mouse points at it.", className="note"),
        html.Div([
            html.H2("Designs of the search"),
            html.P("A click takes a design over into the fields.", className="note"),
            dcc.Graph("front", figure=front or {}, config=still),
        ], hidden=front is None),
        html.H2("Files of this design"),
        html.P(["reason of a decision, for the data sheet ", dcc.Input("", id="why")]),
        html.P(id="files"), html.H2("The same from the command line"), html.Code(id="command"),
    ], id="answer")  # fmt: skip
    desk = html.Div([aside, main], className="desk")
    return html.Div([html.H1(f"{name}: live"), desk, dcc.Store("asked")])


def card(title: str, value: str, *lines: str, exact: Expected | None = None) -> Children:
    """Fill a card: title, value, lines; ``exact`` in full, for who reads the page by program."""
    marks: Row = {}
    if exact is not None:
        marks = {"data-exact": f"{exact.time!r} {exact.low!r} {exact.high!r}"}
    return [html.Span(title), html.B(value, **marks), *(html.Span(one) for one in lines if one)]


def _interval(found: Expected) -> str:
    return f"95 %: {time_text(found.low)} to {time_text(found.high)}"


def predicted_card(found: Checked, reason: str) -> Children:
    """Show the surrogate's time with its interval, or the reason why it has none."""
    answer = found.guess.answer if isinstance(found, Check) and found.guess else None
    if answer is None or answer.expected is None:
        return card("predicted shift time", "none", answer.refusal if answer else reason)
    near, seen = f"nearest simulated design: {answer.distance:.1f} median spacings", answer.expected
    return card("predicted shift time", time_text(seen.time), _interval(seen), near, exact=seen)


def simulated_card(found: Check) -> Children:
    """Show the simulated time with its error, beside the prediction."""
    seen, apart = found.expected, ""
    if seen is None:
        return card("simulated shift time", "none", found.refusal)
    if found.guess is not None and (guess := found.guess.answer.expected) is not None:
        word = "more" if seen.time > guess.time else "less"
        apart = f"{time_text(abs(seen.time - guess.time))} {word} than predicted"
        apart += ", beyond both intervals" if found.missed else ""
    value, shifts = time_text(seen.time, seen.error), f"{found.shifts} shifts, compiled engine"
    return card("simulated shift time", value, _interval(seen), apart, shifts, exact=seen)


def judged(found: Checked) -> dict[str, Any]:
    """Show the smallest margin, the verdict with what decides it, and the table of checks."""
    weakest, verdict = smallest_margin(found.design.checks), found.verdict
    lines = (
        check_name(weakest.name),
        verdict.line,
        f"at statistical tolerances: {found.statistical.replace('_', ' ')}",
        f"at worst-case tolerances: {found.worst_case.replace('_', ' ')}",
        *(line.partition(" [")[0] for line in hinge_lines(verdict)[:HINGES] if verdict.flipping),
    )
    kind = {"passes": "good", "fails": "bad"}.get(verdict.state, "open")
    return {
        "margins.children": card("smallest margin", percent(weakest.margin), *lines),
        "margins.className": f"card {kind}",
        "checks.children": check_table(found),
    }


def cautions(found: Checked) -> Children:
    """List what speaks against trusting a prediction, or the study's numbers."""
    words = list(found.notes)
    if isinstance(found, Check) and found.guess is not None:
        words += found.guess.answer.warnings
        q2, useful = found.guess.validation.q2, found.guess.validation.useful
        words += [] if useful else [f"the surrogate has Q² {q2:.2f} on designs outside its fit"]
    return [html.P(f"Caution: {one}.", className="bad") for one in words]


def check_table(found: Checked) -> html.Table:
    """Tabulate all checks as the command line does, with formula, source and key to point at."""
    checks, body = {row.name: row for row in found.judged_rows}, []
    table = record_table(list(checks.values()))
    for cells in table.rows:
        row = checks.get(cells[0])
        if row is None:
            body.append(html.Tr(html.Td(cells[0], colSpan=len(table.heads)), className="group"))
            continue
        exact: Row = {}
        if row.passed is not None:
            exact = {"data-check": row.name, "data-margin": repr(row.margin)}
        said = f"{row.meaning}\n{row.formula}\n{row.source}\nkey: {row.limit_key}"
        texts = [check_name(row.name), *cells[1:]]
        drawn = [html.Td(text, className="bad" if isinstance(text, Bad) else "") for text in texts]
        kind = "failed" if row.passed is False and not row.unclear else ""
        body.append(html.Tr(drawn, title=said, className=kind, **exact))
    return html.Table([html.Thead(html.Tr(list(map(html.Th, table.heads)))), html.Tbody(body)])
