"""Rules of the study file, of bench.toml and of options, in sentences of the project's own."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel, ValidationError

from dogshape.diagnosis.bench.stand_file import _BenchFile
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.clutch_tables import RULES, broken_rule
from dogshape.sim.errors import InputError

#: One of these breaks any rule that a key may have.
BAD: tuple[Any, ...] = (
    None, True, "", "x", "3,7", "a b", "n" * 300, 1.5, -1, 0, 1e9,
    10**30, [], [1], [1, 2, 3] * 2000, ["x"], [-1.5, "y"], {}, {"x": 1},
)  # fmt: skip
#: Words of the validator, none of which is to reach a user.
THEIRS = ("input should", "valid dictionary", "instance of", "unable to parse", "after validation",
          "should match pattern", "extra inputs", "field required")  # fmt: skip


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        yield annotation
    for one in get_args(annotation):
        yield from _sections(one)


def _models(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    yield model
    for field in model.model_fields.values():
        for section in _sections(field.annotation):
            yield from _models(section)


def _faults(model: type[BaseModel]) -> Iterator[tuple[str, Any, Any]]:
    """Every key of a table with every bad value, and what the validator says."""
    for name in model.model_fields:
        for value in BAD:
            try:
                model.__pydantic_validator__.validate_assignment(
                    model.model_construct(), name, value
                )
            except ValidationError as error:
                yield from ((name, value, one) for one in error.errors())


@pytest.mark.parametrize("file", [StudyFile, _BenchFile])
def test_every_rule_of_the_files_has_a_sentence(file: type[BaseModel]) -> None:
    kinds = set()
    for model in set(_models(file)):
        for name, _, fault in _faults(model):
            if fault["type"] in {"missing", "extra_forbidden", "frozen_instance"}:
                continue  # these are sentences of their own
            kinds.add(fault["type"])
            sentence = broken_rule(name, fault)
            assert "of another kind" not in sentence, fault
            assert "{" not in sentence.replace(repr(fault["input"]), ""), sentence
            assert not any(words in sentence.lower() for words in THEIRS), sentence
            assert len(sentence) < 300
    assert kinds <= set(RULES)
    assert {"float_type", "int_type", "string_type", "list_type"} <= kinds


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["name=a b"], "name is 'a b', but it must be letters, digits"),
        (["name='x" + "x" * 200 + "'"], "(203 characters), but it must be not longer than 100"),
        (["dog.height_mm='3,7'"], "but it must be a number in mm; write 3.7"),
        (["dog.height_mm='3.7 mm'"], "write the number alone, without a unit"),
        (["dog=3"], "dog is 3, but it must be a table of keys; give its keys one by one"),
        (["operating.force_N=469"], "must be a list in square brackets; write [469]"),
        (["operating.force_N=300,400"], "write [300,400]"),
        (["operating=3"], "operating is 3, but it must be a table of keys"),
        (["operating.force_N=300,5 400"], "write [300.5,400]"),
        (["search.objectives=shift_time"], "write ['shift_time']"),
        (["search.trials=10001"], "search.trials is 10001, but it must be at most 10000; lower it"),
    ],
)
def test_sentences(overrides: list[str], words: str) -> None:
    with pytest.raises(InputError) as refused:
        load_study("mq200_paper", overrides)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_all_mistakes_of_a_study_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        load_study("mq200_paper", ["dog.height_mm=x", "dog.cuont=3", "search.trials=0", "name=a b"])
    first, *faults = str(refused.value).splitlines()
    assert first.endswith("with --set: 4 mistakes")
    assert [fault.split()[1] for fault in faults] == [
        "'dog.cuont'", "name", "dog.height_mm", "search.trials",
    ]  # fmt: skip
