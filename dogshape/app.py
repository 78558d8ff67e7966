"""The live page of a study: a server on this machine alone, whose page asks the verbs of ``Study``.

A number of the page is a key of the study file with its text. Texts that differ from those at the
start become settings, as ``--set`` takes them; ``Study.check`` answers by a named surrogate at once
and by the compiled engine in seconds. Nothing is computed here.
"""

from __future__ import annotations

import logging
import shlex
import socket
import webbrowser
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from os import strerror
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote, urlencode

from dash import ALL, MATCH, Dash, Input, Output, State, ctx, html, no_update, set_props
from dash.exceptions import PreventUpdate
from flask import Response, request
from werkzeug.serving import BaseWSGIServer, make_server

from dogshape import app_page as page
from dogshape.app_page import Number
from dogshape.check import Checked
from dogshape.pipeline.config.study_file import settings_of
from dogshape.pipeline.export.cad import write_step
from dogshape.pipeline.export.drawing import dimensioned_svg, open_section_svg
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.reports.charts import front_figure
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.text import PLACE
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.train.training_rows import matching_surrogate
from dogshape.running import receiver
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.texts import is_plain
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root
from dogshape.study import Study
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import Stored

HOST = "127.0.0.1"
BODY = 3.0 * MM  #: thickness of a ring below the slots in a STEP file, as ``export`` has it
ANGLE = "angle_deg"
FRICTION = {
    "contact.static_friction": ("in the shift, static", 0.6),
    "contact.dynamic_friction": ("in the shift, sliding", 0.6),
    "load.friction_release": ("release, highest", 0.6),
    "load.friction_hold": ("holding, lowest", 0.3),
}  #: label and upper end of a slider by key
#: Type of each file with the words of its link; that of the single shift is the last.
FILES = {
    "sheet.html": ("text/html", "data sheet"),
    "dog.svg": ("image/svg+xml", "dimensioned drawing (SVG)"),
    "rings.step": ("application/step", "both rings (STEP)"),
    "shift.html": ("text/html", "animate this shift"),
}
TEMPLATES = resources.files("dogshape.pipeline.reports") / "templates"  #: with the look of pages
Texts = Mapping[str, str]  #: what stands in the fields, by key
Answer = dict[str, Any]  #: content of the page by place, ``component.property``


