"""The live page of a study: a server on this machine alone, whose page asks the verbs of ``Study``.

A number of the page is a key of the study file with its text. Texts that differ from those at the
start become settings, as ``--set`` takes them; ``Study.check`` answers by a named surrogate at once
and by the compiled engine in seconds. Nothing is computed here.
"""

from __future__ import annotations

import logging
import re
import shlex
import socket
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from os import strerror
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast
from urllib.parse import quote, urlencode

from dash import ALL, MATCH, Dash, Input, Output, State, ctx, html, no_update, set_props
from dash.exceptions import PreventUpdate
from flask import Response, request
from werkzeug.serving import BaseWSGIServer, make_server

from dogshape import app_page, app_questions
from dogshape.app_page import Number
from dogshape.bench.texts import is_plain
from dogshape.check import Checked
from dogshape.pipeline.config.study_file import Setup, settings_of
from dogshape.pipeline.drafts.answers import shown_value
from dogshape.pipeline.drafts.draft_source import COMMENTED, rings_by_kind
from dogshape.pipeline.drafts.questionnaire import Questionnaire, read_questionnaire
from dogshape.pipeline.drafts.reading_table import remark_lines
from dogshape.pipeline.drafts.study_folder import WrittenStudy, write_study
from dogshape.pipeline.export.cad import write_step
from dogshape.pipeline.export.drawing import dimensioned_svg, open_section_svg
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.reports.charts import front_figure
from dogshape.pipeline.reports.text import PLACE
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord, read_study_record
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.train.training_rows import matching_surrogate
from dogshape.running import receiver
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.interface import argument, verb
from dogshape.sim.strength.spline import require_face
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root
from dogshape.study import Study
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import Stored

HOST = "127.0.0.1"
BODY_THICKNESS = 3.0 * MM  #: m, of a ring below the slots in a STEP file, as in ``export``
ANGLE_KEY = "angle_deg"
#: Label and upper end of the slider of each coefficient of friction.
FRICTION_FIELDS = {
    "contact.static_friction": ("in the shift, static", 0.6),
    "contact.dynamic_friction": ("in the shift, sliding", 0.6),
    "load.friction_release": ("release, highest", 0.6),
    "load.friction_hold": ("holding, lowest", 0.3),
}
#: Type of each file with the words of its link; that of the single shift is the last.
FILES = {
    "sheet.html": ("text/html", "data sheet"),
    "dog.svg": ("image/svg+xml", "dimensioned drawing (SVG)"),
    "rings.step": ("application/step", "both rings (STEP)"),
    "shift.html": ("text/html", "animate this shift"),
}
TEMPLATES = resources.files("dogshape.pipeline.reports") / "templates"  #: with the look of pages
#: Places of the questions' page that depend on all answers: component and property.
SUMMARY_PLACES = (
    ("refusal", "children"),
    ("state", "children"),
    ("command", "children"),
    ("folder-fault", "children"),
    ("dogs", "src"),
    ("dogs", "className"),
)
FOLDER_NAME = re.compile(r"\w[\w.-]{0,99}")  #: also a name of a study
Texts = Mapping[str, str]  #: content of the fields by key
Json = dict[str, Any]  #: value that page and server exchange
Answer = dict[str, Any]  #: content of the page by place, ``component.property``


