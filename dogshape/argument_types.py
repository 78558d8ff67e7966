"""Types of the arguments of the public verbs, checked where Python does not."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from reprlib import repr as short_repr
from types import UnionType
from typing import Any, NamedTuple, TypeVar

from dogshape.sim.errors import InputError

PublicClass = TypeVar("PublicClass", bound=type)


class Kind(NamedTuple):
    """Kind of a value: its words in a message, and the classes of the values that it accepts."""

    words: str
    classes: tuple[type, ...]


#: By the name of an annotation; ``bool`` is no number here, though Python takes it as one.
KINDS = {
    "int": Kind("a whole number", (Integral,)),
    "float": Kind("a number", (Real,)),
    "bool": Kind("True or False", (bool,)),
    "str": Kind("a text", (str,)),
    "Path": Kind("a path", (Path,)),
    "None": Kind("None", (type(None),)),
    "Mapping": Kind("a dictionary", (Mapping,)),
    "Iterable": Kind("a list", (Iterable,)),
    "Sequence": Kind("a list", (Iterable,)),
}
LISTS = ("Iterable", "Sequence")  #: annotations whose elements have a type too
PLURALS = {"float": "numbers", "str": "texts"}  #: words of the elements of a list
#: Classes that verbs take, by name: their modules may not be loaded. Other names accept any value.
CLASSES = ("BenchDraft", "DataFrame", "DraftTables", "Progress", "Study")


def check_types(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a verb so that an argument of a wrong type is an InputError that names it."""
    signature = inspect.signature(verb)

    @wraps(verb)
    def checked_verb(*args: Any, **kwargs: Any) -> Any:
        try:
            arguments = signature.bind(*args, **kwargs).arguments
        except TypeError:  # Python's own message names an argument that is missing or unknown
            return verb(*args, **kwargs)
        for name, value in arguments.items():
            parameter = signature.parameters[name]
            annotation = _spelled_out(parameter.annotation, verb)
            values = value if parameter.kind is parameter.VAR_KEYWORD else {name: value}
            if parameter.kind is parameter.VAR_POSITIONAL:
                values = {f"{name}[{i}]": element for i, element in enumerate(value)}
            for key, argument in values.items():
                if not _is_of(annotation, argument):
                    raise InputError(_refusal(verb, key, argument, annotation))
        return verb(*args, **kwargs)

    return checked_verb


def _spelled_out(annotation: Any, verb: Callable[..., Any]) -> str:
    """Spell the annotation of an argument as text, an alias of a union by its members."""
    if annotation is inspect.Parameter.empty:
        return "Any"
    alias = getattr(verb, "__globals__", {}).get(annotation)
    text = str(alias) if isinstance(alias, UnionType) else str(annotation)
    return re.sub(r"\b(?:\w+\.)+(?=\w)", "", text)


def _members(annotation: str) -> list[str]:
    """Split a union at its bars outside of brackets."""
    return re.split(r" \| (?![^\[]*\])", annotation)


def _is_of(annotation: str, value: Any) -> bool:
    """Whether a value is of one of the members of an annotation."""
    return any(_is_of_member(member, value) for member in _members(annotation))


def _is_of_member(member: str, value: Any) -> bool:
    """Whether a value is of an annotation without a bar."""
    name, _, elements = member.rstrip("]").partition("[")
    if name in CLASSES:
        return any(base.__name__ == name for base in type(value).__mro__)
    kind = KINDS.get(name)
    if kind is None:
        return True
    if isinstance(value, bool) and name != "bool":
        return False
    if name in LISTS:
        if isinstance(value, str) or not isinstance(value, Iterable):
            return False
        return iter(value) is value or all(_is_of(elements, element) for element in value)
    return isinstance(value, kind.classes)


def _refusal(verb: Callable[..., Any], name: str, value: Any, annotation: str) -> str:
    """Compose a refusal: argument with its value, the types it takes, and the remedy."""
    words = []
    for member in _members(annotation):
        member_name, _, elements = member.rstrip("]").partition("[")
        kind = KINDS.get(member_name)
        text = f"a {member_name}" if kind is None else kind.words
        if member_name in LISTS and elements in PLURALS:
            text = f"{text} of {PLURALS[elements]}"
        words.append(text)
    rule = f"it must be {' or '.join(dict.fromkeys(words))}"
    public_name = verb.__qualname__.removesuffix(".__init__")
    remedy = f"help(dogshape.{public_name}) describes it"
    if isinstance(value, str) and "number" in rule and "text" not in rule:
        remedy = "give it without quotes and unit"
    return f"{name} is {short_repr(value)}, but {rule}; {remedy}"


def check_types_of_verbs(public_class: PublicClass) -> PublicClass:
    """Wrap the constructor and all public verbs of a class, in place."""
    for name, value in list(vars(public_class).items()):
        if inspect.isfunction(value) and (name == "__init__" or not name.startswith("_")):
            setattr(public_class, name, check_types(value))
    return public_class
