"""Content of the live page: its fields, and results of the package as cards and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from dash import dcc, html

from dogshape.app.live_fields import GROUPS, PageField, field_hints
from dogshape.app.page import Children, answer_field, row_look
from dogshape.app.time_curve import TimeCurve
from dogshape.check import Check, Checked, hinge_lines
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.drafts.answers import shown_value
from dogshape.pipeline.record import Bad, Figure, percent
from dogshape.pipeline.reports.result_figures import slider_figure
from dogshape.pipeline.reports.text import axis, check_name, minus, time_text
from dogshape.pipeline.store.check_records import CheckRow
from dogshape.pipeline.store.check_records import check_table as record_table
from dogshape.sim.strength.checks import smallest_margin
from dogshape.surrogate.model import Expected

SHOWN_HINGES = 3  #: decisive assumptions beside the verdict
SLIDER_STEPS = 400
OPEN_GROUPS = ("dog", "point", "load")  #: whose fields are shown at the start
TYPING_S = 0.4  #: of rest after which a typed text is read
PREDICTED = "predicted shift time"
SIMULATED = "simulated shift time"
MARGIN = "smallest margin"
RUNNING = "…"  #: in place of a simulated time
NO_VALUE = "\N{EN DASH}"


def _field_row(field: PageField, hint: str) -> html.Div:
    """Lay out a field: label, field, unit, slider, and room for an error message."""
    parts: Children = [
        html.Label(field.label, title=hint),
        answer_field(
            {"number": field.key, "kind": "text" if field.ends is None else "field"},
            field.text,
            placeholder(field.default),
            choices=field.choices,
            debounce=TYPING_S,
        ),
        html.Span(field.unit),
    ]
    if field.ends is not None:
        parts.append(_slider(field, *field.ends))
    parts.append(html.P(id={"fault": field.key}, className="bad"))
    return html.Div(parts, id={"row": field.key}, className=field_look(field, is_used=True))


def _slider(field: PageField, low: float, high: float) -> dcc.Slider:
    return dcc.Slider(
        low,
        high,
        1 if isinstance(field.default, int) else (high - low) / SLIDER_STEPS,
        marks=None,
        value=field.default,
        id={"number": field.key, "kind": "slider"},
        allow_direct_input=False,
        tooltip={"placement": "bottom"},
    )


def placeholder(default: Any) -> str:
    """Format the value of an empty field."""
    return "not given" if default is None else shown_value(default)


def field_look(field: PageField, fault: str = "", *, is_used: bool) -> str:
    """Return the look of a field's row: wide for texts, wrong, or absent for another actuator."""
    look = "number"
    if field.choices or isinstance(field.default, list):
        look = "number wide"
    return row_look(look, fault) if is_used else f"{look} absent"


def layout(
    config: Setup, fields: Sequence[PageField], front: Figure | None, remarks: Sequence[str] = ()
) -> html.Div:
    """Lay out the live page of a study; ``front`` is None without a search.

    The first of ``remarks`` is shown, the others open below it.
    """
    desk = html.Div([_fields(config, fields), _answer(front)], className="desk")
    heading: Children = [
        html.H1(f"{config.name}: live"),
        html.P(f"{config.name}, {date.today():%Y-%m-%d}", className="paper note"),
        html.P(id="headline", className="paper headline"),
    ]
    if remarks:
        heading.append(_folded(remarks))
    stores = [dcc.Store(name) for name in ("asked", "touched", "simulated-design")]
    return html.Div([*heading, desk, *stores])


def _folded(lines: Sequence[str]) -> html.Details:
    """Show the first of some lines; the others open below it."""
    first, *others = lines
    return html.Details([html.Summary(first), *map(html.P, others)], className="note")


def _fields(config: Setup, fields: Sequence[PageField]) -> html.Aside:
    """Lay out the fields by group."""
    scopes = {
        "all": f"all {len(config.points)} operating points of the study",
        "one": "one operating point",
    }
    hints = field_hints(fields)
    extras: dict[str, tuple[Children, Children]] = {
        "point": ([dcc.RadioItems(scopes, "all", id="where")], []),
        "shift": ([], [html.P(id="shift-link")]),
    }
    groups = []
    for group, title in GROUPS.items():
        rows = [_field_row(field, hints[field.key]) for field in fields if field.group == group]
        before, after = extras.get(group, ([], []))
        content = [html.Summary(html.H2(title)), *before, *rows, *after]
        groups.append(html.Details(content, open=group in OPEN_GROUPS))
    hint = "An empty field has the grey value. Units as in a data sheet: 1.2 kN, 5,5 mm."
    return html.Aside(
        [html.Button("reset to the study", id="back"), html.P(hint, className="note"), *groups]
    )