@dataclass(frozen=True, eq=False)
class LivePage:
    """A study with its surrogate and search for the live page.

    ``command`` has study and ``--set`` of the command line, ``stored`` is the surrogate and
    ``surrogate`` its file, ``result`` the content of ``result.json``; None without one of the same
    physics. ``remarks`` are sentences on the study, of one that was begun on the page.
    ``where`` of a method is ``one`` operating point, or ``all``.
    """

    study: Study
    command: str
    stored: Stored | None = None
    surrogate: Path | None = None
    result: StudyRecord | None = None
    remarks: Sequence[str] = ()

    @cached_property
    def numbers(self) -> list[Number]:
        """Numbers of the page with their values at the start."""
        turn = round(360.0 / self.study.config.clutch.dog.count, 2)
        angle = Number(ANGLE_KEY, "shift", 0.4 * turn, (0.0, turn), "relative angle")
        return [*self._dog_numbers(), *self._point_numbers(), *self._friction_numbers(), angle]

    def _dog_numbers(self) -> list[Number]:
        """List the dimensions of the dog, variables of the search first, with their ranges."""
        config = self.study.config
        values = config.file.dog.sizes | {k: config.prototype[k] for k in config.shape_keys}
        dog = {key: value for key, value in values.items() if value is not None}
        numbers = []
        for key in sorted(dog, key=[*config.variables, *dog].index):
            ends = config.variables.get(key, (dog[key], dog[key]))
            numbers.append(Number(f"dog.{key}", "dog", dog[key], ends))
        return numbers

    def _point_numbers(self) -> list[Number]:
        """List mismatch and force of the middle operating point, with the ends over all points."""
        points = [(point.mismatch / RPM, point.profile.force) for point in self.study.config.points]
        middle = sorted(points)[len(points) // 2]
        columns = zip(*points, strict=True)
        return [
            Number(key, "point", value, (min(column), max(column)))
            for key, value, column in zip(PLACE, middle, columns, strict=True)
        ]

    def _friction_numbers(self) -> list[Number]:
        """List the coefficients of friction of contact and load."""
        file = self.study.config.file
        friction = {f"contact.{key}": value for key, value in vars(file.contact.value).items()}
        friction |= {f"load.{key}": value for key, value in file.load}
        return [
            Number(key, "friction", friction[key], (0.0, end), text)
            for key, (text, end) in FRICTION_FIELDS.items()
        ]

    @cached_property
    def searched_designs(self) -> dict[str, DesignRow]:
        """Designs that the search simulated, by number."""
        rows = [] if self.result is None else self.result.trials
        return {str(row.trial): row for row in rows if row.expected_shift_time_s is not None}

    def shape(self, trial: str = "") -> dict[str, str]:
        """Format the dog's dimensions of a searched design, by key; by default the prototype's."""
        prototype = {number.key: number.text for number in self.numbers if number.group == "dog"}
        design = self.searched_designs.get(trial)
        if design is None:
            return prototype
        params = design.params(self.study.config.variables)
        return prototype | {f"dog.{key}": f"{value:.6g}" for key, value in params.items()}

    def changes(self, texts: Texts) -> list[str]:
        """List ``KEY=VALUE`` of the fields that differ from the study."""
        initial = {number.key: number.text for number in self.numbers if "." in number.key}
        return [
            f"{key}={texts[key] or repr('')}" for key, text in initial.items() if texts[key] != text
        ]

    def modify_study(self, texts: Texts) -> Study:
        """Replace keys of the study by the numbers of the page."""
        return self.study.replace_keys(settings_of(self.changes(texts)))

    def prediction_refusal(self, study: Study) -> str:
        """Describe why the surrogate does not apply to a study; empty if it applies."""
        if self.stored is None:
            return f"there is no surrogate of the study; {verb('fit')} makes one"
        differences = compare_physics(self.stored.surrogate.data, study.config.physics)
        return f"the surrogate is of other physics: {differences}" if differences else ""

    def predict(self, texts: Texts, where: str) -> Checked:
        """Check a design at once: by the surrogate, or by closed forms alone without one."""
        study = self.modify_study(texts)
        if self.prediction_refusal(study):
            return study.strength(simulate=False)
        return study.check(**_point(texts, where), surrogate=self.surrogate)

    def write(self, name: str, texts: Texts, why: str, path: Path) -> None:
        """Write a file of ``FILES``: single shift, data sheet, drawing or solids."""
        study = self.modify_study(texts)
        dog = study.config.clutch.dog
        limits = study.config.limits
        if name == "shift.html":
            angle = _number(ANGLE_KEY, texts)
            study.shift(**_point(texts, "one"), angle_deg=angle).report(path)
        elif name == "sheet.html":
            study.data_sheet(path, why)
        elif name == "dog.svg":
            path.write_text(dimensioned_svg(dog, limits, study.name), encoding="utf-8")
        else:
            require_face(limits.sleeve)
            pair = study.config.clutch.pair
            tolerances = limits.tolerances.dimensions
            write_step(pair, limits.root_radius, BODY_THICKNESS, path, tolerances)


def _number(key: str, texts: Texts) -> float:
    """Read a number that is no key of the study file."""
    text = texts[key]
    if not is_plain(text):
        raise InputError(f"{key} is '{text}', but it must be a number; write the number alone")
    return float(text)


class Question(NamedTuple):
    """Design and operating points that the page asks for; its fields are keys of its store."""

    texts: Texts
    where: str  #: ``one`` or ``all`` operating points


def _point(texts: Texts, where: str) -> Json:
    """Read the operating point as arguments of a verb; empty for all points of the study."""
    if where != "one":
        return {}
    return {key: _number(key, texts) for key in PLACE}


def open_live_page(
    study: Study,
    surrogate: str | Path | None = None,
    folder: str | Path | None = None,
    command: str = "",
) -> LivePage:
    """Load surrogate and search of a study for its live page.

    ``surrogate`` is a file that predicts, ``folder`` has results of the search; None for those of
    ``results/NAME``, or the package's. A search of other physics counts as none, and so does one of
    the operation. ``command`` is study and ``--set`` for the command that the page shows.
    """
    config = study.config
    if folder:
        folders = [StudyFolder(Path(folder))]
    else:
        folders = [StudyFolder(bundled_root() / study.name), StudyFolder(default_out(config))]
    if surrogate is None and folder is not None and folders[0].surrogate.is_file():
        surrogate = folders[0].surrogate
    stored, path = matching_surrogate(config, surrogate) or (None, None)
    result = _matching_result(config, folders)
    return LivePage(study, command or study.name, stored, path, result)


def _matching_result(config: Setup, folders: Sequence[StudyFolder]) -> StudyRecord | None:
    """Read the last ``result.json`` of the study's physics; None without one."""
    if set(config.shape_keys) != set(config.variables):
        return None
    matching = None
    for folder in folders:
        if folder.result.is_file():
            result = read_study_record(folder)
            physics = config.in_engine(result.engine).physics_hash
            if result.physics_hash == physics:
                matching = result
    return matching


def _page(title: str) -> Dash:
    """Build an application without content that answers to names of this machine alone."""
    app = Dash(
        __name__,
        title=title,
        update_title="",
        assets_folder=str(TEMPLATES),
        assets_ignore=r"^(?!report(_app)?\.css$)",
    )
    app.server.config["TRUSTED_HOSTS"] = [HOST, "localhost"]
    return app


def build_app(live_page: LivePage) -> Dash:
    """Build the application of a live page with its callbacks and files."""
    config = live_page.study.config
    app = _page(f"{config.name}: live")
    front = (
        None if live_page.result is None else front_figure(live_page.result, list(config.variables))
    )
    app.layout = app_page.layout(config, live_page.numbers, front, live_page.remarks)
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
        "predicted.children": app_page.predicted_card(check, live_page.prediction_refusal(study)),
        **app_page.verdict_content(check),
        "section.src": f"data:image/svg+xml,{quote(svg)}",
        "cautions.children": app_page.cautions(check),
        "simulated.children": app_page.card("simulated shift time", "…"),
    }


