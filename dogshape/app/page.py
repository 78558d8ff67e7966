"""Application, look and types of exchanged values, common to both pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from dash import Dash, dcc

HOST = "127.0.0.1"
TEMPLATES = resources.files("dogshape.pipeline.reports") / "templates"  #: with the look of pages
Texts = Mapping[str, str]  #: content of the fields by key
Json = dict[str, Any]  #: value that page and server exchange
Answer = dict[str, Any]  #: content of the page by place, ``component.property``
Children = list[Any]  #: content of a component


def new_page(title: str, path: str = "/") -> Dash:
    """Build an application without content that answers to names of this machine alone.

    ``path`` is that of its addresses.
    """
    app = Dash(
        __name__,
        title=title,
        url_base_pathname=path,
        update_title="",
        assets_folder=str(TEMPLATES),
        assets_ignore=r"^(?!report(_app)?\.css$)",
    )
    app.server.config["TRUSTED_HOSTS"] = [HOST, "localhost"]
    return app


def answer_field(
    field_id: Json, text: str, default: str, *, choices: Sequence[str] = (), debounce: Any = True
) -> Any:
    """Lay out a field for an answer: its text, and in grey the ``default`` of an empty one."""
    if choices:
        return dcc.Dropdown(
            [*choices], text or None, id=field_id, placeholder=default, searchable=False
        )
    return dcc.Input(text, "text", id=field_id, placeholder=default, debounce=debounce)


def row_look(look: str, fault: str) -> str:
    """Return the look of a row: marked if its answer is wrong."""
    return f"{look} wrong" if fault else look
