"""Arguments, keys and verbs in the words of the interface in use: Python, or the command line.

A sentence of the library names what a user may give next. The command line, which calls the same
verbs, selects its options; everything else reads the arguments of Python.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

#: Whether sentences name options of the command line.
_ON_COMMAND_LINE: ContextVar[bool] = ContextVar("_ON_COMMAND_LINE", default=False)

#: Options whose name is not that of the argument.
OPTIONS = {
    "origin": "from",
    "settings": "set",
    "values": "set",
    "columns": "column",
    "path": "write",  # of a calibrated study
    "limits": "limit",
}
#: Classes of Python for arguments with named fields in place of a mapping.
CLASSES = {"limits": "ds.TableLimits"}
#: Objects of Python whose methods the verbs of the command line call; ``ds`` without an entry.
OWNERS = {
    "search": "study",
    "check": "study",
    "expect": "study",
    "predict": "study",
    "strength": "study",
    "report": "result",
}
#: Functions of Python for verbs of another name.
FUNCTIONS = {"init bench": "BenchDraft", "export": "data_sheet"}


@contextmanager
def command_line() -> Iterator[None]:
    """Name options of the command line in all sentences that are written within."""
    token = _ON_COMMAND_LINE.set(True)
    try:
        yield
    finally:
        _ON_COMMAND_LINE.reset(token)


def argument(name: str, value: object = None) -> str:
    """Write an argument of a verb: ``--rise-s 0.1`` or ``rise_s=0.1``.

    Without a value the name alone, ``--rise-s`` or ``rise_s``; True is a flag.
    """
    if _ON_COMMAND_LINE.get():
        option = "--" + OPTIONS.get(name, name).replace("_", "-")
        if value is None or value is True:
            return option
        return f"{option} {shlex.quote(str(value))}"
    return name if value is None else f"{name}={_literal(value)}"


def listed_argument(name: str, value: str, *, quoted: bool = False) -> str:
    """Write one value of an argument that takes several: ``--drop 'gear=2'``, ``drop=[...]``.

    ``quoted`` as in ``text_value``.
    """
    if _ON_COMMAND_LINE.get():
        return f"{argument(name)} {text_value(value, quoted=quoted)}"
    return f"{name}=[{_literal(value)}]"


def key_argument(name: str, key: str, value: object = None, *, quoted: bool = False) -> str:
    """Write one entry of an argument that maps keys: ``--column force_N=F:kN``, ``columns={...}``.

    Without a value the entry alone, ``--column force_N`` or ``columns["force_N"]``. ``settings``
    and ``values`` are ``--set`` of the command line. An empty value takes the key out. ``quoted``
    as in ``text_value``.
    """
    if _ON_COMMAND_LINE.get():
        if value is None:
            return f"{argument(name)} {key}"
        text = _key_text(value)
        if name == "columns":  # heads have blanks: the quantity is read at a glance
            return f"{argument(name)} {key}={text_value(text, quoted=quoted)}"
        return argument(name, f"{key}={text}")
    if value is None:
        return f"{name}[{_literal(key)}]"
    if name in CLASSES:
        return f"{name}={CLASSES[name]}({key}={_literal(value)})"
    return f"{name}={{{_literal(key)}: {_literal(None if value == '' else value)}}}"


def _key_text(value: object) -> str:
    """Write the value of a key as ``KEY=VALUE`` of the command line takes it."""
    if isinstance(value, list):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def key_arguments(name: str, values: Mapping[str, str]) -> str:
    """Write several entries of an argument that maps keys."""
    if _ON_COMMAND_LINE.get():
        return " ".join(key_argument(name, key, value) for key, value in values.items())
    return f"{name}={json.dumps(dict(values), ensure_ascii=False)}"


def text_value(value: str, *, quoted: bool = False) -> str:
    """Write a text as the value of an argument, with the quotation marks of the interface.

    ``quoted`` sets them on the command line also where the shell needs none, as around heads of
    tables; Python has them always.
    """
    if not _ON_COMMAND_LINE.get():
        return _literal(value)
    word = shlex.quote(value)
    return f"'{value}'" if quoted and word == value else word


def verb(name: str, subject: str = "", **arguments: object) -> str:
    """Write a call of a verb: ``'dogshape search mq200 --resume'``, ``study.search(resume=True)``.

    ``subject`` is the study, bench or folder that it is called with.
    """
    words = [argument(key, value) for key, value in arguments.items()]
    if _ON_COMMAND_LINE.get():
        call = ["dogshape", name, *([shlex.quote(subject)] if subject else []), *words]
        return f"'{' '.join(call)}'"
    owner = OWNERS.get(name, "ds")
    function = FUNCTIONS.get(name, name.replace("-", "_"))
    if subject and owner == "study":
        owner = f"ds.Study({_literal(subject)})"
    elif subject:
        words.insert(0, _literal(subject))
    return f"{owner}.{function}({', '.join(words)})"


def _literal(value: object) -> str:
    """Write a value as Python does, texts in double quotation marks."""
    is_text = isinstance(value, str | list)
    return json.dumps(value, ensure_ascii=False) if is_text else repr(value)