def answer_by_simulation(live_page: LivePage, question: Question) -> Answer:
    """Simulate a design; return the page's content for its time and checks, with landing."""
    try:
        check = live_page.modify_study(question.texts).check(**_point(*question))
    except DogshapeError as error:
        return {"simulated.children": app_page.card("simulated shift time", "none", str(error))}
    return {"simulated.children": app_page.simulated_card(check), **app_page.verdict_content(check)}


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
    for key, value in _point(*question).items():
        command += f" --{key.replace('_', '-')} {value:.12g}"
    return {"files.children": files, "shift-link.children": [shift], "command.children": command}


class NewStudy:
    """WSGI application that asks for a new study, writes its folder and becomes its live page."""

    def __init__(self, surrogate: str | Path | None = None) -> None:
        self.surrogate = surrogate
        self.kinds = rings_by_kind()
        self._unanswered: dict[str, Questionnaire] = {}
        self.page = build_questions(self).server

    def __call__(self, environ: Any, start_response: Any) -> Any:
        """Answer a request by the questions, or by the live page of the written study."""
        return self.page(environ, start_response)

    def read(self, origin: str, texts: Texts) -> Questionnaire:
        """Read all answers to the questions of a bundled kind of clutch."""
        if origin not in self.kinds:
            raise InputError(f"'{origin}' is no kind of clutch; valid are {', '.join(self.kinds)}")
        return read_questionnaire(origin, texts)

    def read_kind(self, origin: str) -> Questionnaire:
        """Read the questions of a bundled kind without any answer, once for all answers."""
        if origin not in self._unanswered:
            self._unanswered[origin] = self.read(origin, {})
        return self._unanswered[origin]

    def write(self, questionnaire: Questionnaire, name: str) -> None:
        """Write the folder ``name`` into the working folder, and open its live page.

        Raises InputError for a path, so that no page writes elsewhere, and StorageError for a
        folder that holds files.
        """
        folder = Path(name)
        if not FOLDER_NAME.fullmatch(name):
            raise InputError(
                f"the folder is '{name}', but it must be a name of letters, digits, '_', '-' and "
                f"'.'; it is written into {Path.cwd()}"
            )
        written = write_study(folder, questionnaire.origin, questionnaire.values)
        study = Study(folder)
        live_page = open_live_page(study, self.surrogate, command=name)
        self.page = build_app(replace(live_page, remarks=_remarks(written))).server


def _remarks(written: WrittenStudy) -> list[str]:
    """Summarise a written study, then list its assumptions and warnings."""
    counts = f"{len(written.assumed)} assumptions, {len(written.warnings)} warnings"
    summary = f"{written.file} is written from {written.origin}: {counts}"
    return [summary, *remark_lines(written.assumed, written.warnings)]


