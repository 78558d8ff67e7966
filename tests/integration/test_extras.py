"""Verbs that need an extra: finite elements of the root, and solids for CAD."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dogshape.validation.finite_elements.root_stress import fem_available
from tests.conftest import Said, needed

Call = Callable[..., Said]


def test_finite_elements_on_request(dogshape: Call) -> None:
    needed(fem_available(), "scikit-fem")
    said = dogshape("strength", "mq200_paper", "--no-simulation", "--fem", "--json").json
    rows = {(row["flank"], row["band"]): row for row in said["finite_elements"]}
    assert len(rows) == 6
    for row in rows.values():
        assert row["closed_form_MPa"] == pytest.approx(row["finite_elements_MPa"], rel=0.1)
    bending = next(c for c in said["checks"] if c["name"] == "root_bending_traction")
    assert rows["traction", "load"]["closed_form_MPa"] == pytest.approx(bending["value"])
