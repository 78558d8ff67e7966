"""``help()`` of each public verb: parameters, defaults, and an example that the verb takes."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest

import dogshape as ds

KINDS = (ds.Study, ds.StudyResult)
VERBS = {
    **{name: verb for name in ds.__all__ if inspect.isfunction(verb := getattr(ds, name))},
    **{
        f"{kind.__name__}.{name}": verb
        for kind in KINDS
        for name, verb in vars(kind).items()
        if inspect.isfunction(verb) and not name.startswith(("_", "to_"))
    },
}


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_names_its_parameters_and_has_an_example(name: str) -> None:
    verb: Callable[..., Any] = VERBS[name]
    text, signature = inspect.getdoc(verb) or "", inspect.signature(verb)
    names = [one for one in signature.parameters if one != "self"]
    assert not [one for one in names if not re.search(rf"\b{one}\b", text)]
    assert "0x" not in str(signature)  # a default that is some object
    (example,) = re.findall(r"Example: ``(.*?)``", text, re.DOTALL)
    call = ast.parse(example).body[0].value  # type: ignore[attr-defined]
    assert call.func.attr == name.rpartition(".")[2]
    given = {one.arg: ast.literal_eval(one.value) for one in call.keywords}
    own = ["self"] if "self" in signature.parameters else []
    signature.bind(*own, *call.args, **given)
