"""Plausibility of a study's own clutch: units in doubt, dogs that cannot engage, lossy slides.

Nothing here is refused: a clutch may be as unusual as its values say.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from dogshape.pipeline.config.study_file import Setup
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.shift.pair import Pair
from dogshape.sim.shift.slide import LOSS_LIMIT, slide_loss, sliding_faces, stiffness_for_loss
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.dog_strength import outside_fit, strength_checks
from dogshape.sim.strength.materials import DENSITY, STATIC_CYCLES
from dogshape.sim.units import DEG, MM, RPM

#: Utilisation of the dogs below which a torque may be in kN m; it usually is a third to one.
MIN_UTILISATION = 0.01
MAX_RADIAN_DEG = 0.55  #: deg below which an angle may be in radians; no dog has 32 deg and more
#: Usual ratios of a value to a reference, smallest and largest, with the reference in words. The
#: prototype has 9, 58 and 60, a truck some 10, 50 and 10,000.
USUAL_RATIOS = {
    "sliding.mass_kg": (0.1, 1e3, "a steel ring twice as high as the dogs; is it in kg?"),
    "sliding.inertia_kgm2": (0.1, 1e5, "the ring's mass at the dogs; is it in kg m2?"),
    "output.inertia_kgm2": (1e-3, 2e5, "sliding.inertia_kgm2; is it in kg m2?"),
}


def notes_of(study: Setup) -> list[str]:
    """List warnings about the study's own dog, also of a root outside its formula's fit."""
    clutch = study.clutch
    root_faults = []
    if study.limits.sleeve is None:
        root_faults = outside_fit(clutch.dog, study.limits.root_radius)
        if not clutch.pair.alike:
            output_faults = outside_fit(clutch.pair.output, study.limits.root_radius)
            root_faults += [f"output ring: {fault}" for fault in output_faults]
    notes = [f"{fault}; --fem checks it" for fault in root_faults]
    if study.limits.strikes and clutch.mechanism.ring_inertia == 0.0:
        notes.append(
            f"times are simulated with {clutch.rings.sliding_inertia:.4g} kg m2 rigid at the "
            "flanks, [strike] judges a ring on its shaft; give mechanism.ring_inertia_kgm2 and "
            "input_stiffness_Nm_rad for both"
        )
    notes += _strike_notes(study)
    return [*notes, *slips_of(study), *drag_notes(study), *slide_notes(study)]


def _strike_notes(study: Setup) -> list[str]:
    """List a warning of a strike at the largest mismatch of a draw without bounds."""
    drawn = study.file.operating.mismatch_rpm
    strike = study.file.strike
    if strike is None or strike.mismatch_rpm is not None or not isinstance(drawn, Distribution):
        return []
    if all(map(math.isfinite, drawn.bounds)):
        return []
    largest_rpm = max(abs(point.mismatch) for point in study.points) / RPM
    return [
        f"flanks strike at {largest_rpm:.4g} 1/min, the largest mismatch of {len(study.points)} "
        "operating points that are drawn without bounds; give strike.mismatch_rpm, or low and high "
        "of operating.mismatch_rpm"
    ]


def drag_notes(study: Setup) -> list[str]:
    """List a warning of drag on shafts at rest, which occurs on a stand only."""
    drag = study.clutch.mechanism.drag_torque
    if drag == 0.0 or study.clutch.drive.turns:
        return []
    return [
        f"mechanism.drag_torque_Nm is {drag:.4g} N m and the sliding ring stands before the shift: "
        "the drag holds it, where it brakes a ring that turns in a gearbox; "
        "drive.shaft_speed_rpm makes both shafts turn"
    ]


def slide_notes(study: Setup) -> list[str]:
    """List a warning for each face whose slide loses more than ``LOSS_LIMIT`` to dissipation.

    Only faces that slide from rest count; friction holds the others, and the mismatch alone
    moves them.
    """
    contact = study.clutch.contact
    if study.uncertainty is not None:
        factor = study.uncertainty.mean("dissipation_factor")
        contact = replace(contact, dissipation=factor * contact.dissipation)
    clutch = replace(study.clutch, contact=contact)
    force = max(point.profile.force for point in study.points)
    notes = []
    for face in sliding_faces(clutch):
        loss = slide_loss(clutch, force, face)
        if loss <= LOSS_LIMIT or math.tan(face.slope) <= contact.face_dynamic_friction:
            continue
        stiffness = stiffness_for_loss(clutch, force, face, LOSS_LIMIT)
        damping = contact.dissipation * LOSS_LIMIT / loss
        remedy = f"contact.stiffness_Pa_m = {_round_up(stiffness):.2g}"
        if math.isnan(stiffness):
            remedy = f"a contact.dissipation_s_m of {damping:.2g} on the mean"
        notes.append(
            f"faces of {face.slope / DEG:.3g} deg that slide under {force:.4g} N lose about "
            f"{100.0 * min(loss, 1.0):.2g} % of the axial power to the dissipation of the contact, "
            f"{contact.dissipation:.3g} s/m, and none of it is friction; "
            f"{remedy} keeps it to {100.0 * LOSS_LIMIT:g} %"
        )
    return list(dict.fromkeys(notes))


def _round_up(value: float) -> float:
    """Round a positive number up to two digits; NaN stays."""
    if math.isnan(value):
        return value
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit) * unit


def slips_of(study: Setup) -> list[str]:
    """List questions about units in doubt, and a warning of flanks without play."""
    return [*_load_slips(study), *motion_slips(study)]


def motion_slips(study: Setup) -> list[str]:
    """List the questions of ``slips_of`` about what moves, not about its load."""
    return [
        *_angle_slips(study.clutch.dog),
        *_size_slips(study),
        *_ring_slips(study),
        *_play_notes(study.clutch.pair, study.limits.tolerances.mouth_play),
    ]


def _load_slips(study: Setup) -> list[str]:
    """Ask for the unit of a torque that the dogs hardly notice, and of a short life."""
    notes = []
    static_limits = replace(study.limits, strikes=())
    checks = strength_checks(study.clutch.dog, static_limits)
    utilisation = max(check.utilisation for check in checks if check.rule.group == "load")
    if utilisation < MIN_UTILISATION:
        notes.append(
            f"the torque uses at most {100 * utilisation:.2g} % of what the dogs bear; "
            "is load.torque_Nm in N m?"
        )
    load = study.limits.load
    if load.shifts < STATIC_CYCLES and not load.spectrum:
        notes.append(
            f"load.shifts is {load.shifts:.4g} over the life, which the static strength bears; is "
            "it in shifts?"
        )
    return notes


def _angle_slips(dog: Dog) -> list[str]:
    """Ask for the unit of angles that are usual numbers of radians."""
    notes = []
    for name in ("chamfer", "chamfer_back", "traction", "braking"):
        angle = getattr(dog, name) / DEG
        if 0.0 < abs(angle) < MAX_RADIAN_DEG:
            notes.append(
                f"dog.{name}_deg is {angle:.4g} deg; is it in degrees? "
                f"{angle:.4g} rad are {math.degrees(angle):.3g} deg"
            )
    return notes


def _size_slips(study: Setup) -> list[str]:
    """Ask for the unit of mass and inertias that are unusual for the size of the dogs."""
    dog = study.clutch.dog
    rings = study.clutch.rings
    area = math.pi * (dog.outer_radius**2 - dog.inner_radius**2)
    values_and_references = {
        "sliding.mass_kg": (rings.mass, DENSITY * area * 2.0 * dog.height),
        "sliding.inertia_kgm2": (rings.sliding_inertia, rings.mass * dog.mean_radius**2),
        "output.inertia_kgm2": (rings.output_inertia, rings.sliding_inertia),
    }
    notes = []
    for key, (value, reference) in values_and_references.items():
        low, high, words = USUAL_RATIOS[key]
        ratio = value / reference
        if not low <= ratio <= high:
            notes.append(f"{key} is {value:.6g}, {ratio:.3g} times {words}")
    return notes


def _play_notes(pair: Pair, pitch_error: float) -> list[str]:
    """Warn of flanks whose play is less than the ``pitch_error`` of both rings, m.

    Undercut flanks have a check of their own (``mouth_play``).
    """
    play = pair.entry_play
    if pair.sliding.lean >= 0.0 and play < pitch_error:
        return [
            f"the flanks leave {play / MM:.3g} mm between a tip and the mouth of its "
            f"slot, and pitch errors take {pitch_error / MM:.2g} mm: this dog engages in the model "
            "alone, not when made; give it backlash (dog.backlash_mm)"
        ]
    return []


def _ring_slips(study: Setup) -> list[str]:
    """Ask for the units of toothing and inertia that no ring has."""
    dog = study.clutch.dog
    rings = study.clutch.rings
    mechanism = study.clutch.mechanism
    notes = []
    is_toothed = mechanism.spline_friction > 0.0
    radius = mechanism.spline_radius if is_toothed else SPLINE * dog.inner_radius
    if is_toothed and radius > dog.outer_radius:
        notes.append(
            f"mechanism.spline_radius_mm is {radius / MM:.4g} mm, outside the dogs, whose outer "
            f"radius is {dog.outer_radius / MM:.4g} mm; is it a diameter?"
        )
    # A part that slides on a toothing lies around it.
    min_inertia = rings.mass * min(radius, dog.inner_radius) ** 2
    for key, inertia in (
        ("sliding.inertia_kgm2", rings.sliding_inertia),
        ("mechanism.ring_inertia_kgm2", mechanism.ring_inertia or rings.sliding_inertia),
    ):
        if inertia < min_inertia:
            notes.append(
                f"{key} is {inertia:.3g} kg m2, but a ring of sliding.mass_kg = {rings.mass:.3g} "
                f"around a toothing of {radius / MM:.3g} mm has at least {min_inertia:.3g}; is the "
                "mass of the fork in it (mechanism.added_mass_kg), or the inertia in another unit?"
            )
            break
    return notes


def angle_notes(dog: Dog, angles: Iterable[float]) -> list[str]:
    """List notes on relative angles, deg, of more than one pitch, which are taken modulo."""
    pitch = dog.pitch_angle / DEG
    return [
        f"a relative angle of {angle:g} deg is taken modulo the pitch of {pitch:g} deg: "
        f"{angle % pitch:.4g} deg"
        for angle in angles
        if abs(angle) > pitch
    ]
