"""Checks of many designs at once against those of each, for designs drawn at random."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.design import (
    Design,
    DesignGroup,
    design_of,
    mark_worthy,
    worth_simulating,
)
from dogshape.predictions import has_common_limits, judge_designs
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import Dogs
from dogshape.sim.strength.dog_strength import margin_losses, strength_checks
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.units import DEG, MM

NAMES = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
DESIGNS = 120
CLOSE = np.array([[0.0, 22.0], [2.0, 32.0], [2.0, 32.0], [1.2, 7.0], [5, 40]])
SETTINGS: dict[str, tuple[str, ...]] = {
    "coast, abuse, a thin rim and a pull": (
        "load.coast_share=0.4", "load.abuse_torque_Nm=600", "manufacturing.rim_mm=2.5",
        "load.release_by_itself=false", "load.pull_out_force_limit_N=500",
        "mechanism.spline_friction=0.1", "mechanism.spline_radius_mm=18",
    ),
    "exact dimensions": tuple(
        f"tolerance.{name}=0"
        for name in ("chamfer_deg", "traction_deg", "height_mm", "root_radius_mm")
    ),
    "wide tolerances": ("tolerance.traction_deg=3", "tolerance.height_mm=1.5"),
    "pitch errors and rounded edges": (
        "load.accuracy=8", "load.run_out_um=20", "dog.edge_radius_mm=0.2"
    ),
    "load spectrum and flank strike": (
        "load.spectrum=[[1.0, 1e4], [0.6, 1e6], [-0.8, 1e5]]", "load.accuracy=7",
        "strike.ring_inertia_kgm2=[2e-4,1e-3]", "strike.input_stiffness_Nm_rad=5000",
    ),
}  # fmt: skip


def _drawn(ranges: Array, seed: int) -> Array:
    low, high = ranges.T
    x: Array = low + np.random.default_rng(seed).random((DESIGNS, len(low))) * (high - low)
    x[:, -1] = np.round(x[:, -1])
    return x


def _dogs(study: Any, x: Array) -> Dogs:
    own = study.clutch.dog
    return Dogs(
        x[:, 4], *(x[:, :3] * DEG).T, x[:, 3] * MM, own.outer_diameter, own.inner_diameter,
        own.axial_gap, own.edge_radius,
    )  # fmt: skip


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of shapes that cannot be
def test_many_designs_have_the_checks_of_each(name: str) -> None:
    study = load_study("mq200_paper", SETTINGS[name])
    x = _drawn(CLOSE, 1)
    possible = np.asarray(_dogs(study, x).possible)
    assert 20 < possible.sum() < DESIGNS
    together = strength_checks(_dogs(study, x[possible]), study.limits)
    margins = np.column_stack([np.broadcast_to(one.margin, possible.sum()) for one in together])
    for row, found in zip(x[possible].tolist(), margins, strict=True):
        checks = strength_checks(study.dog_with(dict(zip(NAMES, row, strict=True))), study.limits)
        assert [one.rule for one in together] == [check.rule for check in checks]
        assert found == pytest.approx([check.margin for check in checks], rel=1e-12, abs=1e-12)


RIDGES = {
    "dog.crest": 0.5, "dog.chamfer_back_deg": 12.0, "variables.crest": [0.0, 1.0],
    "variables.chamfer_back_deg": [2.0, 30.0], "variables.backlash_mm": [0.0, 1.0],
}  # fmt: skip


BOTH_RINGS = {
    "dog.crest": 0.6,
    "dog.chamfer_back_deg": 9.0,
    "variables.output_dog.height_mm": [2.0, 5.0],
    "variables.output_dog.chamfer_deg": [4.0, 20.0],
    "variables.output_dog.crest": [0.2, 0.9],
    "variables.output_dog.chamfer_back_deg": [2.0, 20.0],
    "variables.output_dog.backlash_mm": [0.0, 0.8],
    "output_dog.material": "42CrMo4",
}  # fmt: skip
LOW_DOGS = {
    "dog.count": 16, "output_dog.slots_per_dog": 2, "output_dog.low_height_mm": 2.0,
    "variables.count": None,
}  # fmt: skip


def test_undercut_dogs_of_both_rings_are_marked_as_each() -> None:
    """The play at the mouth of a slot is that of each output dog beside its own sliding dog."""
    study = load_study("motorcycle", {"variables.output_dog.height_mm": [3.0, 6.0]})
    low_ends, high_ends = np.array([*study.variables.values()], dtype=float).T
    shares = np.random.default_rng(1).random((200, len(study.variables)))
    designs = [study.params_of(row) for row in low_ends + shares * (high_ends - low_ends)]
    allowed = [worth_simulating(study, design) for design in designs]
    assert 5 <= sum(allowed) < len(designs)
    assert mark_worthy(study, designs).tolist() == allowed


@pytest.mark.parametrize("limits", [{}, {"search.limits.smallest_margin_worst": -0.5}])
@pytest.mark.parametrize("low", [{}, LOW_DOGS])
def test_designs_of_both_rings_are_marked_as_each(
    limits: dict[str, Any], low: dict[str, Any]
) -> None:
    """Output dogs of many designs, each beside its sliding dog, also at every deviation."""
    study = load_study("mq200_paper", BOTH_RINGS | limits | low)
    ranges = np.array([*study.variables.values()], dtype=float)
    low_ends, high_ends = ranges.T
    shares = np.random.default_rng(3).random((200, len(ranges)))
    designs = [study.params_of(row) for row in low_ends + shares * (high_ends - low_ends)]
    allowed = [worth_simulating(study, design) for design in designs]
    assert mark_worthy(study, designs).tolist() == allowed
    names = tuple(study.variables)
    group = DesignGroup.of(study, names, study.rows(designs))
    places = np.flatnonzero(group.possible)[:20]
    assert len(places) >= 5
    group = DesignGroup.of(study, names, study.rows([designs[place] for place in places]))
    losses = margin_losses(group.dogs, group.study.limits)
    for row, place in enumerate(places[:5].tolist()):
        single = study.with_design(designs[place]).limits
        for name, spread in margin_losses(study.dog_with(designs[place]), single).items():
            worst_case = np.broadcast_to(losses[name].worst_case, len(places))[row]
            assert worst_case == pytest.approx(spread.worst_case, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "settings",
    [{"dog.edge_radius_mm": 0.2}, {"search.limits.smallest_margin_worst": 0.0}, RIDGES, BOTH_RINGS],
    ids=["edge", "worst", "ridge", "both rings"],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of shapes that cannot be
def test_verdicts_are_those_of_each_design(settings: dict[str, Any]) -> None:
    study = load_study("mq200_paper", settings)
    names, ridge = (*study.variables,), settings is RIDGES
    is_searched = ridge or settings is BOTH_RINGS
    ranges = np.array([*study.variables.values()], dtype=float) if is_searched else CLOSE
    assert has_common_limits(study, names) == ("search" not in str(settings))
    x = ranges[:, 0] + np.random.default_rng(7).random((60, len(names))) * np.ptp(ranges, axis=1)
    x[:, names.index("count")] = np.round(x[:, names.index("count")])
    if ridge:
        x[0, names.index("crest")] = 1.0
    found = judge_designs(study, names, x)
    assert 0 < found.real.sum() < len(x)
    assert not ridge or "ridge stands on the traction edge" in found.reason[0]
    for place, row in enumerate(x):
        try:
            design = design_of(study, study.params_of(row))
        except DogshapeError as error:  # values that no dog can have
            design = Design(study, {}, None, (), str(error))
        assert found.real[place] == (design.dog is not None)
        assert found.feasible[place] == design.feasible
        broken = [c.name for c in design.checks if c.name in MAKEABLE and not c.passed]
        words = f"cannot be made: fails {', '.join(broken).replace('_', ' ')}" if broken else ""
        assert found.reason[place] == (design.refusal or words)
        if design.dog is not None:
            # The margin at worst-case tolerances sums up the others and is none of them. Of two
            # that are equally small either may be named.
            margins = {c.name: c.margin for c in design.checks if c.name != "smallest_margin_worst"}
            least = pytest.approx(min(margins.values()), rel=1e-9, abs=1e-12)
            assert found.smallest_margin[place] == least
            assert margins[found.worst_check[place]] == least
