"""Content of the live page: its fields, and results of the package as cards and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from dash import dcc, html

from dogshape.app.page import Children
from dogshape.check import Check, Checked, hinge_lines
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Figure, percent
from dogshape.pipeline.reports.text import check_name, label, time_text
from dogshape.pipeline.store.check_records import CheckRow
from dogshape.pipeline.store.check_records import check_table as record_table
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.units import unit_of
from dogshape.surrogate.model import Expected

SHOWN_HINGES = 3  #: decisive assumptions on the card of the margins
SLIDER_STEPS = 400
DEFAULT_REACH = 0.2  #: of a slider on either side, over the value, where the study has no range


@dataclass(frozen=True)
class Number:
    """A number of the page: a key of the study file or, without a dot, of the operating point.

    ``value`` is the initial one, ``ends`` are those of its slider, ``words`` the label if it is not
    that of the key.
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


def number_field(number: Number) -> html.Div:
    """Lay out a number: label, field, unit, slider, and room for an error message."""
    name = number.key.rpartition(".")[2]
    low, high = number.ends
    if not low < high:
        reach = DEFAULT_REACH * abs(number.value) or 1.0
        low = number.value - reach
        high = number.value + reach
    slider = dcc.Slider(
        low,
        high,
        1 if name == "count" else (high - low) / SLIDER_STEPS,
        marks=None,
        value=number.value,
        id={"number": number.key, "kind": "slider"},
        allow_direct_input=False,
        tooltip={"placement": "bottom"},
    )
    field_id = {"number": number.key, "kind": "field"}
    return html.Div(
        [
            html.Label(number.words or label(name)),
            dcc.Input(number.text, "text", id=field_id, debounce=0.4),
            html.Span(unit_of(name)),
            slider,
            html.P(id={"fault": number.key}, className="bad"),
        ],
        className="number",
    )


def layout(
    config: Setup, numbers: Sequence[Number], front: Figure | None, remarks: Sequence[str] = ()
) -> html.Div:
    """Lay out the live page of a study; ``front`` is None without a search.

    The first of ``remarks`` is shown, the others open below it.
    """
    desk = html.Div([_question(config, numbers), _answer(front)], className="desk")
    heading: Children = [html.H1(f"{config.name}: live")]
    if remarks:
        summary, *lines = remarks
        heading.append(html.Details([html.Summary(summary), *map(html.P, lines)], className="note"))
    return html.Div([*heading, desk, dcc.Store("asked")])


def _question(config: Setup, numbers: Sequence[Number]) -> html.Aside:
    """Lay out the fields by group."""

    def fields_of(group: str) -> Children:
        return [number_field(number) for number in numbers if number.group == group]

    scopes = {
        "all": f"all {len(config.points)} operating points of the study",
        "one": "one operating point",
    }
    return html.Aside(
        [
            html.H2("Dogs"),
            html.Button("reset to the study", id="back"),
            *fields_of("dog"),
            html.H2("Operating points"),
            dcc.RadioItems(scopes, "all", id="where"),
            *fields_of("point"),
            html.H2("Friction"),
            *fields_of("friction"),
            html.H2("Single shift"),
            *fields_of("shift"),
            html.P(id="shift-link"),
        ]
    )


def _answer(front: Figure | None) -> html.Main:
    """Lay out cards, section, checks, front, files and command; callbacks fill them."""
    looks = {"predicted": "chosen", "simulated": "gain", "margins": ""}
    cards = [html.Div(id=name, className=f"card {look}") for name, look in looks.items()]
    check_note = (
        "Margin: distance to the limit over the limit. A check shows its formula, source and key "
        "where the mouse points at it."
    )
    search = html.Div(
        [
            html.H2("Designs of the search"),
            html.P("A click takes a design over into the fields.", className="note"),
            dcc.Graph("front", figure=front or {}, config=cast(Any, {"displayModeBar": False})),
        ],
        hidden=front is None,
    )
    return html.Main(
        [
            html.Div(cards, className="cards"),
            html.P(id="refused", className="bad"),
            html.Div(id="cautions"),
            html.Img(id="section", alt="Section of both rings, unrolled at the mean radius"),
            html.H2("Checks"),
            html.Div(id="checks", className="scroll"),
            html.P(check_note, className="note"),
            search,
            html.H2("Files of this design"),
            html.P(["reason of a decision, for the data sheet ", dcc.Input("", id="why")]),
            html.P(id="files"),
            html.H2("The same from the command line"),
            html.Code(id="command"),
        ],
        id="answer",
    )