def _answer(front: Figure | None) -> html.Main:
    """Lay out cards, section, comparison, checks, front, files and command; callbacks fill them."""
    cards = [
        html.Div(id="predicted", className="card chosen"),
        html.Div(
            [html.Div(id="simulated"), html.Button("simulate", id="simulate", hidden=True)],
            className="card gain",
        ),
        html.Div(id="margins", className="card"),
    ]
    check_note = (
        "Margin: distance to the limit over the limit. A check shows its formula, source and key "
        "where the mouse points at it."
    )
    quiet: Any = {"displayModeBar": False}
    search = html.Div(
        [
            html.H2("Designs of the search"),
            html.P("A click takes a design over into the fields.", className="note"),
            dcc.Graph("front", figure=front or {}, config=quiet),
        ],
        hidden=front is None,
        className="screen",
    )
    curve = html.Div(
        [
            html.H2("Time over the slider"),
            html.Div(dcc.Graph("curve", config=quiet), id="curve-box", hidden=True),
            html.P(id="curve-note", className="note"),
        ],
        className="curve",
    )
    files = html.Div(
        [
            html.H2("Files of this design"),
            html.P(["reason of a decision, for the data sheet ", dcc.Input("", id="why")]),
            html.P(id="files"),
        ],
        className="screen",
    )
    return html.Main(
        [
            html.P(id="refused", className="bad"),
            html.Div(cards, className="cards"),
            html.P(id="verdict"),
            html.Div(id="cautions"),
            html.Img(id="section", alt="Section of both rings, unrolled at the mean radius"),
            html.Div([html.Div(id="beside"), curve], className="beside"),
            html.H2("Checks"),
            html.Div(id="checks", className="scroll"),
            html.P(check_note, className="note"),
            search,
            files,
            html.H2("The same from the command line"),
            html.Code(id="command"),
        ],
        id="answer",
    )


def card(title: str, value: str, *lines: str, exact: Expected | None = None) -> Children:
    """Fill a card with title, value and lines; ``exact`` is stored unrounded for programs."""
    spans = [html.Span(line) for line in lines if line]
    return [html.Span(title), html.B(value, **_exact(exact)), *spans]


def _exact(expected: Expected | None) -> dict[str, Any]:
    """Store a time with its interval unrounded for programs."""
    if expected is None:
        return {}
    return {"data-exact": f"{expected.time!r} {expected.low!r} {expected.high!r}"}


def _interval_text(expected: Expected) -> str:
    return f"95 %: {time_text(expected.low)} to {time_text(expected.high)}"


def predicted_time(check: Checked) -> Expected | None:
    """Return the surrogate's time; None without one."""
    if not isinstance(check, Check) or check.guess is None:
        return None
    return check.guess.answer.expected


def predicted_card(check: Checked, reason: str) -> Children:
    """Show the surrogate's time with its interval, or the ``reason`` why there is none."""
    expected = predicted_time(check)
    if expected is not None and isinstance(check, Check) and check.guess is not None:
        distance = f"nearest simulated design: {check.guess.answer.distance:.1f} median spacings"
        time = time_text(expected.time)
        return card(PREDICTED, time, _interval_text(expected), distance, exact=expected)
    if isinstance(check, Check) and check.guess is not None:
        reason = check.guess.answer.refusal
    return card(PREDICTED, "none", reason)


def simulated_card(check: Check) -> Children:
    """Show the simulated time with its error and its difference to the prediction."""
    simulated = check.expected
    if simulated is None:
        return card(SIMULATED, "none", check.refusal)
    difference = ""
    predicted = predicted_time(check)
    if predicted is not None:
        direction = "more" if simulated.time > predicted.time else "less"
        amount = time_text(abs(simulated.time - predicted.time))
        difference = f"{amount} {direction} than predicted"
        if check.missed:
            difference += ", beyond both intervals"
    time = time_text(simulated.time, simulated.error)
    shifts = f"{check.shifts} shifts, compiled engine"
    return card(SIMULATED, time, _interval_text(simulated), difference, shifts, exact=simulated)


