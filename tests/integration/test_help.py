"""The list of verbs: what each does is read from its source, and nothing slow is loaded for it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from dogshape.cli.app import VERBS, _Commands, _summary

HELP = "import sys; from dogshape.cli.app import app; app(['--help'], standalone_mode=False)"
SLOW = ("numpy", "pydrake", "pydantic", "pandas", "numba")


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_is_listed_with_its_own_first_sentence(verb: str) -> None:
    command = _Commands(VERBS)[verb]
    own = " ".join((command.help or "").partition("\n\n")[0].split())
    said = _summary(verb, 1000)
    assert len(said) > 10
    assert own.startswith(said.removesuffix("."))
    short = _summary(verb, 30)
    assert len(short) <= 30
    assert own.startswith(short.removesuffix("..."))


def test_help_loads_nothing_slow() -> None:
    loaded = f"{HELP}; print([name for name in {SLOW} if name in sys.modules])"
    said = subprocess.run(
        [sys.executable, "-c", loaded], capture_output=True, text=True, check=True
    )
    assert said.stdout.splitlines()[-1] == "[]"
    assert all(f"  {verb} " in said.stdout for verb in VERBS)
