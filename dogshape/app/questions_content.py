"""Content of the page that begins a study: sketch, questions and the study that follows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from dash import dcc, html

from dogshape.app.page import Children, answer_field, row_look
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.pipeline.drafts.answers import shown_value
from dogshape.pipeline.drafts.draft_keys import (
    BACKLASH,
    CHAMFER,
    CHAMFER_BACK,
    CHOICES,
    COUNT,
    CREST,
    HEIGHT,
    PARTS,
    RADIUS,
    RIM,
)
from dogshape.pipeline.drafts.questionnaire import Questionnaire
from dogshape.pipeline.export.drawing import open_section_svg

#: Symbols of the sketch by key.
SYMBOLS = {
    COUNT: "N",
    CHAMFER: "\N{GREEK SMALL LETTER ALPHA}",
    CHAMFER_BACK: "\N{GREEK SMALL LETTER ALPHA}\N{SUBSCRIPT TWO}",
    CREST: "c",
    "dog.traction_deg": "\N{GREEK SMALL LETTER BETA}",
    "dog.braking_deg": "\N{GREEK SMALL LETTER GAMMA}",
    "dog.outer_diameter_mm": "D",
    "dog.inner_diameter_mm": "d",
    "dog.axial_gap_mm": "g",
    BACKLASH: "j",
    "dog.edge_radius_mm": "\N{GREEK RHO SYMBOL}",
    HEIGHT: "h",
    RADIUS: "r\N{LATIN SUBSCRIPT SMALL LETTER S}",
    RIM: "t",
}
HINT = (
    "An empty field has the grey value, that of the kind or what follows from your other answers. "
    "Type numbers as they stand in a data sheet: 5,5 or 5.5, 20 deg, 40 ms, 1.5 kN, -60 to 60."
)


def layout(kinds: Mapping[str, str], questionnaire: Questionnaire, sketch: str) -> html.Div:
    """Lay out the page; ``kinds`` describes the kinds of clutch by name, ``sketch`` is an SVG."""
    options: Any = {name: f"{name} ({ring})" for name, ring in kinds.items()}
    kind = dcc.Dropdown(options, questionnaire.origin, id="kind", clearable=False)
    folder = dcc.Input("my_clutch", "text", id="folder", debounce=True)
    fault = html.P(id="folder-fault", className="bad")
    return html.Div(
        [
            html.H1("New study"),
            html.Div(
                [
                    html.Div([html.Label("kind of clutch to begin from"), kind]),
                    html.Div([html.Label("folder to write"), folder, fault]),
                ],
                className="origin",
            ),
            html.Img(
                id="sketch",
                src=f"data:image/svg+xml,{quote(sketch)}",
                alt="Symbols of a clutch",
            ),
            html.P(HINT, className="note"),
            html.Div(part_fields(questionnaire, {}), id="questions"),
            html.H2("Your dogs"),
            html.Img(id="dogs", alt="Section of both rings, unrolled at the mean radius"),
            html.P(id="refusal", className="bad"),
            html.P([html.Button("write the study", id="write"), html.Span(id="state")]),
            html.H2("The same from the command line"),
            html.Code(id="command"),
            dcc.Store("written"),
        ],
        className="begin",
    )


def part_fields(questionnaire: Questionnaire, texts: Mapping[str, str]) -> Children:
    """Lay out the questions by part, with the texts of their fields."""
    parts = []
    for title, words in PARTS.items():
        fields = [
            _field(questionnaire, key, texts.get(key, ""))
            for key in questionnaire.questions
            if key in words
        ]
        parts.append(html.Section([html.H2(title), *fields]))
    return parts


def _field(questionnaire: Questionnaire, key: str, text: str) -> html.Div:
    """Lay out a question: symbol, words, field with the default in grey, and room for a fault."""
    default = shown_value(questionnaire.defaults[key])
    field = answer_field({"answer": key}, text, default, choices=CHOICES.get(key, ()))
    return html.Div(
        [
            html.I(SYMBOLS.get(key, "")),
            html.Label(questionnaire.questions[key], id={"question": key}, title=key),
            field,
            html.P(questionnaire.faults.get(key, ""), id={"fault": key}),
        ],
        id={"row": key},
        className=row_class(questionnaire, key),
    )


def row_class(questionnaire: Questionnaire, key: str) -> str:
    """Return the look of a question: wrong, or as others."""
    return row_look("number answer", questionnaire.faults.get(key, ""))


def written_note(folder: str) -> Children:
    """Lead to the live page of the study that this server has written already."""
    return [
        f"this server has written the study '{folder}', and here is ",
        html.A("its live page", href="/"),
        "; begin another study with 'dogshape app' in a terminal",
    ]


def state_text(questionnaire: Questionnaire) -> str:
    """Count wrong answers, or the values of user and kind."""
    if questionnaire.faults:
        count = len(questionnaire.faults)
        return f"{count} answer is wrong" if count == 1 else f"{count} answers are wrong"
    if questionnaire.refusal:
        return "there is no such clutch"
    count = len(questionnaire.values)
    rest = len(questionnaire.questions) - count
    return f"values of yours: {count}; of '{questionnaire.origin}' or following from yours: {rest}"


def command_text(questionnaire: Questionnaire, folder: str) -> str:
    """Compose the command that writes the same study; empty for wrong answers."""
    if not questionnaire.is_valid:
        return ""
    words = ["dogshape", "init", "study", "--out", folder, "--like", questionnaire.origin, "--yes"]
    for key, value in questionnaire.values.items():
        words += ["--set", f"{key}={toml_value(value)}"]
    return shlex.join(words)


def dogs_svg(questionnaire: Questionnaire, kind: Questionnaire) -> str | None:
    """Draw the dogs of the study over those of its ``kind``; None for wrong answers."""
    if questionnaire.study is None or kind.study is None:
        return None
    svg = open_section_svg(
        questionnaire.study.clutch.pair,
        kind.study.clutch.pair,
        f"'{kind.origin}'",
        is_sleeve=questionnaire.study.limits.sleeve is not None,
    )
    return f"data:image/svg+xml,{quote(svg)}"
