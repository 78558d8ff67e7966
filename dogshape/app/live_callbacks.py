"""Live page of a study in the browser: its application, callbacks and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote, urlencode

from dash import ALL, MATCH, Dash, Input, Output, State, ctx, html, no_update
from dash.exceptions import PreventUpdate
from flask import Response, request

from dogshape.app import live_content
from dogshape.app.live_content import Side
from dogshape.app.live_page import FILES, LiveDesign, LivePage, Question
from dogshape.app.page import Answer, Json, new_page
from dogshape.pipeline.drafts.questionnaire import Answers
from dogshape.pipeline.export.drawing import open_section_svg
from dogshape.pipeline.reports.charts import front_figure
from dogshape.sim.errors import DogshapeError

#: Places of the page that a simulation of the own dog changes, of the design, and each field.
OWN_PLACES = ("beside.children", "checks.children")
SIMULATED_PLACES = (
    *OWN_PLACES,
    "headline.children",
    "simulated.children",
    "simulate.hidden",
    "margins.children",
    "margins.className",
    "verdict.children",
    "simulated-design.data",
)
PLACES = (
    *SIMULATED_PLACES,
    "answer.className",
    "refused.children",
    "predicted.children",
    "cautions.children",
    "section.src",
    "curve.figure",
    "curve-box.hidden",
    "curve-note.children",
)
LINK_PLACES = ("files.children", "shift-link.children", "command.children")
BEYOND_NOTE = "the time must be simulated; the checks hold without it"
FIELDS = ("field", "text")  #: kinds of fields, with a slider and without


def build_app(live_page: LivePage) -> Dash:
    """Build the application of a live page with its callbacks and files."""
    config = live_page.study.config
    app = new_page(f"{config.name}: live")
    front = (
        None if live_page.result is None else front_figure(live_page.result, list(config.variables))
    )

    def layout() -> html.Div:
        return live_content.layout(config, live_page.fields, front, live_page.remarks)

    app.layout = layout
    _connect_fields(app, live_page)
    _connect_answers(app, live_page)

    def write_file(name: str) -> Response:
        if name not in FILES:
            return Response("no such file", 404)
        with TemporaryDirectory() as folder:
            path = Path(folder) / name
            try:
                live_page.write(name, request.args, request.args.get("why", ""), path)
            except DogshapeError as error:
                return Response(str(error), 400, mimetype="text/plain")
            return Response(path.read_bytes(), mimetype=FILES[name][0])

    app.server.add_url_rule("/file/<name>", view_func=write_file)
    return app


def _connect_fields(app: Dash, live_page: LivePage) -> None:
    """Synchronise fields with sliders, and copy selected designs into the fields."""
    field = {"number": MATCH, "kind": "field"}
    slider = {"number": MATCH, "kind": "slider"}

    @app.callback(
        Output(field, "value"),
        Output(slider, "value"),
        Input(field, "value"),
        Input(slider, "value"),
        prevent_initial_call=True,
    )
    def move_together(text: str, place: float) -> tuple[Any, Any]:
        if ctx.triggered_id["kind"] == "slider":
            return f"{place:.6g}", no_update
        number = live_page.number_of(ctx.triggered_id["number"], text or "")
        return no_update, no_update if number is None else number

    @app.callback(
        *(Output({"number": ALL, "kind": kind}, "value", allow_duplicate=True) for kind in FIELDS),
        Input("front", "clickData"),
        Input("back", "n_clicks"),
        prevent_initial_call=True,
    )
    def take_design(click: Json | None, _: int) -> list[list[Any]]:
        texts = live_page.start_texts()
        if ctx.triggered_id == "front":
            marker = click["points"][0] if click else {}
            texts = live_page.shape(str(marker.get("customdata")))
        return [
            [texts.get(_key_of(output, "number"), no_update) for output in outputs]
            for outputs in ctx.outputs_list
        ]


def _outputs(places: Sequence[str], *, again: bool = False) -> list[Output]:
    """Declare places of the page as outputs; ``again`` if an earlier callback has them too.

    Outputs, as Dash leaves out those of an answer that a later one has overtaken.
    """
    parts = [place.partition(".") for place in places]
    return [Output(name, part, allow_duplicate=again) for name, _, part in parts]


def _contents(places: Sequence[str], answer: Answer) -> list[Any]:
    """List the contents of places; those without one stay."""
    return [answer.get(place, no_update) for place in places]


def _connect_answers(app: Dash, live_page: LivePage) -> None:
    """Predict at each change of a field, then simulate and link files."""
    fields = {field.key: field for field in live_page.fields}

    @app.callback(
        *_outputs(("asked.data", "touched.data", *PLACES)),
        Output({"row": ALL}, "className"),
        Output({"fault": ALL}, "children"),
        *(Output({"number": ALL, "kind": kind}, "placeholder") for kind in FIELDS),
        *(Input({"number": ALL, "kind": kind}, "value") for kind in FIELDS),
        Input("where", "value"),
        State("asked", "data"),
        State("touched", "data"),
    )
    def predict(_: Any, __: Any, where: str, asked: Json | None, touched: str | None) -> list[Any]:
        question = Question(_texts_of(ctx.inputs_list[:2]), where)
        if question._asdict() == asked:
            raise PreventUpdate
        touched = _touched_key(live_page, ctx.triggered_id, touched)
        answers, answer = answer_at_once(live_page, question, touched)
        *_, rows, faults, texts_beside_sliders, texts = ctx.outputs_list
        is_answered = not answer["answer.className"]
        return [
            question._asdict() if is_answered else None,
            touched,
            *_contents(PLACES, answer),
            [_row_look(fields[_key_of(row, "row")], answers) for row in rows],
            [answers.faults.get(_key_of(fault, "fault"), "") for fault in faults],
            *(
                [_placeholder(fields[_key_of(text, "number")], answers) for text in group]
                for group in (texts_beside_sliders, texts)
            ),
        ]

    @app.callback(
        *_outputs(SIMULATED_PLACES, again=True),
        Input("asked", "data"),
        Input("simulate", "n_clicks"),
        running=[(Output("simulate", "children"), "simulating …", "simulate")],
        prevent_initial_call=True,
    )
    def simulate(question: Json | None, _: int) -> list[Any]:
        if not question:
            return _contents(SIMULATED_PLACES, {})
        asked = Question(**question)
        is_wanted = ctx.triggered_id == "simulate"
        return _contents(SIMULATED_PLACES, answer_by_simulation(live_page, asked, is_wanted))

    @app.callback(
        *_outputs(OWN_PLACES, again=True),
        Input("simulated-design", "data"),
        prevent_initial_call=True,
    )
    def simulate_own_dog(question: Json | None) -> list[Any]:
        if not question:
            return _contents(OWN_PLACES, {})
        return _contents(OWN_PLACES, answer_on_own_dog(live_page, Question(**question)))

    @app.callback(
        *_outputs(LINK_PLACES),
        Input("asked", "data"),
        Input("why", "value"),
        prevent_initial_call=True,
    )
    def link(question: Json | None, reason: str | None) -> list[Any]:
        if not question:
            return _contents(LINK_PLACES, {})
        return _contents(LINK_PLACES, link_files(live_page, Question(**question), reason))


def _texts_of(groups: Sequence[Sequence[Json]]) -> dict[str, str]:
    """Return the texts of fields by key."""
    return {
        _key_of(field, "number"): str(field.get("value") or "")
        for group in groups
        for field in group
    }


def _key_of(part: Json, role: str) -> str:
    """Return the question of a component; ``role`` is a field of its id, such as ``row``."""
    return str(part["id"][role])


def _touched_key(live_page: LivePage, triggered: Any, touched: str | None) -> str:
    """Return the key of the slider that was moved last, at the start the first."""
    sliders = [field.key for field in live_page.fields if field.ends is not None]
    key = triggered["number"] if isinstance(triggered, Mapping) else None
    return key if key in sliders else touched or sliders[0]


def _row_look(field: Any, answers: Answers) -> str:
    fault = answers.faults.get(field.key, "")
    return live_content.field_look(field, fault, is_used=field.key in answers.defaults)


def _placeholder(field: Any, answers: Answers) -> str:
    return live_content.placeholder(answers.defaults.get(field.key))


def answer_at_once(live_page: LivePage, question: Question, touched: str) -> tuple[Answers, Answer]:
    """Predict a design without simulation, with its time over the slider of the key ``touched``.

    Returns the answers of the fields, and the content of the page; after a refusal it has no
    figures.
    """
    answers = live_page.read(question)
    design = live_page.design(answers, question.where)
    try:
        if design is not None:
            return answers, _predicted_content(live_page, question, design, touched)
        refusal = answers.refusal and f"There is no such clutch: {answers.refusal}"
    except DogshapeError as error:
        refusal = str(error)
    if answers.faults:
        labels = [field.label for field in live_page.fields if field.key in answers.faults]
        refusal = f"Wrong: {', '.join(labels)}."
    return answers, {
        "answer.className": "stale",
        "refused.children": refusal,
        "simulated-design.data": None,
        **live_content.no_answers(),
    }


def _predicted_content(
    live_page: LivePage, question: Question, design: LiveDesign, touched: str
) -> Answer:
    """Compose the content of the page for a design before its simulation."""
    config = design.study.config
    svg = open_section_svg(
        config.clutch.pair,
        live_page.study.config.clutch.pair,
        "own dog",
        is_sleeve=config.limits.sleeve is not None,
    )
    side, own = _sides(live_page, design, _own_design(live_page, question, design))
    reason = live_page.prediction_refusal(design.study)
    is_beyond = live_page.is_beyond_surrogate(design.study)
    if is_beyond:
        reason = f"{reason}; {BEYOND_NOTE}"
    field = next(field for field in live_page.fields if field.key == touched)
    curve = live_page.time_curve(design, touched)
    return {
        "answer.className": "",
        "refused.children": "",
        "predicted.children": live_content.predicted_card(side.predicted, reason),
        "cautions.children": live_content.cautions(side.predicted),
        "section.src": f"data:image/svg+xml,{quote(svg)}",
        **live_content.curve_content(field, curve, side, own),
        **_compared_content(live_page, side, own),
        **_simulated_content(side, is_beyond=is_beyond),
        "simulated-design.data": None,
    }


def _sides(
    live_page: LivePage, design: LiveDesign, own_design: LiveDesign | None
) -> tuple[Side, Side | None]:
    """List the answers so far on a design and on the own dog, None without one."""
    side = _side(live_page, design)
    if own_design is None:
        return side, None
    try:
        return side, _side(live_page, own_design)
    except DogshapeError:
        return side, None


def _own_design(live_page: LivePage, question: Question, design: LiveDesign) -> LiveDesign | None:
    """Build the own dog under load and operation of the page.

    None if it is the dog of ``design``, or if there is no such clutch.
    """
    own_answers = live_page.read(live_page.own_question(question))
    own_design = live_page.design(own_answers, question.where)
    if own_design is None or own_design.key == design.key:
        return None
    return own_design


def _side(live_page: LivePage, design: LiveDesign) -> Side:
    return Side(design.values, live_page.predict(design), live_page.simulated(design))


def _compared_content(live_page: LivePage, side: Side, own: Side | None) -> Answer:
    """Compose verdict and comparison of a design with the own dog."""
    return {
        "headline.children": side.headline,
        "beside.children": live_content.beside_table(live_page.fields, side, own),
        "checks.children": live_content.check_table(side.check, None if own is None else own.check),
        **live_content.verdict_content(side.check),
    }


def _simulated_content(side: Side, *, is_beyond: bool) -> Answer:
    """Compose the card of the simulated time, with its button where none follows by itself."""
    if side.simulated is not None:
        card = live_content.simulated_card(side.simulated)
    else:
        card = live_content.card(
            live_content.SIMULATED, "not simulated" if is_beyond else live_content.RUNNING
        )
    return {
        "simulated.children": card,
        "simulate.hidden": not is_beyond or side.simulated is not None,
    }


def answer_by_simulation(live_page: LivePage, question: Question, is_wanted: bool) -> Answer:
    """Simulate a design; return the page's content for its time and checks, with landing.

    Beyond the surrogate nothing is simulated unless it ``is_wanted``.
    """
    design = live_page.design(live_page.read(question), question.where)
    if design is None:
        return {}
    is_beyond = live_page.is_beyond_surrogate(design.study)
    if is_beyond and not is_wanted and live_page.simulated(design) is None:
        return {}
    try:
        live_page.simulate(design)
        side, own = _sides(live_page, design, _own_design(live_page, question, design))
    except DogshapeError as error:
        card = live_content.card(live_content.SIMULATED, "none", str(error))
        return {"simulated.children": card}
    return {
        **_compared_content(live_page, side, own),
        **_simulated_content(side, is_beyond=is_beyond),
        "simulated-design.data": question._asdict(),
    }


def answer_on_own_dog(live_page: LivePage, question: Question) -> Answer:
    """Simulate the own dog beside a simulated design; return the content of the comparison."""
    design = live_page.design(live_page.read(question), question.where)
    if design is None:
        return {}
    own_design = _own_design(live_page, question, design)
    if own_design is None:
        return {}
    try:
        live_page.simulate(own_design)
        side, own = _sides(live_page, design, own_design)
    except DogshapeError:
        return {}
    return _compared_content(live_page, side, own)


def link_files(live_page: LivePage, question: Question, reason: str | None) -> Answer:
    """Link the files of a design, and compose the command that checks it."""
    query = urlencode({**question.texts, "where": question.where, "why": reason or ""})
    links = []
    for name, (_, label) in FILES.items():
        address = f"/file/{name}?{query}"
        if name == "study.toml":
            links.append(html.A(label, href=address, download=f"{live_page.study.name}.toml"))
        else:
            links.append(html.A(label, href=address, target="_blank"))
    *files, shift = links
    words = ["dogshape", "check"]
    command = " ".join([*words, live_page.command, *live_page.check_words(question)])
    return {"files.children": files, "shift-link.children": [shift], "command.children": command}