def build_questions(new_study: NewStudy) -> Dash:
    """Build the page that asks for a new study."""
    app = _page("New study")
    sketch = (TEMPLATES / "symbols.svg").read_text(encoding="utf-8")
    first = new_study.read_kind(COMMENTED)
    app.layout = app_questions.layout(new_study.kinds, first, sketch)

    # Outputs, as Dash leaves out those of an answer that a later one has overtaken.
    @app.callback(
        *(Output(component, part) for component, part in SUMMARY_PLACES),
        Output("questions", "children"),
        Output({"row": ALL}, "className"),
        Output({"question": ALL}, "children"),
        Output({"answer": ALL}, "placeholder"),
        Output({"fault": ALL}, "children"),
        Input("kind", "value"),
        Input("folder", "value"),
        Input({"answer": ALL}, "value"),
    )
    def read(origin: str, folder: str | None, _: Any) -> tuple[Any, ...]:
        texts = _answer_texts(ctx.inputs_list[2])
        questionnaire = new_study.read(origin, texts)
        summary = answer_questions(new_study, questionnaire, folder or "")
        if [*questionnaire.questions] != [*texts]:
            fields = app_questions.part_fields(questionnaire, texts)
            return *summary, fields, *4 * [len(texts) * [no_update]]
        return (
            *summary,
            no_update,
            [app_questions.row_class(questionnaire, key) for key in texts],
            [questionnaire.questions[key] for key in texts],
            [shown_value(questionnaire.defaults[key]) for key in texts],
            [questionnaire.faults.get(key, "") for key in texts],
        )

    @app.callback(
        Output("written", "data"),
        Output("folder-fault", "children", allow_duplicate=True),
        Input("write", "n_clicks"),
        State("kind", "value"),
        State("folder", "value"),
        State({"answer": ALL}, "value"),
        prevent_initial_call=True,
    )
    def write(_: int, origin: str, folder: str | None, __: Any) -> tuple[str, str]:
        questionnaire = new_study.read(origin, _answer_texts(ctx.states_list[2]))
        if not questionnaire.is_valid:
            raise PreventUpdate
        try:
            new_study.write(questionnaire, folder or "")
        except DogshapeError as error:
            return "", str(error)
        return folder or "", ""

    reload = "name => { if (name) location.reload(); }"
    cast(Any, app).clientside_callback(reload, Input("written", "data"))
    return app


def _answer_texts(fields: Sequence[Json]) -> dict[str, str]:
    """Return the texts of the answers by key, in the order of the page."""
    return {field["id"]["answer"]: str(field.get("value") or "") for field in fields}


def answer_questions(new_study: NewStudy, questionnaire: Questionnaire, folder: str) -> list[Any]:
    """Compose the contents of ``SUMMARY_PLACES`` from all answers."""
    kind = new_study.read_kind(questionnaire.origin)
    picture = app_questions.dogs_svg(questionnaire, kind)
    return [
        questionnaire.refusal,
        app_questions.state_text(questionnaire),
        app_questions.command_text(questionnaire, folder),
        "",
        picture or no_update,
        "" if picture else "stale",
    ]


def start_server(page: LivePage | NewStudy, port: int) -> BaseWSGIServer:
    """Open a page's server on this machine alone; ``port`` 0 takes any free one."""
    try:
        listener = socket.create_server((HOST, port))
    except OSError as error:
        fault = f"port {port} cannot be taken ({strerror(error.errno or 0)})"
        raise InputError(f"{fault}; give another with {argument('port')}") from error
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    number = listener.getsockname()[1]
    descriptor = listener.detach()
    application = build_app(page).server if isinstance(page, LivePage) else page
    return make_server(HOST, number, application, threaded=True, fd=descriptor)


def serve_app(
    study: Study | None = None,
    *,
    surrogate: str | Path | None = None,
    folder: str | Path | None = None,
    port: int = 0,
    browser: bool = True,
    progress: Progress | bool = False,
    command: str = "",
) -> None:
    """Serve the live page of a study on this machine until it is interrupted.

    Without a study the page asks for a new one first, and writes its folder.
    ``study``, ``surrogate``, ``folder``, ``command`` as in ``open_live_page``. ``port`` 0 is any
    free one, ``browser`` whether to open the page; ``progress`` receives the address.
    Example: ``ds.serve_app(ds.Study("mq200"), port=8050, progress=True)``
    """
    page: LivePage | NewStudy = NewStudy(surrogate)
    if study is not None:
        page = open_live_page(study, surrogate, folder, command)
    server = start_server(page, port)
    address = f"http://{HOST}:{server.port}/"
    receiver(progress).say(f"{address} (Ctrl-C ends it)")
    if browser:
        webbrowser.open(address)
    server.serve_forever()