def card(title: str, value: str, *lines: str, exact: Expected | None = None) -> Children:
    """Fill a card with title, value and lines; ``exact`` is stored unrounded for programs."""
    attributes: dict[str, Any] = {}
    if exact is not None:
        attributes = {"data-exact": f"{exact.time!r} {exact.low!r} {exact.high!r}"}
    spans = [html.Span(line) for line in lines if line]
    return [html.Span(title), html.B(value, **attributes), *spans]


def _interval_text(expected: Expected) -> str:
    return f"95 %: {time_text(expected.low)} to {time_text(expected.high)}"


def predicted_card(check: Checked, reason: str) -> Children:
    """Show the surrogate's time with its interval, or the ``reason`` why there is none."""
    title = "predicted shift time"
    if not isinstance(check, Check) or check.guess is None:
        return card(title, "none", reason)
    answer = check.guess.answer
    expected = answer.expected
    if expected is None:
        return card(title, "none", answer.refusal)
    distance = f"nearest simulated design: {answer.distance:.1f} median spacings"
    time = time_text(expected.time)
    return card(title, time, _interval_text(expected), distance, exact=expected)


def simulated_card(check: Check) -> Children:
    """Show the simulated time with its error and its difference to the prediction."""
    title = "simulated shift time"
    simulated = check.expected
    if simulated is None:
        return card(title, "none", check.refusal)
    difference = ""
    predicted = None if check.guess is None else check.guess.answer.expected
    if predicted is not None:
        direction = "more" if simulated.time > predicted.time else "less"
        amount = time_text(abs(simulated.time - predicted.time))
        difference = f"{amount} {direction} than predicted"
        if check.missed:
            difference += ", beyond both intervals"
    time = time_text(simulated.time, simulated.error)
    shifts = f"{check.shifts} shifts, compiled engine"
    return card(title, time, _interval_text(simulated), difference, shifts, exact=simulated)


def verdict_content(check: Checked) -> dict[str, Any]:
    """Show smallest margin, verdict and checks, as content of the page by place."""
    weakest = smallest_margin(check.design.checks)
    verdict = check.verdict
    hinges = hinge_lines(verdict)[:SHOWN_HINGES] if verdict.flipping else []
    lines = (
        check_name(weakest.name),
        verdict.line,
        f"at statistical tolerances: {check.statistical.replace('_', ' ')}",
        f"at worst-case tolerances: {check.worst_case.replace('_', ' ')}",
        *(line.partition(" [")[0] for line in hinges),
    )
    look = {"passes": "good", "fails": "bad"}.get(verdict.state, "open")
    return {
        "margins.children": card("smallest margin", percent(weakest.margin), *lines),
        "margins.className": f"card {look}",
        "checks.children": check_table(check),
    }


def cautions(check: Checked) -> Children:
    """List the warnings of the study and of the surrogate's prediction."""
    warnings = list(check.notes)
    if isinstance(check, Check) and check.guess is not None:
        warnings += check.guess.answer.warnings
        validation = check.guess.validation
        if not validation.useful:
            warnings.append(f"the surrogate has Q² {validation.q2:.2f} on designs outside its fit")
    return [html.P(f"Caution: {warning}.", className="bad") for warning in warnings]


def check_table(check: Checked) -> html.Table:
    """Tabulate all checks as the command line does, with formula, source and key as a hint."""
    rows_by_name = {row.name: row for row in check.judged_rows}
    table = record_table(list(rows_by_name.values()))
    body = []
    for cells in table.rows:
        row = rows_by_name.get(cells[0])
        if row is None:
            group = html.Td(cells[0], colSpan=len(table.heads))
            body.append(html.Tr(group, className="group"))
        else:
            body.append(_check_line(row, cells))
    head = html.Tr([html.Th(text) for text in table.heads])
    return html.Table([html.Thead(head), html.Tbody(body)])


def _check_line(row: CheckRow, cells: Sequence[str]) -> html.Tr:
    """Lay out a check; its margin is stored unrounded for programs."""
    attributes: dict[str, Any] = {}
    if row.passed is not None:
        attributes = {"data-check": row.name, "data-margin": repr(row.margin)}
    hint = f"{row.meaning}\n{row.formula}\n{row.source}\nkey: {row.limit_key}"
    texts = [check_name(row.name), *cells[1:]]
    columns = [html.Td(text, className="bad" if isinstance(text, Bad) else "") for text in texts]
    look = "failed" if row.passed is False and not row.unclear else ""
    return html.Tr(columns, title=hint, className=look, **attributes)
