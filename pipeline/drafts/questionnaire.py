"""Answers on a study, all at once: a text by key, each with its fault.

Reading of the answers, checks and the questions of a new study are those of the dialogue of a
terminal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.diagnose.study_keys import Data
from dogshape.pipeline.drafts.draft_keys import PARTS
from dogshape.pipeline.drafts.study_folder import (
    Questions,
    draft_study,
    is_void,
    questions_of,
    user_values,
    value_of,
)
from dogshape.sim.errors import DogshapeError, InputError

#: Name of the study before its only mistake.
_PLACE = re.compile(r"\Athe (?:study \S+|draft): ")


@dataclass(frozen=True)
class Answers:
    """Answers on a study, read and checked; mappings by dotted key, in order of the page.

    A key without a readable answer has its default.
    """

    defaults: Data
    answers: Data
    faults: dict[str, str]  #: sentences on wrong answers
    refusal: str  #: sentences on mistakes that concern no key alone; empty without one
    study: Setup | None  #: of the answers; None if they make none
    typed_keys: frozenset[str] = field(default=frozenset(), kw_only=True)  #: see ``user_values``

    @property
    def is_valid(self) -> bool:
        """Whether the answers make a study."""
        return self.study is not None

    @property
    def values(self) -> Data:
        """Values of the user by dotted key."""
        return user_values({}, self.answers, self.defaults, self.typed_keys)


@dataclass(frozen=True)
class Questionnaire(Answers):
    """Questions of a new study with its answers."""

    origin: str  #: kind, study or bench that the study begins from
    questions: dict[str, str]


def read_questionnaire(origin: str, texts: Mapping[str, str]) -> Questionnaire:
    """Read all answers to the questions of a new study; an empty text takes the default.

    The answers to a part decide the defaults of the next one. Raises InputError for an origin that
    is no study.
    """
    defaults: Data = {}
    questions: dict[str, str] = {}
    answers: Data = {}
    faults: dict[str, str] = {}
    typed_keys: set[str] = set()
    for part in PARTS.values():
        values = user_values({}, answers, defaults, typed_keys)
        part_questions = _part_questions(origin, values, part)
        for key, default in part_questions.defaults.items():
            if is_void(key, answers):
                continue
            text = texts.get(key, "")
            defaults[key] = default
            questions[key] = part_questions.words[key]
            read_answer(key, text, default, answers=answers, faults=faults)
            if text.strip() and key not in faults and key in part_questions.used_keys:
                typed_keys.add(key)
    study, study_faults, refusal = check_answers(
        partial(draft_study, origin),
        answers,
        defaults,
        answer_faults=faults,
        typed_keys=typed_keys,
    )
    return Questionnaire(
        defaults=defaults,
        answers=answers,
        faults=study_faults,
        refusal=refusal,
        study=study,
        origin=origin,
        questions=questions,
        typed_keys=frozenset(typed_keys),
    )


def read_answer(
    key: str, text: str, default: Any, *, answers: Data, faults: dict[str, str], example: Any = None
) -> None:
    """Add an answer to ``answers``, or its default and the reason to ``faults``.

    An empty text takes the default. ``example`` is a value of the type of the answers, for a key
    whose default is None.
    """
    answers[key] = default
    if not text.strip():
        return
    typical_value = example if default is None else default
    try:
        answers[key] = value_of(key, text.strip(), default=typical_value, answers=answers)
    except InputError as error:
        faults[key] = str(error)


def _part_questions(origin: str, values: Data, part: Mapping[str, str]) -> Questions:
    """Return the questions of a part, those of the origin itself after wrong values."""
    try:
        return questions_of(origin, values, part)
    except DogshapeError:
        return questions_of(origin, {}, part)


def check_answers(
    build: Callable[[Data], Setup],
    answers: Data,
    defaults: Data,
    answer_faults: Mapping[str, str],
    typed_keys: Collection[str] = (),
) -> tuple[Setup | None, dict[str, str], str]:
    """Build the study; add its mistakes to ``answer_faults``, and join those without a key.

    ``build`` makes the study of the values of a user, or raises DogshapeError. A study refuses its
    mistakes in groups, so it is built again with defaults for wrong answers; sentences on these
    defaults are left out. ``typed_keys`` are those of ``user_values``.
    """
    faults = dict(answer_faults)
    replaced_keys = set(faults)
    while True:
        checked = {key: defaults[key] if key in replaced_keys else answers[key] for key in answers}
        values = user_values({}, checked, defaults, set(typed_keys) - replaced_keys)
        try:
            study = build(values)
        except DogshapeError as error:
            sentences, refusal = assign_sentences(str(error), answers)
            for sentence, keys in sentences.items():
                if not replaced_keys.intersection(keys):
                    faults |= dict.fromkeys(keys, sentence)
            if refusal and not replaced_keys:
                return None, faults, refusal
            named_keys = {key for keys in sentences.values() for key in keys}
            if not values.keys() & named_keys:
                return None, faults, ""
            replaced_keys |= named_keys
        else:
            return (None if faults else study), faults, ""


def assign_sentences(message: str, keys: Iterable[str]) -> tuple[dict[str, list[str]], str]:
    """Return the sentences of an error with the keys that they name, and the others joined.

    Keys of a remedy count where quantity and rule name none.
    """
    head, *sentences = message.split("\n- ")
    keys_by_sentence: dict[str, list[str]] = {}
    other_sentences = []
    for sentence in sentences or [_PLACE.sub("", head)]:
        rule, _, remedy = sentence.partition("; ")
        named_keys = _named_keys(rule, keys) or _named_keys(remedy, keys)
        if named_keys:
            keys_by_sentence[sentence] = named_keys
        else:
            other_sentences.append(sentence)
    return keys_by_sentence, "\n".join(other_sentences)


def _named_keys(text: str, keys: Iterable[str]) -> list[str]:
    """List the keys that a text names."""
    return [key for key in keys if re.search(rf"(?<![\w.]){re.escape(key)}(?!\w)", text)]
