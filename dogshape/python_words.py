"""Errors of the public package in Python's words: arguments and keys in place of options."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from typing import Any, TypeVar

from dogshape.sim.errors import DogshapeError, InputError

#: Whether errors keep the options of the command line, which calls the same verbs.
KEEPS_OPTIONS: ContextVar[bool] = ContextVar("KEEPS_OPTIONS", default=False)

PublicClass = TypeVar("PublicClass", bound=type)

#: Patterns of the command line's words with their replacements in Python, in order.
REPLACEMENTS: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (r" with --set:", " with settings:"),
    (r"--set ([\w.]+)=(?=[\s,;)]|$)", r'{"\1": None}'),
    (r"--set ([\w.]+)=(\S+?)(?=[\s,;:)]|$)", r'{"\1": \2}'),
    (r"'dogshape fit'", "ds.fit(study)"),
    (r"'dogshape search' with --resume", "study.search(resume=True)"),
    (r"'dogshape search'", "study.search()"),
    (r"'dogshape search ([^']+)'", r'ds.Study("\1").search()'),
    (r"'dogshape update-diagnosis'", "ds.update_diagnosis()"),
    (r"dogshape diagnose BENCH_DIR --out (\S+)", r'ds.diagnose(BENCH, out="\1")'),
    (r"'dogshape validate'", "ds.validate()"),
    (r"'dogshape report'", "ds.load_result(folder).report()"),
    (r"--correct (\S+?)(?=[\s,;:)]|$)", r'correct=["\1"]'),
    (r"--column (\w+)='([^']*)'", r'columns={"\1": "\2"}'),
    (r"--column (\w+)=(\S+?)(?=[\s,;:)]|$)", r'columns={"\1": "\2"}'),
    (r"--(drop|keep) '([^']*)'", r'\1=["\2"]'),
    (r"--rows ([\d,-]*\d)", r'rows="\1"'),
    (r"--quotes none", 'quotes="none"'),
    (r"--decimal ([.,])", r'decimal="\1"'),
    (r"--fill-down", "fill_down=True"),
    (r"(?<!TABLE )--([a-z][a-zA-Z-]*)", lambda option: option[1].replace("-", "_")),
)


def wrap_verb(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a verb: InputError for text in place of a number, errors name arguments of Python."""
    parameters = inspect.signature(verb).parameters
    annotations = {name: str(parameter.annotation) for name, parameter in parameters.items()}

    @wraps(verb)
    def checked_verb(*args: Any, **kwargs: Any) -> Any:
        try:
            for name, value in kwargs.items():
                takes_text = re.search(r"\b(str|Path|Any)\b", annotations.get(name, "str"))
                if isinstance(value, str) and not takes_text:
                    rule = "it must be a number; give it without quotes and unit"
                    raise InputError(f"{name} is '{value}', but {rule}")
            return verb(*args, **kwargs)
        except DogshapeError as error:
            if not KEEPS_OPTIONS.get():
                error.args = (_translate(str(error)), *error.args[1:])
            raise

    return checked_verb


def _translate(sentence: str) -> str:
    """Replace options of the command line by arguments of Python."""
    for pattern, replacement in REPLACEMENTS:
        sentence = re.sub(pattern, replacement, sentence)
    return sentence


def wrap_verbs(public_class: PublicClass) -> PublicClass:
    """Wrap the constructor and all public verbs of a class, in place."""
    for name, value in list(vars(public_class).items()):
        if inspect.isfunction(value) and (name == "__init__" or not name.startswith("_")):
            setattr(public_class, name, wrap_verb(value))
    return public_class
