"""Lists that the recipes of ``CONTRIBUTING.md`` extend, compared with each other without extras."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from pydantic import BaseModel

from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.config.schema import StudyFile
from dogshape.sim.clutch_tables import section_in
from dogshape.sim.effects import EFFECTS
from dogshape.validation.blind.stand import Truth
from dogshape.validation.blind.true_effects import RANGES, SWITCHES

ROOT = Path(__file__).parents[2]
BLIND = ROOT / "validation" / "blind"
#: Modules of the blind check by engine, and those that serve both.
ENGINES = {"mujoco": ("mujoco_model", "mujoco_shift"), "planar": ("planar_shift",)}
COMMON = ("stand", "data")
#: Pages that explain the keys of a study file.
PAGES = ("docs/studies.md", "docs/strength.md", "studies/mq200/study.toml")


def test_blind_ranges_are_those_of_the_effects() -> None:
    """A new effect has its ranges in the blind check, or is a nuisance of the diagnosis."""
    assert set(EFFECTS) - set(RANGES) == set(USUAL.nuisance)
    assert set(RANGES) <= set(EFFECTS)
    for name, ranges in RANGES.items():
        parameters = EFFECTS[name].parameters
        assert [(r.name, r.low, r.high) for r in ranges] == [
            (p.name, p.low, p.high) for p in parameters
        ], name
        assert [r.log for r in ranges] == [p.scale == "log-uniform" for p in parameters], name
        assert ranges or name in SWITCHES, name


def _truth_fields(module: str) -> set[str]:
    """List the fields of the truth that a module of the blind check reads."""
    tree = ast.parse((BLIND / f"{module}.py").read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if owner in ("truth", "self.truth") or (module == "stand" and owner == "self"):
                names.add(node.attr)
    return names


@pytest.mark.parametrize("engine", ENGINES)
def test_each_blind_range_acts_in_both_engines(engine: str) -> None:
    """A range names a field of the truth that the engine, or code of both engines, reads."""
    truth_fields = {field.name for field in fields(Truth)}
    read = set[str]().union(*map(_truth_fields, (*ENGINES[engine], *COMMON)))
    for effect, ranges in RANGES.items():
        for name in [*(r.field for r in ranges), *filter(None, [SWITCHES.get(effect)])]:
            assert name in truth_fields, f"{effect}: Truth has no field '{name}'"
            assert name in read, f"{effect}: {ENGINES[engine]} do not read truth.{name}"


def _keys_of(section: type[BaseModel], table: str = "") -> Iterator[str]:
    """List the dotted keys of a section and of the sections in it."""
    for name, field in section.model_fields.items():
        inner = section_in(field.annotation)
        if inner is None:
            yield f"{table}{name}"
        else:
            yield from _keys_of(inner, f"{table}{name}.")


def test_each_key_of_a_study_file_is_explained() -> None:
    """As `table.key`, `key`, ``key = value`` or ``[table.key]`` on a page of the keys."""
    text = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    missing = []
    for key in _keys_of(StudyFile):
        table, _, name = key.rpartition(".")
        names = rf"(?:{re.escape(table)}\.)?{re.escape(name)}"
        spellings = rf"`{names}`|^#? ?{names} *=|^\[{re.escape(key)}\]|`\[{re.escape(key)}\]`"
        if not re.search(spellings, text, re.MULTILINE):
            missing.append(key)
    assert not missing, f"{missing} have no row in docs/studies.md"
