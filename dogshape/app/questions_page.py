"""Page that begins a study: its questions, and the live page that follows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any, cast

from dash import ALL, Dash, Input, Output, State, ctx, no_update
from dash.exceptions import PreventUpdate
from flask import redirect, request

from dogshape.app import questions_content
from dogshape.app.live_callbacks import build_app
from dogshape.app.live_page import open_live_page
from dogshape.app.page import TEMPLATES, Json, Texts, new_page
from dogshape.pipeline.drafts.answers import shown_value
from dogshape.pipeline.drafts.draft_source import COMMENTED, rings_by_kind
from dogshape.pipeline.drafts.questionnaire import Questionnaire, read_questionnaire
from dogshape.pipeline.drafts.reading_table import remark_lines
from dogshape.pipeline.drafts.study_folder import WrittenStudy, write_study
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.study import Study

#: Places of the questions' page that depend on all answers: component and property.
SUMMARY_PLACES = (
    ("refusal", "children"),
    ("state", "children"),
    ("command", "children"),
    ("folder-fault", "children"),
    ("dogs", "src"),
    ("dogs", "className"),
)
PATH = "/questions/"  #: of the questions' addresses; the live page that follows has the others
FOLDER_NAME = re.compile(r"\w[\w.-]{0,99}")  #: also a name of a study


class NewStudy:
    """WSGI application that asks for a new study, writes its folder and becomes its live page.

    Open tabs of the questions are answered for as long as the server runs. ``folder`` is the
    written one, empty before.
    """

    def __init__(self, surrogate: str | Path | None = None) -> None:
        self.surrogate = surrogate
        self.kinds = rings_by_kind()
        self.folder = ""
        self.lock = Lock()  #: held while the study is written
        self._unanswered: dict[str, Questionnaire] = {}
        self._questions = build_questions(self).server
        self._live_page = self._questions

    def __call__(self, environ: Any, start_response: Any) -> Any:
        """Answer a request by the questions, or by the live page of the written study."""
        is_question = environ.get("PATH_INFO", "").startswith(PATH)
        page = self._questions if is_question else self._live_page
        return page(environ, start_response)

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
        self._live_page = build_app(replace(live_page, remarks=_remarks(written))).server
        self.folder = name


def _remarks(written: WrittenStudy) -> list[str]:
    """Summarise a written study, then list its assumptions and warnings."""
    counts = f"{len(written.assumed)} assumptions, {len(written.warnings)} warnings"
    summary = f"{written.file} is written from {written.origin}: {counts}"
    return [summary, *remark_lines(written.assumed, written.warnings)]


def build_questions(new_study: NewStudy) -> Dash:
    """Build the page that asks for a new study."""
    app = new_page("New study", PATH)
    sketch = (TEMPLATES / "symbols.svg").read_text(encoding="utf-8")
    first = new_study.read_kind(COMMENTED)
    app.layout = questions_content.layout(new_study.kinds, first, sketch)

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
            fields = questions_content.part_fields(questionnaire, texts)
            return *summary, fields, *4 * [len(texts) * [no_update]]
        return (
            *summary,
            no_update,
            [questions_content.row_class(questionnaire, key) for key in texts],
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
    def write(_: int, origin: str, folder: str | None, __: Any) -> tuple[str, Any]:
        questionnaire = new_study.read(origin, _answer_texts(ctx.states_list[2]))
        with new_study.lock:
            if new_study.folder:
                return "", questions_content.written_note(new_study.folder)
            if not questionnaire.is_valid:
                raise PreventUpdate
            try:
                new_study.write(questionnaire, folder or "")
            except DogshapeError as error:
                return "", str(error)
        return folder or "", ""

    follow = "name => { if (name) location.assign('/'); }"
    cast(Any, app).clientside_callback(follow, Input("written", "data"))

    def redirect_page() -> Any:
        """Lead the address of the server to the questions, and later theirs to the live page."""
        if request.path == "/":
            return redirect(PATH)
        return redirect("/") if new_study.folder and request.path == PATH else None

    app.server.before_request(redirect_page)
    return app


def _answer_texts(fields: Sequence[Json]) -> dict[str, str]:
    """Return the texts of the answers by key, in the order of the page."""
    return {field["id"]["answer"]: str(field.get("value") or "") for field in fields}


def answer_questions(new_study: NewStudy, questionnaire: Questionnaire, folder: str) -> list[Any]:
    """Compose the contents of ``SUMMARY_PLACES`` from all answers."""
    kind = new_study.read_kind(questionnaire.origin)
    picture = questions_content.dogs_svg(questionnaire, kind)
    return [
        questionnaire.refusal,
        questions_content.state_text(questionnaire),
        questions_content.command_text(questionnaire, folder),
        "",
        picture or no_update,
        "" if picture else "stale",
    ]