@dataclass(frozen=True, eq=False)
class Desk:
    """A study with what its page asks about; ``where`` is ``one`` operating point, or ``all``.

    ``command`` has study and ``--set`` as the command line has them, ``surrogate`` predicts at
    once, from its file, ``result`` is the content of ``result.json``; None where there is none of
    the study's physics.
    """

    study: Study
    command: str
    stored: Stored | None = None
    surrogate: Path | None = None
    result: Row | None = None

    @cached_property
    def numbers(self) -> list[Number]:
        """All numbers of the page with what stands in them at the start."""
        config = self.study.config
        points = [(point.mismatch / RPM, point.profile.force) for point in config.points]
        given = config.file.dog.model_dump() | {k: config.prototype[k] for k in config.shape_keys}
        dog = {key: value for key, value in given.items() if value is not None}
        ranges = {key: config.variables.get(key, (value, value)) for key, value in dog.items()}
        order = sorted(dog, key=[*config.variables, *dog].index)
        middle, ends = sorted(points)[len(points) // 2], zip(*points, strict=True)
        friction = {f"contact.{k}": v for k, v in vars(config.file.contact.value).items()}
        friction |= {f"load.{k}": v for k, v in config.file.load}
        turn = round(360.0 / config.clutch.dog.count, 2)
        return [
            *(Number(f"dog.{key}", "dog", dog[key], ranges[key]) for key in order),
            *(Number(key, "point", value, (min(every), max(every)))
              for key, value, every in zip(PLACE, middle, ends, strict=True)),
            *(Number(key, "friction", friction[key], (0.0, end), words)
              for key, (words, end) in FRICTION.items()),
            Number(ANGLE, "shift", 0.4 * turn, (0.0, turn), "relative angle"),
        ]  # fmt: skip

    @cached_property
    def searched(self) -> dict[str, Row]:
        """Designs that the search simulated, by number."""
        rows = [] if self.result is None else self.result["trials"]
        return {str(row["trial"]): row for row in rows if row[SIMULATED] is not None}

    def shape(self, trial: str = "") -> dict[str, str]:
        """Give the texts of the dog's numbers for a design of the search, or the study's own."""
        own = {n.key: n.text for n in self.numbers if n.group == "dog"}
        design = self.searched.get(trial, {})
        keys = [key for key in self.study.config.variables if key in design]
        return own | {f"dog.{key}": f"{design[key]:.6g}" for key in keys}

    def changes(self, texts: Texts) -> list[str]:
        """Write ``KEY=VALUE`` for each key of the study whose text differs from its own."""
        own = {one.key: one.text for one in self.numbers if "." in one.key}
        return [f"{key}={texts[key] or repr('')}" for key in own if texts[key] != own[key]]

    def changed(self, texts: Texts) -> Study:
        """Give the study with the numbers of the page."""
        return self.study.replace_keys(settings_of(self.changes(texts)))

    def unpredicted(self, study: Study) -> str:
        """Explain why the surrogate does not apply to a study; empty where it does."""
        if self.stored is None:
            return "there is no surrogate of the study; 'dogshape fit' makes one"
        apart = compare_physics(self.stored.surrogate.data, study.config.physics)
        return apart and f"the surrogate is of other physics: {apart}"

    def predict(self, texts: Texts, where: str) -> Checked:
        """Check a design at once: by the surrogate, or by closed forms alone without one."""
        study = self.changed(texts)
        if self.unpredicted(study):
            return study.strength(simulate=False)
        return study.check(**_point(texts, where), surrogate=self.surrogate)

    def write(self, name: str, texts: Texts, why: str, path: Path) -> None:
        """Write a file of ``FILES``: single shift, data sheet, drawing or solids."""
        study = self.changed(texts)
        dog, limits = study.config.clutch.dog, study.config.limits
        if name == "shift.html":
            study.shift(**_point(texts, "one"), angle_deg=_number(ANGLE, texts)).report(path)
        elif name == "sheet.html":
            study.data_sheet(path, why)
        elif name == "dog.svg":
            path.write_text(dimensioned_svg(dog, limits, study.name), encoding="utf-8")
        else:
            write_step(dog, limits.root_radius, BODY, path)


def _number(key: str, texts: Texts) -> float:
    """Read a number that is no key of the study file."""
    if not is_plain(text := texts[key]):
        raise InputError(f"{key} is '{text}', but it must be a number; write the number alone")
    return float(text)


def _point(texts: Texts, where: str) -> Row:
    """Give the operating point as arguments of a verb; none for all of the study's."""
    return {key: _number(key, texts) for key in PLACE} if where == "one" else {}


def open_desk(
    study: Study, surrogate: str | Path | None = None, folder: str | Path | None = None,
    command: str = "",
) -> Desk:  # fmt: skip
    """Find surrogate and search of a study.

    ``surrogate`` is a file that predicts, ``folder`` has results of the search; None for those of
    ``results/NAME``, or the package's. A search of other physics counts as none, and so does one of
    the operation. ``command`` is study and ``--set`` for the command that the page shows.
    """
    config, result = study.config, None
    roots = [Path(folder)] if folder else [bundled_root() / study.name, default_out(config)]
    if surrogate is None and folder is not None and StudyFolder(roots[0]).surrogate.is_file():
        surrogate = StudyFolder(roots[0]).surrogate
    stored, path = matching_surrogate(config, surrogate) or (None, None)
    for one in map(StudyFolder, roots):
        if one.result.is_file() and set(config.shape_keys) == set(config.variables):
            read = one.stored_result()
            own = config.in_engine(read.get("engine", "drake")).physics_hash
            result = read if read.get("physics_hash") == own else result
    return Desk(study, command or study.name, stored, path, result)


def build_app(desk: Desk) -> Dash:
    """Build the page of a desk with its callbacks and files."""
    config = desk.study.config
    app = Dash(
        __name__, title=f"{config.name}: live", update_title="", assets_folder=str(TEMPLATES),
        assets_ignore=r"^(?!report(_app)?\.css$)",
    )  # fmt: skip
    front = None if desk.result is None else front_figure(desk.result, list(config.variables))
    app.layout = page.layout(config, desk.numbers, front)
    app.server.config["TRUSTED_HOSTS"] = [HOST, "localhost"]
    _connect_fields(app, desk)
    _connect_answers(app, desk)

    def write_file(name: str) -> Response:
        if name not in FILES:
            return Response("no such file", 404)
        with TemporaryDirectory() as folder:
            path = Path(folder) / name
            try:
                desk.write(name, request.args, request.args.get("why", ""), path)
            except DogshapeError as error:
                return Response(str(error), 400, mimetype="text/plain")
            return Response(path.read_bytes(), mimetype=FILES[name][0])

    app.server.add_url_rule("/file/<name>", view_func=write_file)
    return app


def _connect_fields(app: Dash, desk: Desk) -> None:
    """Keep field and slider together, and take designs over into the fields."""
    field, slider = ({"number": MATCH, "kind": kind} for kind in ("field", "slider"))

    @app.callback(
        Output(field, "value"), Output(slider, "value"), Input(field, "value"),
        Input(slider, "value"), prevent_initial_call=True,
    )  # fmt: skip
    def move_together(text: str, place: float) -> tuple[Any, Any]:
        if ctx.triggered_id["kind"] == "slider":
            return f"{place:.6g}", no_update
        return no_update, float(text) if is_plain(text) else no_update

    @app.callback(
        Output({"number": ALL, "kind": "field"}, "value", allow_duplicate=True),
        Input("front", "clickData"), Input("back", "n_clicks"), prevent_initial_call=True,
    )  # fmt: skip
    def take_design(click: Row | None, _: int) -> list[Any]:
        clicked = click["points"][0] if click and ctx.triggered_id == "front" else {}
        shape = desk.shape(str(clicked.get("customdata")))
        return [shape.get(one["id"]["number"], no_update) for one in ctx.outputs_list]


def _connect_answers(app: Dash, desk: Desk) -> None:
    """Answer what the fields ask: at once, and after that by simulation."""

    @app.callback(
        Output("asked", "data"), Input({"number": ALL, "kind": "field"}, "value"),
        Input("where", "value"), State("asked", "data"),
    )  # fmt: skip
    def predict(_: Any, where: str, before: Row | None) -> Row | None:
        texts = {one["id"]["number"]: str(one.get("value") or "") for one in ctx.inputs_list[0]}
        asked = {"texts": texts, "where": where}
        if asked == before:
            raise PreventUpdate
        faults, answer = answer_at_once(desk, asked)
        for key, words in faults.items():
            set_props({"fault": key}, {"children": words})
        _show(answer)
        return None if answer["answer.className"] else asked

    @app.callback(Input("asked", "data"), prevent_initial_call=True)
    def simulate(asked: Row | None) -> None:
        _show(answer_by_simulation(desk, asked) if asked else {})

    @app.callback(Input("asked", "data"), Input("why", "value"), prevent_initial_call=True)
    def link(asked: Row | None, why: str | None) -> None:
        _show(link_files(desk, asked, why) if asked else {})


def _show(answer: Answer) -> None:
    for place, content in answer.items():
        name, _, part = place.partition(".")
        set_props(name, {part: content})


def answer_at_once(desk: Desk, asked: Row) -> tuple[dict[str, str], Answer]:
    """Give the sentences at the numbers, and what is known at once; a refusal stops the rest."""
    try:
        found, study = desk.predict(**asked), desk.changed(asked["texts"])
    except DogshapeError as error:
        words = str(error).removeprefix(f"the study {desk.study.name}: ")
        faults = {key: words if key in words else "" for key in asked["texts"]}
        rest = "" if any(faults.values()) else f"There is no such dog: {words}"
        return faults, {"answer.className": "stale", "refused.children": rest}
    svg = open_section_svg(study.config.clutch.dog, desk.study.config.clutch.dog)
    return dict.fromkeys(asked["texts"], ""), {
        "answer.className": "",
        "refused.children": "",
        "predicted.children": page.predicted_card(found, desk.unpredicted(study)),
        **page.judged(found),
        "section.src": f"data:image/svg+xml,{quote(svg)}",
        "cautions.children": page.cautions(found),
        "simulated.children": page.card("simulated shift time", "…"),
    }


def answer_by_simulation(desk: Desk, asked: Row) -> Answer:
    """Give the simulated time, and the checks with the landing."""
    try:
        found = desk.changed(asked["texts"]).check(**_point(**asked))
    except DogshapeError as error:
        return {"simulated.children": page.card("simulated shift time", "none", str(error))}
    return {"simulated.children": page.simulated_card(found), **page.judged(found)}


def link_files(desk: Desk, asked: Row, why: str | None) -> Answer:
    """Link the files of a design, and give the command that checks it."""
    query = urlencode({**asked["texts"], "why": why or ""})
    sets = "".join(f" --set {shlex.quote(one)}" for one in desk.changes(asked["texts"]))
    at = "".join(f" --{k.replace('_', '-')} {v:.12g}" for k, v in _point(**asked).items())
    links = {name: f"/file/{name}?{query}" for name in FILES}
    *files, shift = (html.A(FILES[n][1], href=link, target="_blank") for n, link in links.items())
    command = f"dogshape check {desk.command}{sets}{at}"
    return {"files.children": files, "shift-link.children": [shift], "command.children": command}


def start_server(desk: Desk, port: int) -> BaseWSGIServer:
    """Open the page's server on this machine alone; ``port`` 0 takes any free one."""
    try:
        listening = socket.create_server((HOST, port))
    except OSError as error:
        fault = f"port {port} cannot be taken ({strerror(error.errno or 0)})"
        raise InputError(f"{fault}; give another with --port") from error
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    number, descriptor = listening.getsockname()[1], listening.detach()
    return make_server(HOST, number, build_app(desk).server, threaded=True, fd=descriptor)


def serve_app(
    study: Study,
    *,
    surrogate: str | Path | None = None,
    folder: str | Path | None = None,
    port: int = 0,
    browser: bool = True,
    progress: Progress | bool = False,
    command: str = "",
) -> None:
    """Serve the live page of a study on this machine until it is interrupted.

    ``study``, ``surrogate``, ``folder``, ``command`` as ``open_desk`` takes them. ``port`` 0 is any
    free one, ``browser`` whether to open it; ``progress`` gets the address.
    Example: ``ds.serve_app(ds.Study("mq200"), port=8050, progress=True)``
    """
    server = start_server(open_desk(study, surrogate, folder, command), port)
    address = f"http://{HOST}:{server.port}/"
    receiver(progress).say(f"{address} (Ctrl-C ends it)")
    if browser:
        webbrowser.open(address)
    server.serve_forever()
