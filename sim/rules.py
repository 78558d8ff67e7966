"""Rules that a value of a file or an option can break, in sentences of the project's own.

The validator names each rule by a kind; ``RULES`` has the words of every kind that the schemas
and options use.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic_core import ErrorDetails

from dogshape.sim.errors import meant_number
from dogshape.sim.units import unit_of

SHOWN = 60  #: characters of a value that a sentence shows
NAME = "letters, digits, '_', '-' and '.' only, without blanks, beginning with no '-' or '.'"

#: What a value must be, by the kind of the rule; in braces what the rule limits it to.
RULES: Mapping[str, str] = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a table of keys",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "above {gt}",
    "greater_than_equal": "at least {ge}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of a few digits",
    "int_type": "a whole number",
    "less_than": "below {lt}",
    "less_than_equal": "at most {le}",
    "list_type": "a list in square brackets",
    "literal_error": "one of {expected}",
    "model_attributes_type": "a table of keys",
    "model_type": "a table of keys",
    "path_type": "a path",
    "string_pattern_mismatch": NAME,
    "string_too_long": "not longer than {max_length} characters",
    "string_too_short": "not empty",
    "string_type": "a text in quotation marks",
    "too_large": "at most {most}, {why}",
    "too_long": "a list of at most {max_length} values",
    "too_short": "a list of at least {min_length} values",
}

#: What to do about a bound, by how its rule begins.
REMEDIES = (
    ("at least", "raise it"),
    ("above", "raise it"),
    ("at most", "lower it"),
    ("below", "lower it"),
)


def broken_rule(name: str, error: ErrorDetails) -> str:
    """Return the sentence on a value that breaks a rule: name, value, rule and remedy."""
    kind, given = error["type"], error.get("input")
    rule = RULES.get(kind, "of another kind").format(**error.get("ctx", {}))
    unit = unit_of(name)
    rule += f" in {unit}" if unit and rule == RULES["float_type"] else ""
    rule = rule.replace(" 1 values", " one value")
    return f"{name} is {_shown(given)}, but it must be {rule}; {_remedy(rule, given)}"


def _shown(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text)} characters)"


def _remedy(rule: str, given: Any) -> str:
    meant = meant_number(given) if isinstance(given, str) else None
    if "number" in rule and meant is not None and ("whole" not in rule or meant == round(meant)):
        return f"write {meant:g}"
    if "number" in rule and isinstance(given, str) and meant is None:
        return "write the number alone, without a unit"
    if rule.startswith("a list in") and isinstance(given, int | float):
        return f"write [{given:g}]"
    if rule == "a table of keys":
        return "give its keys one by one"
    return next(
        (remedy for start, remedy in REMEDIES if rule.startswith(start)), "correct the value"
    )
