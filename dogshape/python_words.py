"""Errors of the public package in Python's words: arguments and keys in place of options."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from dogshape.sim.errors import DogshapeError, InputError

#: Whether errors keep the options of the command line, which asks by the same verbs.
KEEPS_OPTIONS: ContextVar[bool] = ContextVar("KEEPS_OPTIONS", default=False)

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

#: Patterns of the command line's words and what they are in Python, in this order.
WORDS = (
    (r" with --set:", " with settings:"),
    (r"--set ([\w.]+)=(\S+?)(?=[\s,;:)]|$)", r'{"\1": \2}'),
    (r"--engine (\w+)", r'{"solver.engine": "\1"}'),
    (r"--trials\b", "trials"),
    (r"'dogshape fit'", "ds.fit(study)"),
    (r"'dogshape study'", "study.search()"),
    (r"'dogshape (\w+)'", r"study.\1()"),
    (r"--relative-angle-deg", "angle_deg"),
    (r"--correct (\S+?)(?=[\s,;:)]|$)", r'correct=["\1"]'),
    (r"--([a-z][a-zA-Z-]*)", lambda found: found[1].replace("-", "_")),
)


def python_words(text: str) -> str:
    """Write a sentence of the command line with arguments in place of options."""
    for pattern, words in WORDS:
        text = re.sub(pattern, words, text)
    return text


def in_python(verb: Callable[P, R]) -> Callable[P, R]:
    """Wrap a verb: text for a number is refused, and errors name arguments."""
    taken = inspect.signature(verb).parameters

    @wraps(verb)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            for name, value in kwargs.items():
                _require_number(name, value, taken)
            return verb(*args, **kwargs)
        except DogshapeError as error:
            if KEEPS_OPTIONS.get():
                raise
            error.args = (python_words(str(error)), *error.args[1:])
            raise

    return called


def _require_number(name: str, value: Any, taken: Any) -> None:
    """Raise InputError for text where the argument takes none."""
    kind = str(taken[name].annotation) if name in taken else "str"
    if isinstance(value, str) and not re.search(r"\b(str|Path|Any)\b", kind):
        raise InputError(
            f"{name} is '{value}', but it must be a number; give it without quotes and unit"
        )


def speaks_python(kind: C) -> C:
    """Wrap the constructor and all public verbs of a class."""
    for name, value in list(vars(kind).items()):
        if inspect.isfunction(value) and (name == "__init__" or not name.startswith("_")):
            setattr(kind, name, in_python(value))
    return kind
