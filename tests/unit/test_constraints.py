"""Pinned packages: each can be installed with the Python that Debian 12 has."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

DEBIAN = "3.11.2"  #: of Debian 12
PINS = (Path(__file__).parents[2] / "constraints.txt").read_text("utf-8").split()


@pytest.mark.parametrize("pin", PINS)
def test_a_pin_allows_debians_python(pin: str) -> None:
    """A pin that asks for a later patch level installs here, and not on a fresh machine."""
    name, version = pin.partition(";")[0].split("==")
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return  # of an extra that is not here
    wanted = found.metadata.get("Requires-Python")
    assert wanted is None or SpecifierSet(wanted).contains(DEBIAN)
    assert found.version.partition("+")[0] == version
