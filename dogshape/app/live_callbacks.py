"""Live page of a study in the browser: its application, callbacks and files."""

from __future__ import annotations

import shlex
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote, urlencode

from dash import ALL, MATCH, Dash, Input, Output, State, ctx, html, no_update, set_props
from dash.exceptions import PreventUpdate
from flask import Response, request

from dogshape.app import live_content
from dogshape.app.live_page import FILES, LivePage, Question, point_of
from dogshape.app.page import Answer, Json, new_page
from dogshape.bench.texts import is_plain
from dogshape.pipeline.export.drawing import open_section_svg
from dogshape.pipeline.reports.charts import front_figure
from dogshape.sim.errors import DogshapeError


def build_app(live_page: LivePage) -> Dash:
    """Build the application of a live page with its callbacks and files."""
    config = live_page.study.config
    app = new_page(f"{config.name}: live")
    front = (
        None if live_page.result is None else front_figure(live_page.result, list(config.variables))
    )
    app.layout = live_content.layout(config, live_page.numbers, front, live_page.remarks)
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
        return no_update, float(text) if is_plain(text) else no_update

    @app.callback(
        Output({"number": ALL, "kind": "field"}, "value", allow_duplicate=True),
        Input("front", "clickData"),
        Input("back", "n_clicks"),
        prevent_initial_call=True,
    )
    def take_design(click: Json | None, _: int) -> list[Any]:
        marker = click["points"][0] if click and ctx.triggered_id == "front" else {}
        shape = live_page.shape(str(marker.get("customdata")))
        return [shape.get(output["id"]["number"], no_update) for output in ctx.outputs_list]


def _connect_answers(app: Dash, live_page: LivePage) -> None:
    """Predict at each change of a field, then simulate and link files."""

    @app.callback(
        Output("asked", "data"),
        Input({"number": ALL, "kind": "field"}, "value"),
        Input("where", "value"),
        State("asked", "data"),
    )
    def predict(_: Any, where: str, previous: Json | None) -> Json | None:
        fields = ctx.inputs_list[0]
        texts = {field["id"]["number"]: str(field.get("value") or "") for field in fields}
        question = Question(texts, where)
        if question._asdict() == previous:
            raise PreventUpdate
        faults, answer = answer_at_once(live_page, question)
        for key, message in faults.items():
            set_props({"fault": key}, {"children": message})
        _show(answer)
        return None if answer["answer.className"] else question._asdict()

    @app.callback(Input("asked", "data"), prevent_initial_call=True)
    def simulate(question: Json | None) -> None:
        if question:
            _show(answer_by_simulation(live_page, Question(**question)))

    @app.callback(Input("asked", "data"), Input("why", "value"), prevent_initial_call=True)
    def link(question: Json | None, reason: str | None) -> None:
        if question:
            _show(link_files(live_page, Question(**question), reason))


def _show(answer: Answer) -> None:
    for place, content in answer.items():
        name, _, part = place.partition(".")
        set_props(name, {part: content})


def answer_at_once(live_page: LivePage, question: Question) -> tuple[dict[str, str], Answer]:
    """Predict a design without simulation.

    Returns the error messages by the keys of the fields, and the content of the page; after a
    refusal the content only marks the page as stale.
    """
    texts = question.texts
    try:
        check = live_page.predict(texts, question.where)
        study = live_page.modify_study(texts)
    except DogshapeError as error:
        message = str(error).removeprefix(f"the study {live_page.study.name}: ")
        faults = {key: message if key in message else "" for key in texts}
        refusal = "" if any(faults.values()) else f"There is no such dog: {message}"
        return faults, {"answer.className": "stale", "refused.children": refusal}
    svg = open_section_svg(
        study.config.clutch.pair,
        live_page.study.config.clutch.pair,
        is_sleeve=study.config.limits.sleeve is not None,
    )
    return dict.fromkeys(texts, ""), {
        "answer.className": "",
        "refused.children": "",
        "predicted.children": live_content.predicted_card(
            check, live_page.prediction_refusal(study)
        ),
        **live_content.verdict_content(check),
        "section.src": f"data:image/svg+xml,{quote(svg)}",
        "cautions.children": live_content.cautions(check),
        "simulated.children": live_content.card("simulated shift time", "…"),
    }


def answer_by_simulation(live_page: LivePage, question: Question) -> Answer:
    """Simulate a design; return the page's content for its time and checks, with landing."""
    try:
        check = live_page.modify_study(question.texts).check(**point_of(*question))
    except DogshapeError as error:
        return {"simulated.children": live_content.card("simulated shift time", "none", str(error))}
    return {
        "simulated.children": live_content.simulated_card(check),
        **live_content.verdict_content(check),
    }


def link_files(live_page: LivePage, question: Question, reason: str | None) -> Answer:
    """Link the files of a design, and compose the command that checks it."""
    texts = question.texts
    query = urlencode({**texts, "why": reason or ""})
    links = [
        html.A(label, href=f"/file/{name}?{query}", target="_blank")
        for name, (_, label) in FILES.items()
    ]
    *files, shift = links
    command = f"dogshape check {live_page.command}"
    for change in live_page.changes(texts):
        command += f" --set {shlex.quote(change)}"
    for key, value in point_of(*question).items():
        command += f" --{key.replace('_', '-')} {value:.12g}"
    return {"files.children": files, "shift-link.children": [shift], "command.children": command}
