"""Types of the arguments of the public verbs, checked where Python does not."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from dogshape.sim.errors import InputError

PublicClass = TypeVar("PublicClass", bound=type)


def check_types(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a verb so that text in place of a number is an InputError that names the argument."""
    parameters = inspect.signature(verb).parameters
    annotations = {name: str(parameter.annotation) for name, parameter in parameters.items()}

    @wraps(verb)
    def checked_verb(*args: Any, **kwargs: Any) -> Any:
        for name, value in kwargs.items():
            takes_text = re.search(r"\b(str|Path|Any)\b", annotations.get(name, "str"))
            if isinstance(value, str) and not takes_text:
                rule = "it must be a number; give it without quotes and unit"
                raise InputError(f"{name} is '{value}', but {rule}")
        return verb(*args, **kwargs)

    return checked_verb


def check_types_of_verbs(public_class: PublicClass) -> PublicClass:
    """Wrap the constructor and all public verbs of a class, in place."""
    for name, value in list(vars(public_class).items()):
        if inspect.isfunction(value) and (name == "__init__" or not name.startswith("_")):
            setattr(public_class, name, check_types(value))
    return public_class