def verdict_content(check: Checked) -> dict[str, Any]:
    """Compose smallest margin and verdict with its decisive assumptions, by place of the page."""
    weakest = smallest_margin(check.design.checks)
    verdict = check.verdict
    lines = (
        check_name(weakest.name),
        f"at statistical tolerances: {check.statistical.replace('_', ' ')}",
        f"at worst-case tolerances: {check.worst_case.replace('_', ' ')}",
    )
    look = {"passes": "good", "fails": "bad"}.get(verdict.state, "open")
    sentence = verdict.line
    hinges = hinge_lines(verdict)[:SHOWN_HINGES] if verdict.flipping else []
    if hinges:
        keys = [line.partition(" [")[0].removeprefix("the verdict hangs on ") for line in hinges]
        sentence += f". The verdict hangs on {', '.join(keys)}"
    return {
        "margins.children": card(MARGIN, percent(weakest.margin), *lines),
        "margins.className": f"card {look}",
        "verdict.children": f"{sentence[0].upper()}{sentence[1:]}.",
    }


def no_answers() -> dict[str, Any]:
    """Compose a page without figures, which would be those of another design."""
    return {
        "predicted.children": card(PREDICTED, NO_VALUE),
        "simulated.children": card(SIMULATED, NO_VALUE),
        "margins.children": card(MARGIN, NO_VALUE),
        "margins.className": "card",
        "simulate.hidden": True,
        "verdict.children": "",
        "headline.children": "",
        "cautions.children": [],
        "beside.children": [],
        "curve-box.hidden": True,
        "curve-note.children": "",
    }


def cautions(check: Checked) -> Children:
    """Fold the warnings of the study and of the surrogate's prediction into a line."""
    warnings = list(check.notes)
    if isinstance(check, Check) and check.guess is not None:
        warnings += check.guess.answer.warnings
        validation = check.guess.validation
        if not validation.useful:
            warnings.append(f"the surrogate has Q² {validation.q2:.2f} on designs outside its fit")
    if not warnings:
        return []
    first, *others = [f"{warning}." for warning in warnings]
    count = f"{len(warnings)} cautions, the first: " if others else "Caution: "
    return [_folded([count + first, *others])]


@dataclass(frozen=True)
class Side:
    """A design of the comparison: its values by key, and its answers so far."""

    values: Mapping[str, Any]
    predicted: Checked
    simulated: Check | None

    @property
    def check(self) -> Checked:
        """The answer with the most checks."""
        return self.predicted if self.simulated is None else self.simulated

    @property
    def predicted_text(self) -> str:
        """Predicted time in words."""
        expected = predicted_time(self.predicted)
        return "none" if expected is None else time_text(expected.time)

    @property
    def simulated_text(self) -> str:
        """Simulated time in words."""
        if self.simulated is None:
            return NO_VALUE
        expected = self.simulated.expected
        return "none" if expected is None else time_text(expected.time, expected.error)

    @property
    def headline(self) -> str:
        """Shift time and verdict in a sentence."""
        time = f"{self.simulated_text} simulated"
        if self.simulated is None:
            time = f"{self.predicted_text} predicted"
        if time.startswith("none"):
            time = "not simulated"
        return f"Shift time {time}; {state_words(self.check)}"


def state_words(check: Checked) -> str:
    """Format the state of a verdict as words."""
    return {"not_judged": "not all checks judged"}.get(
        check.verdict.state, check.verdict.state.replace("_", " ")
    )


def beside_table(fields: Sequence[PageField], design: Side, own: Side | None) -> Children:
    """Tabulate values, times and margins of own dog and design.

    ``own`` is None where the design is the own dog, or where there is no such clutch.
    """
    is_own = all(design.values[field.key] == field.default for field in _dog_dimensions(fields))
    sides = {"own dog" if is_own else "this design": design}
    if own is not None:
        sides = {"own dog": own, **sides}
    body = []
    for field in _dog_dimensions(fields):
        values = [side.values[field.key] for side in sides.values()]
        name = f"{field.label}, {field.unit}".removesuffix(", ")
        look = "changed" if values[0] != values[-1] else ""
        cells = [html.Td(minus(f"{value:.5g}")) for value in values]
        body.append(html.Tr([html.Td(name), *cells], className=look))
    body += [_side_row(name, sides, cells) for name, cells in _answer_rows(sides)]
    head = html.Tr([html.Th(), *(html.Th(name) for name in sides)])
    table = html.Table([html.Thead(head), html.Tbody(body)])
    note = "Own dog: that of the study, under the load, operation and actuator of this page"
    note += "." if is_own or own is not None else ", with which there is no such clutch."
    changes = _other_changes(fields, design)
    if changes:
        note += f" Set on this page for both: {', '.join(changes)}."
    title = "Own dog" if is_own else "Beside the own dog"
    return [html.H2(title), table, html.P(note, className="note")]


def _dog_dimensions(fields: Sequence[PageField]) -> list[PageField]:
    """Select the dimensions of the dog."""
    return [field for field in fields if field.group == "dog"]


