"""Change of the expected shift time within the tolerances of the dimensions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Record
from dogshape.sim.clutch_tables import key
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.strength.manufacture import Spread
from dogshape.sim.units import suffix_of, to_si
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Surrogate


class ToleranceTime(Record):
    """Change of the expected shift time within the tolerances of the dimensions."""

    worst_case_s: float = key("all tolerances at their worst ends", "s")
    root_sum_square_s: float = key("root of the sum of squares over the dimensions", "s")
    by_dimension_s: dict[str, float] = key("change by dimension", "s")


def tolerance_time(
    study: Setup, surrogate: Surrogate, params: dict[str, float], mix: Mix
) -> ToleranceTime:
    """Compute the change of the expected shift time over a mix within the tolerances.

    Slopes are those of the surrogate; the axial gap adds free flight, in closed form. Diameters
    scale speed and width alike, and the root radius is not simulated: neither counts.
    """
    tolerances = study.limits.tolerances
    variables_of: dict[str, list[str]] = {}  # both rings deviate alike
    for variable in surrogate.data.variables:
        name = variable.removeprefix(OUTPUT_PREFIX).removesuffix(suffix_of(variable))
        if name in tolerances.dimensions:
            variables_of.setdefault(name, []).append(variable)
    changes = {}
    for name, variables in variables_of.items():
        step = tolerances.dimensions[name] / to_si(variables[0], 1.0)
        ends = [
            {**params, **{variable: params[variable] + change for variable in variables}}
            for change in (-step, step)
        ]
        low_time, high_time = surrogate.predict_medians(study.rows(ends), mix)
        changes[name] = 0.5 * float(high_time - low_time)
    gap_tolerance = tolerances.dimensions.get("axial_gap")
    if gap_tolerance:
        changes["axial_gap"] = _gap_time(study, mix, gap_tolerance)
    worst_case = sum(abs(change) for change in changes.values())
    spread = Spread(changes, worst_case, tolerances.statistical_share)
    return ToleranceTime(
        worst_case_s=spread.worst_case,
        root_sum_square_s=spread.root_sum_square,
        by_dimension_s=changes,
    )


def _flight_time(clutch: Clutch, profile: ForceProfile, gap: float) -> float:
    """Compute the time of an actuator over an axial gap in m, s."""
    from dogshape.sim.shift.planar import touch_time  # noqa: PLC0415  slow to load

    return touch_time(replace(clutch, dog=replace(clutch.dog, axial_gap=gap)), profile)


def _gap_time(study: Setup, mix: Mix, tolerance: float) -> float:
    """Compute half the change of free flight between the ends of the axial gap, s."""
    gap = study.clutch.dog.axial_gap
    mass = study.clutch.rings.mass + study.clutch.mechanism.added_mass
    ends = (gap + tolerance, max(0.0, gap - tolerance))
    times = []
    for force in mix.points[:, 1].tolist():
        profile = study.actuation.at_sleeve(force)
        if study.clutch.actuator is not None:
            times.append([_flight_time(study.clutch, profile, end) for end in ends])
            continue
        times.append([profile.free_flight_time(end, mass) for end in ends])
    flights = np.array(times)
    return 0.5 * float(mix.weights @ (flights[:, 0] - flights[:, 1]))
