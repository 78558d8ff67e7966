"""Pinned packages: each can be installed with the Python that Debian 12 has."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

DEBIAN = "3.11.2"  #: of Debian 12
PINS = (Path(__file__).parents[2] / "constraints.txt").read_text("utf-8").split()


def _installed(pin: str) -> tuple[str, str | None] | None:
    """Read version and wanted Python of a pinned package, None where it is not installed."""
    try:
        found = distribution(pin.partition("==")[0])
    except PackageNotFoundError:
        return None
    return found.version, found.metadata.get("Requires-Python")


@pytest.mark.parametrize("pin", PINS)
def test_a_pin_allows_debians_python(pin: str) -> None:
    """A pin that asks for a later patch level installs here, and not on a fresh machine."""
    found = _installed(pin)
    if found is None:
        assert "==" in pin  # of an extra that is not here
        return
    version, wanted = found
    assert wanted is None or SpecifierSet(wanted).contains(DEBIAN)
    assert version.partition("+")[0] == pin.partition("==")[2].partition(";")[0]
