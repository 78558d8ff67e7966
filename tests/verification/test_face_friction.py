"""Friction of faces on faces beside that of flanks and edges, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import CONTACT_SETS, Clutch, OperatingPoint
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.statistics.shift_records import clutch_record, content_key
from dogshape.sim.statistics.uncertainty import Variant
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.units import DEG, RPM
from tests.verification.test_planar import force_of

FILM = 0.03  #: friction of faces on faces


def _filmed(clutch: Clutch, film: float | None = FILM) -> Clutch:
    """Give the clutch a film on its faces, in the compiled engine."""
    contact = replace(clutch.contact, face_friction=film)
    return replace(clutch.with_engine("planar"), contact=contact)


@pytest.mark.parametrize("film", [FILM, 0.05, None])
def test_a_ring_on_its_faces_slows_by_the_friction_of_faces(
    clutch: Clutch, film: float | None
) -> None:
    """Flat tips: the relative speed falls by mu F r/J, J that of the relative motion."""
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=0.0, axial_gap=1e-5))
    dog, force = flat.dog, 235.0
    point = OperatingPoint(20.0 * RPM, ForceProfile(force, 1e-4))
    # From where the trailing half of a face still meets the other one.
    angle = -0.25 * dog.tip_width / dog.mean_radius
    trace = engage(_filmed(flat, film), point, angle).trace
    early, late = np.interp([2e-3, 4e-3], trace.time, trace.relative_speed)
    slope = (late - early) / 2e-3
    friction = flat.contact.dynamic_friction if film is None else film
    expected = -friction * force * dog.mean_radius / flat.rings.reduced_inertia
    assert slope == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("edge_mm", [0.0, 0.3])
def test_flanks_and_edges_keep_the_friction_of_the_contact(clutch: Clutch, edge_mm: float) -> None:
    """Forces differ where faces meet faces alone, and never where dogs lie in their slots."""
    dog = replace(clutch.dog, edge_radius=edge_mm * 1e-3)
    plain, film = (PlanarClutch(_filmed(replace(clutch, dog=dog), mu)) for mu in (None, FILM))
    rng, seated, faces = np.random.default_rng(3), 0, 0
    for _ in range(2000):
        angle = rng.uniform(-0.5, 0.5) * dog.pitch_angle
        depth = rng.uniform(0.0, dog.height)
        place = angle, dog.height - depth, 3.0, 0.05
        with_film, without = force_of(film, *place), force_of(plain, *place)
        if depth > 0.5 * dog.height and abs(angle) > 0.45 * dog.pitch_angle:
            seated += with_film[1] != 0.0
            assert with_film == without
        faces += with_film != without
    assert seated > 20
    assert faces > 100


def test_faces_press_and_rub_by_their_own_coefficient(clutch: Clutch) -> None:
    """On flat faces: torque over force and radius is the coefficient at fast slip."""
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=0.0))
    for film in (0.02, 0.05):
        axial, torque = force_of(
            PlanarClutch(_filmed(flat, film)), 0.0, flat.dog.height - 1e-5, 50.0, 0.0
        )
        assert abs(torque) / axial / flat.dog.mean_radius == pytest.approx(film, rel=0.01)


def test_checks_of_flanks_take_the_friction_of_flanks() -> None:
    """The faces alone release by the film: 1.7 instead of 6.8 degrees."""
    plain = load_study("mq200", ["load.release_by_itself=true"])
    film = load_study("mq200", ["load.release_by_itself=true", f"contact.face_friction={FILM}"])
    before, after = (
        {check.name: check for check in strength_checks(study.clutch.dog, study.limits)}
        for study in (plain, film)
    )
    assert after.keys() == before.keys()
    assert {"pull_out_force", "retention_traction", "traction_release"} <= after.keys()
    moved = {name for name, check in after.items() if check != before[name]}
    assert moved == {"chamfer_release"}
    assert after["chamfer_release"].limit == pytest.approx(math.atan(FILM) / DEG, rel=1e-6)


def test_a_film_is_part_of_the_key_and_its_absence_is_not(clutch: Clutch) -> None:
    record = clutch_record(_filmed(clutch))
    assert record["face_friction"] == FILM
    bare = clutch_record(_filmed(clutch, None))
    assert "face_friction" not in bare
    assert content_key(bare) != content_key(record)


def test_factors_and_effects_of_friction(clutch: Clutch) -> None:
    """An uncertain factor scales the film too; the effect of other friction sets the flanks'."""
    drawn = Variant(1.2, 1.0, 1.0, 0.1, (), 0.5).clutch(_filmed(clutch)).contact
    assert drawn.face_friction == pytest.approx(1.2 * FILM)
    assert drawn.static_friction == pytest.approx(1.2 * clutch.contact.static_friction)
    assert drawn.dissipation == pytest.approx(0.5 * clutch.contact.dissipation)
    setting = Setting(_filmed(clutch), OperatingPoint(1.0, ForceProfile(235.0, 0.25)))
    values = {"static_friction": 0.2, "dynamic_friction": 0.15}
    changed = load()["contact_friction"].apply(setting, values).clutch.contact
    assert (changed.static_friction, changed.dynamic_friction) == (0.2, 0.15)
    assert changed.face_friction == FILM


def test_drake_and_impact_refuse_a_film(clutch: Clutch) -> None:
    remedy = r"contact.face_friction is 0.03, but .*Drake.*|.*solver.engine is 'drake'.*planar"
    with pytest.raises(InputError, match=remedy):
        load_study("mq200", [f"contact.face_friction={FILM}", "solver.engine=drake"])
    with pytest.raises(InputError, match="IMPACT acts on a whole dog"):
        replace(CONTACT_SETS["adams_impact"], face_friction=FILM)
    study = load_study("mq200", [f"contact.face_friction={FILM}"])
    assert study.clutch.solver.engine == "planar"
    assert study.reference_setup is None
    assert "contact.face_friction" in study.engine_gap
    assert clutch.contact.face_friction is None
