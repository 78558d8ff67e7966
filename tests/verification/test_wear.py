"""Wear of the faces: shape of a worn pair, Archard's law, and the profile that it leaves."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from dogshape.pipeline.config.study_file import load_study, wear_of
from dogshape.pipeline.simulate.evaluation import STAGES, life_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import section
from dogshape.sim.strength.landing import Wear, worn
from dogshape.sim.units import MM

DOG = load_study("mq200_paper").clutch.dog
QUICK = ["solver.engine=planar", "search.confirm_angles=4", "operating.mismatch_rpm=[50]"]


@pytest.mark.parametrize("loss", [0.01 * MM, 0.1 * MM, 0.2 * MM])
def test_a_worn_pair_has_lower_crests_and_nothing_else(loss: float) -> None:
    """Travel, flanks and braking edge stay where they were; the crest sinks along its flank."""
    pair = worn(DOG, loss)
    assert pair.travel == pytest.approx(DOG.travel)
    assert pair.axial_gap == pytest.approx(DOG.axial_gap + 2.0 * loss)
    (_, edge, crest, _), (_, old_edge, old_crest, _) = section(pair), section(DOG)
    assert edge == pytest.approx(old_edge)
    assert crest[1] == pytest.approx(old_crest[1] - loss)
    assert crest[0] == pytest.approx(old_crest[0] + loss * math.tan(DOG.traction))
    assert 0.0 < pair.chamfer < DOG.chamfer


def test_archard_takes_what_friction_works() -> None:
    """Volume of the wedges that all dogs of both rings lose: rate times work of friction."""
    rate, energy, friction, shifts = 1e-15, 2.0, 0.08, 1e5
    loss = Wear(rate=rate).loss(DOG, energy, friction, shifts)
    wedges = 2 * DOG.count * DOG.radial_width * 0.5 * loss * DOG.face_width
    assert wedges == pytest.approx(rate * shifts * energy / friction)
    assert 1e-6 < loss < 1e-4


def test_the_area_between_both_faces_is_the_wedge() -> None:
    """Old face less new face, by the points of both sections, to first order of the loss."""
    loss = 0.02 * MM
    (_, edge, crest, _), (_, _, sunk, _) = section(DOG), section(worn(DOG, loss))
    area = 0.5 * abs(
        (crest[0] - edge[0]) * (sunk[1] - edge[1]) - (sunk[0] - edge[0]) * (crest[1] - edge[1])
    )
    assert area == pytest.approx(0.5 * loss * DOG.face_width, rel=0.04)


def test_a_life_is_that_of_three_dogs() -> None:
    """Each stage is the worn dog simulated as a dog of its own."""
    worn_by = ["wear.crest_loss_mm=0.2", "wear.edge_radius_mm=0.4"]
    study = load_study("mq200_paper", [*QUICK, *worn_by])
    wear = wear_of(study.file)
    assert wear is not None
    rows = life_of(study, study.prototype, wear, scratch_executor())
    assert [row.life for row in rows] == [*STAGES]
    assert [row.crest_loss_mm for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert [row.edge_radius_mm for row in rows] == pytest.approx([0.0, 0.4 * math.sqrt(0.5), 0.4])
    pair = worn(DOG, 0.2 * MM)
    keys = {
        "dog.height_mm": pair.height / MM,
        "dog.axial_gap_mm": pair.axial_gap / MM,
        "dog.chamfer_deg": math.degrees(pair.chamfer),
        "dog.edge_radius_mm": 0.4,
    }
    sets = [*QUICK, *(f"{key}={value!r}" for key, value in keys.items())]
    other = load_study("mq200_paper", [*sets, "wear.crest_loss_mm=0.0"])
    (first, *_) = life_of(other, other.prototype, Wear(crest_loss=0.0), scratch_executor())
    assert rows[-1].expected_shift_time_s == pytest.approx(first.expected_shift_time_s)
    assert rows[-1].margins["chamfer_release"] < 0.0 < rows[0].margins["chamfer_release"]
    assert rows[-1].margins["contact_ratio"] < rows[0].margins["contact_ratio"]


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("wear.edge_radius_mm=0.001", "wear.edge_radius_mm is 0.001 mm"),
        ("wear={rate_mm3_Nm=1e-6, crest_loss_mm=0.1}", "give one and not both"),
        ("wear={}", "give one and not both"),
        ("wear.rate_mm3_Nm=1.0", "wear.rate_mm3_Nm is 1 mm3/(N m), but it must lie"),
        ("wear.crest_loss_mm=-1", "wear.crest_loss_mm is -1 mm"),
        ("wear.crest_los_mm=1", "did you mean 'wear.crest_loss_mm'"),
    ],
)
def test_wear_that_is_none_is_refused(more: str, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        load_study("mq200_paper", [more])
    assert sentence in str(refused.value)
    assert "wear" not in load_study("mq200_paper").file.model_dump()


def test_equal_shares_of_the_life_take_equal_areas_from_an_edge() -> None:
    """The square of a rounding's radius grows evenly; friction has to work for a rate."""
    dog, wear = replace(DOG, edge_radius=0.1 * MM), Wear(edge_radius=0.3 * MM)
    squares = [wear.edges(dog, share) ** 2 for share in (0.0, 0.5, 1.0)]
    assert squares == pytest.approx([0.01 * MM**2, 0.05 * MM**2, 0.09 * MM**2])
    with pytest.raises(InputError, match="edges do not get sharper"):
        wear.edges(replace(DOG, edge_radius=0.4 * MM), 0.5)
    with pytest.raises(InputError, match="dynamic_friction is 0"):
        Wear(rate=1e-15).loss(DOG, 1.0, 0.0, 1.0)