def _other_changes(fields: Sequence[PageField], design: Side) -> list[str]:
    """List values that differ from the study's beside the dog, with those of the study."""
    changes = []
    for field in fields:
        value = design.values.get(field.key, field.default)
        if field.group not in ("dog", "shift") and value != field.default:
            words = [field.label, shown_value(value), field.unit]
            study_value = placeholder(field.default)
            changes.append(f"{' '.join(filter(None, words))} (study: {study_value})")
    return changes


def _answer_rows(sides: Mapping[str, Side]) -> Iterator[tuple[str, list[Any]]]:
    """Yield the title of each answer and the cells of the sides."""
    yield "predicted time", [side.predicted_text for side in sides.values()]
    yield "simulated time", [side.simulated_text for side in sides.values()]
    margins = []
    for side in sides.values():
        weakest = smallest_margin(side.check.design.checks)
        margins.append(f"{percent(weakest.margin)}, {check_name(weakest.name)}")
    yield MARGIN, margins
    yield "verdict", [state_words(side.check) for side in sides.values()]


def _side_row(name: str, sides: Mapping[str, Side], cells: Sequence[str]) -> html.Tr:
    """Lay out an answer of all sides; times are stored unrounded for programs."""
    columns = []
    for side, cell in zip(sides.values(), cells, strict=True):
        expected = None
        if name == "predicted time":
            expected = predicted_time(side.predicted)
        elif name == "simulated time" and side.simulated is not None:
            expected = side.simulated.expected
        columns.append(html.Td(cell, **_exact(expected)))
    return html.Tr([html.Td(name), *columns], className="answer")


def curve_content(
    field: PageField, curve: TimeCurve | str, design: Side, own: Side | None
) -> dict[str, Any]:
    """Draw the time over a slider, or say why not, as content of the page by place."""
    if isinstance(curve, str):
        return {"curve-box.hidden": True, "curve-note.children": f"{field.label}: {curve}."}
    marks = {}
    sides = {"this design": design} if own is None else {"own dog": own, "this design": design}
    for name, side in sides.items():
        expected = predicted_time(side.predicted)
        if expected is not None:
            marks[name] = (side.values[field.key], expected.time)
    figure = slider_figure(
        axis(field.name),
        curve.values.tolist(),
        curve.times.tolist(),
        low=curve.low.tolist(),
        high=curve.high.tolist(),
        feasible=curve.feasible.tolist(),
        marks=marks,
    )
    return {"curve.figure": figure, "curve-box.hidden": False, "curve-note.children": ""}


def check_table(check: Checked, own: Checked | None) -> html.Table:
    """Tabulate all checks as the command line does, with formula, source and key as a hint.

    The last column has the margins of the ``own`` dog.
    """
    rows_by_name = {row.name: row for row in check.judged_rows}
    own_rows = {} if own is None else {row.name: row for row in own.judged_rows}
    table = record_table(list(rows_by_name.values()))
    heads = [*table.heads, *(["own dog's margin"] if own_rows else [])]
    body = []
    for cells in table.rows:
        row = rows_by_name.get(cells[0])
        if row is None:
            group = html.Td(cells[0], colSpan=len(heads))
            body.append(html.Tr(group, className="group"))
        elif own_rows:
            own_row = own_rows.get(row.name)
            own_cell = NO_VALUE if own_row is None else own_row.cell("margin")
            body.append(_check_line(row, [*cells, own_cell], table.words))
        else:
            body.append(_check_line(row, cells, table.words))
    head = html.Tr(
        [html.Th(text, className=_text_look(k in table.words)) for k, text in enumerate(heads)]
    )
    return html.Table([html.Thead(head), html.Tbody(body)])


def _text_look(is_text: bool, is_bad: bool = False) -> str:
    """Return the look of a cell: of text that wraps, or of one that speaks against a design."""
    return " ".join(["words"] * is_text + ["bad"] * is_bad)


def _check_line(row: CheckRow, cells: Sequence[str], text_columns: Sequence[int]) -> html.Tr:
    """Lay out a check; its margin is stored unrounded for programs."""
    attributes: dict[str, Any] = {}
    if row.passed is not None:
        attributes = {"data-check": row.name, "data-margin": repr(row.margin)}
    hint = f"{row.meaning}\n{row.formula}\n{row.source}\nkey: {row.limit_key}"
    texts = [check_name(row.name), *cells[1:]]
    columns = [
        html.Td(text, className=_text_look(k in text_columns, isinstance(text, Bad)))
        for k, text in enumerate(texts)
    ]
    look = "failed" if row.passed is False and not row.unclear else ""
    return html.Tr(columns, title=hint, className=look, **attributes)
