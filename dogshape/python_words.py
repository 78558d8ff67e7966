"""Errors of the public package in Python's words: arguments and keys in place of options."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from typing import Any, TypeVar

from dogshape.sim.errors import DogshapeError, InputError

#: Whether errors keep the options of the command line, which asks by the same verbs.
KEEPS_OPTIONS: ContextVar[bool] = ContextVar("KEEPS_OPTIONS", default=False)

C = TypeVar("C", bound=type)

#: Patterns of the command line's words and what they are in Python, in this order.
WORDS = (
    (r" with --set:", " with settings:"),
    (r"--set ([\w.]+)=(?=[\s,;)]|$)", r'{"\1": None}'),
    (r"--set ([\w.]+)=(\S+?)(?=[\s,;:)]|$)", r'{"\1": \2}'),
    (r"'dogshape fit'", "ds.fit(study)"),
    (r"'dogshape study' with --resume", "study.search(resume=True)"),
    (r"'dogshape study'", "study.search()"),
    (r"'dogshape study ([^']+)'", r'ds.Study("\1").search()'),
    (r"'dogshape gap update'", "ds.update_diagnosis()"),
    (r"dogshape gap BENCH_DIR --out (\S+)", r'ds.diagnose(BENCH, out="\1")'),
    (r"'dogshape validate'", "ds.validate()"),
    (r"'dogshape report'", "ds.load_result(folder).report()"),
    (r"--correct (\S+?)(?=[\s,;:)]|$)", r'correct=["\1"]'),
    (r"(?<!TABLE )--([a-z][a-zA-Z-]*)", lambda found: found[1].replace("-", "_")),
)


def in_python(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a verb: text for a number is refused, and errors name arguments."""
    kinds = {name: str(one.annotation) for name, one in inspect.signature(verb).parameters.items()}

    @wraps(verb)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            for name, value in kwargs.items():
                text = re.search(r"\b(str|Path|Any)\b", kinds.get(name, "str"))
                if isinstance(value, str) and not text:
                    rule = "it must be a number; give it without quotes and unit"
                    raise InputError(f"{name} is '{value}', but {rule}")
            return verb(*args, **kwargs)
        except DogshapeError as error:
            if not KEEPS_OPTIONS.get():
                sentence = str(error)
                for pattern, words in WORDS:
                    sentence = re.sub(pattern, words, sentence)
                error.args = (sentence, *error.args[1:])
            raise

    return called


def speaks_python(kind: C) -> C:
    """Wrap the constructor and all public verbs of a class."""
    for name, value in list(vars(kind).items()):
        if inspect.isfunction(value) and (name == "__init__" or not name.startswith("_")):
            setattr(kind, name, in_python(value))
    return kind
