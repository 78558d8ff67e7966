r"""Limits of manufacture on the shape, and margins within manufacturing tolerances.

*Root sum of squares*: independent dimensions, each normal about its nominal size with the tolerance
:math:`t = 3 C \sigma` (*C* the capability of the process, by default 1: three standard deviations,
as for a pitch in ``sim.strength.load_case``), move a margin by a normal deviate of
:math:`\sqrt{\sum e_i^2}/(3 C)`, :math:`e_i` its loss at the tolerance. The share *p* of the dogs,
the reject rate, lies beyond :math:`z_p/(3 C) \sqrt{\sum e_i^2}`. Dimensions that are even over the
whole tolerance have :math:`C = 1/\sqrt 3`. No more is lost than in the worst case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial, reduce
from statistics import NormalDist
from typing import Any, Literal

import numpy as np

from dogshape.sim.elementwise import hashable, hypot, largest, smallest, where
from dogshape.sim.errors import DogshapeError, GeometryError, Refusal
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.geometry import (
    FLANKS,
    SHARPEST,
    Dog,
    Dogs,
    flank_contact,
    root_radius_room,
)
from dogshape.sim.shift.pair import ALIKE, OutputDog, Pair
from dogshape.sim.strength.checks import RULES, LimitCheck, checks_of
from dogshape.sim.units import DEG, MM

ROUGHNESS_REMEDY = "give Rz in micrometres"


@dataclass(frozen=True)
class ManufacturingLimits:
    """Limits of manufacture, lengths in m; ``RULES`` has their meaning and source."""

    tip_width: float = quantity("tip_width_mm", 0.05, 100.0, 1.5e-3)
    slot_width: float = quantity("slot_width_mm", 0.05, 100.0, 1.5e-3)
    cutter_reach: float = quantity("cutter_reach", 0.1, 100.0, 3.0)
    flank_height: float = quantity("flank_height_mm", 0.05, 100.0, 1.5e-3)
    #: of the roots, and of tip edges if the dog has no edge radius
    root_radius: float = quantity("root_radius_mm", 0.02, 10.0, 0.3e-3)
    tip_core: float = quantity("tip_core_mm", 0.0, 100.0, 0.5e-3)
    chamfer_share: float = quantity("chamfer_share", 0.0, 0.5, 0.35)
    module: float = quantity("module_mm", 0.05, 100.0, 1.25e-3)
    #: thickness of the ring behind the roots; None for a thick ring
    rim: float | None = quantity("rim_mm", 0.1, 1000.0, None, remedy="give the thickness in mm")
    #: largest Rz (ISO 21920-2), for the drawing alone; None for faces without a requirement
    flank_roughness: float | None = quantity(
        "flank_roughness_um", 0.1, 200.0, None, remedy=ROUGHNESS_REMEDY
    )
    crest_roughness: float | None = quantity(
        "crest_roughness_um", 0.1, 200.0, None, remedy=ROUGHNESS_REMEDY
    )

    def __post_init__(self) -> None:
        require_ranges(self, "manufacturing", "correct the limit")


#: Checks without which a dog cannot be made.
MAKEABLE = tuple(n for n, rule in RULES.items() if rule.group == "make" and n != "tip_core")


def manufacturing_checks(
    dog: Dog, limits: ManufacturingLimits, fillet_room: float | None = None
) -> tuple[LimitCheck, ...]:
    """Return the manufacturability checks of a dog.

    ``fillet_room`` is the largest root radius, m, of teeth of a sleeve, whose slots have no floor.
    """
    inner = dog.inner_radius
    # The cutter enters an undercut slot by its mouth.
    slot = dog.pitch_angle * inner - largest(dog.root_width_at(inner), dog.tip_width_at(inner))
    values = {
        "tip_width": dog.tip_width_at(inner),
        "slot_width": slot,
        "cutter_reach": dog.height / slot,
        "flank_height": dog.height - largest(*dog.drops_at(dog.outer_radius)),
        "root_radius": root_radius_room(dog),
    }
    if fillet_room is not None:
        del values["cutter_reach"]
        values["root_radius"] = fillet_room
    elif dog.edge_radius != 0.0:
        values |= {"edge_clearance": dog.edge_radius}
    values |= {
        "chamfer_share": largest(*dog.drops_at(dog.mean_radius)) / dog.height,
        "module": 2.0 * dog.mean_radius / dog.count,
    }
    bounds = vars(limits) | {"edge_clearance": limits.root_radius}
    return checks_of((name, value, bounds[name]) for name, value in values.items())


def require_fillets(dog: Dog, radius: float) -> None:
    """Raise GeometryError unless fillets of a ``radius`` in m fit into slot and tip of a dog."""
    room = root_radius_room(dog)
    if room >= radius:
        return
    rule = f"the largest that fits into slot and tip is {room / MM:.4g} mm"
    remedy = "use a smaller radius, fewer dogs, or a smaller chamfer"
    sentence = Refusal("manufacturing.root_radius_mm", radius / MM, "mm", rule=rule, remedy=remedy)
    raise GeometryError(sentence)


ANGLE_REMEDY = "give an angle in degrees"
SHARE_REMEDY = "give a share of the height"


@dataclass(frozen=True)
class Tolerances:
    """Largest deviation of each dimension either way, rad and m, and the limits of two checks.

    Height and diameters by default of ISO 2768-1 fine, the rest of ground or precision-forged dogs
    (assumptions). ``RULES`` has the meaning of ``contact_ratio``, ``clearance`` and ``mouth_play``,
    which pitch errors of both rings take: some 0.03 mm in class 6 of ISO 1328-1. The reject rate is
    that of a normal deviate beyond 3 standard deviations on one side, of each check.
    """

    chamfer: float = quantity("chamfer_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE_REMEDY)
    traction: float = quantity("traction_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE_REMEDY)
    braking: float = quantity("braking_deg", 0.0, 5.0, 0.25 * DEG, remedy=ANGLE_REMEDY)
    height: float = quantity("height_mm", 0.0, 2.0, 0.05 * MM)
    outer_diameter: float = quantity("outer_diameter_mm", 0.0, 2.0, 0.15 * MM)
    inner_diameter: float = quantity("inner_diameter_mm", 0.0, 2.0, 0.15 * MM)
    axial_gap: float = quantity("axial_gap_mm", 0.0, 2.0, 0.1 * MM)
    root_radius: float = quantity("root_radius_mm", 0.0, 2.0, 0.05 * MM)
    contact_ratio: float = quantity("contact_ratio", 0.0, 1.0, 0.5, remedy=SHARE_REMEDY)
    clearance: float = quantity("clearance_mm", 0.0, 2.0, 0.3 * MM)
    chamfer_back: float = quantity(
        "chamfer_back_deg", 0.0, 5.0, 0.25 * DEG, late=True, remedy=ANGLE_REMEDY
    )
    backlash: float = quantity("backlash_mm", 0.0, 2.0, 0.05 * MM, late=True)
    reject_rate: float = quantity("reject_rate", 1e-9, 0.5, 0.00135, late=True)
    capability: float = quantity("capability", 0.3, 3.0, 1.0, late=True)
    mouth_play: float = quantity("mouth_play_mm", 0.0, 2.0, 0.05 * MM, late=True)

    def __post_init__(self) -> None:
        require_ranges(self, "tolerance", "give a length in mm")

    @property
    def dimensions(self) -> dict[str, float]:
        """Tolerances above zero by the names of their dimensions."""
        names = [field.name for field in fields(self) if field.name not in NO_DIMENSIONS]
        return {name: getattr(self, name) for name in names if getattr(self, name) > 0.0}

    @property
    def statistical_share(self) -> float:
        """Loss at the reject rate over the root sum of squares of the losses at the tolerances."""
        return -NormalDist().inv_cdf(self.reject_rate) / (3.0 * self.capability)

    def without_sizes(self) -> Tolerances:
        """Return the tolerances with every dimension exact."""
        return replace(self, **dict.fromkeys(self.dimensions, 0.0))


#: Fields of ``Tolerances`` that are no dimension.
NO_DIMENSIONS = ("contact_ratio", "clearance", "reject_rate", "capability", "mouth_play")
Kind = Literal["worst_case", "root_sum_square"]  #: addition of the effects of all dimensions


@dataclass(frozen=True)
class Spread:
    """Loss of a quantity within the tolerances, in its unit."""

    by_dimension: dict[str, float]
    worst_case: float
    share: float  #: ``Tolerances.statistical_share``

    @property
    def root_sum_square(self) -> float:
        """Loss at the reject rate: root of the sum of squares of all dimensions."""
        total = reduce(hypot, self.by_dimension.values(), 0.0)
        return smallest(self.share * total, self.worst_case)


SIGNS = (-1.0, 1.0)  #: of a deviation
#: Function of a dog, its root radius in m, and the nominal dog that it deviates from.
Values = Callable[[Dog, float, Dog], dict[str, float]]
Signs = Mapping[str, float]  #: of the deviations of dimensions


def add_deviations(
    dog: Dog, root_radius: float, deviations: Mapping[str, float]
) -> tuple[Dog, float]:
    """Return a dog and its root radius with ``deviations`` (SI) of some dimensions.

    Raises GeometryError for an impossible dog. A chamfer or length stops at zero, the root radius
    at ``SHARPEST``; a face or backlash that the dog does not have stays zero.
    """
    dimensions: dict[str, Any] = dict(deviations)
    radius = largest(SHARPEST, root_radius + dimensions.pop("root_radius", 0.0))
    for name, deviation in dimensions.items():
        nominal = getattr(dog, name)
        value = nominal + deviation
        if name not in ("traction", "braking"):
            value = where(_has_dimension(dog, name), largest(0.0, value), nominal)
        dimensions[name] = value
    return replace(dog, **dimensions), radius


def _has_dimension(dog: Dog, name: str) -> bool:
    """Test whether a dog has a dimension; (n,) for ``Dogs``."""
    absent = {"chamfer": dog.crest == 0.0, "chamfer_back": dog.crest == 1.0}
    return np.logical_not(absent.get(name, (name == "backlash") & (dog.backlash == 0.0)))


def losses(
    dog: Dog, root_radius: float, tolerances: Tolerances, values: Values
) -> dict[str, Spread]:
    """Compute the largest loss of each of ``values`` within the tolerances.

    In the worst case every dimension deviates to the side that reduces the value; that is exact for
    a value monotonic in each dimension. Both rings have the same deviations. A deviation without a
    possible dog makes every loss infinite.
    """
    sizes = {n: size for n, size in tolerances.dimensions.items() if np.any(_has_dimension(dog, n))}
    nominal = values(dog, root_radius, dog)

    def deviate(signs: Signs) -> tuple[Dog, float]:
        deviations = {dimension: sign * sizes[dimension] for dimension, sign in signs.items()}
        return add_deviations(dog, root_radius, deviations)

    def loss(signs: Signs) -> dict[str, float]:
        try:
            shape, radius = deviate(signs)
            off_nominal = values(shape, radius, dog)
        except DogshapeError:
            return dict.fromkeys(nominal, math.inf)
        return {name: value - off_nominal[name] for name, value in nominal.items()}

    def losses_at(corners: Sequence[Signs]) -> list[dict[str, float]]:
        if isinstance(dog, Dogs):
            return _losses_of_dogs(dog, list(map(deviate, corners)), nominal, values)
        return list(map(loss, corners))

    deviations = [{dimension: sign} for dimension in sizes for sign in SIGNS]
    losses_by_deviation = iter(losses_at(deviations))
    losses_by_sign = {n: (next(losses_by_deviation), next(losses_by_deviation)) for n in sizes}
    corners: dict[tuple[Hashable, ...], Signs] = {}
    corner_keys = {}
    losses_by_dimension: dict[str, dict[str, float]] = {}
    for name in nominal:
        signs = {}
        losses_by_dimension[name] = {}
        for dimension, (negative, positive) in losses_by_sign.items():
            signs[dimension] = where(negative[name] >= positive[name], *SIGNS)
            largest_loss = largest(negative[name], positive[name], 0.0)
            losses_by_dimension[name][dimension] = largest_loss
        corner_keys[name] = tuple(map(hashable, signs.values()))
        corners[corner_keys[name]] = signs
    corner_losses = dict(zip(corners, losses_at(list(corners.values())), strict=True))
    spreads = {}
    for name, by_dimension in losses_by_dimension.items():
        worst = largest(corner_losses[corner_keys[name]][name], *by_dimension.values())
        spreads[name] = Spread(by_dimension, worst, tolerances.statistical_share)
    return spreads


def _losses_of_dogs(
    dogs: Dogs,
    deviated: Sequence[tuple[Dog, float]],
    nominal: Mapping[str, float],
    values: Values,
) -> list[dict[str, float]]:
    """Compute the losses of ``values`` of dogs at several deviations of each, all in one call.

    ``deviated`` are dogs and root radius at each deviation, ``nominal`` are the values without.
    """
    if not deviated:
        return []
    shape = (len(deviated), dogs.size)
    joined = Dogs.join([group for group, _ in deviated if isinstance(group, Dogs)])
    radius: Any = np.concatenate([np.broadcast_to(radius, dogs.size) for _, radius in deviated])
    off_nominal = values(joined, radius, Dogs.join([dogs] * len(deviated)))
    is_possible = np.broadcast_to(joined.possible, radius.shape).reshape(shape)
    losses_by_name = {}
    for name, value in nominal.items():
        off_nominal_values = np.broadcast_to(off_nominal[name], radius.shape).reshape(shape)
        losses_by_name[name] = np.where(is_possible, value - off_nominal_values, math.inf)
    return [
        {name: rows[place] for name, rows in losses_by_name.items()}
        for place in range(len(deviated))
    ]


def _contact_ratios(
    dog: Dog, root_radius: float, nominal: Dog, output_dog: OutputDog
) -> dict[str, float]:
    """Compute the share of the lower dog's height that touches, by flank.

    ``nominal`` is the sliding dog from which ``dog`` deviates, as the output dog does then.
    """
    mate = None if output_dog == ALIKE else output_dog.beside(dog, nominal)
    height = dog.height if mate is None else smallest(dog.height, mate.height)
    ratios: dict[str, float] = {
        f: flank_contact(dog, root_radius, f, mate).height / height for f in FLANKS
    }
    if mate is None:
        return ratios
    return {f: where(mate.possible, ratio, -math.inf) for f, ratio in ratios.items()}


def _passing_play(dog: Dog, deviations: Mapping[str, float], output_dog: OutputDog) -> float:
    """Compute the play at the mouth of a slot at ``deviations`` of both rings, m.

    Below zero where dogs do not pass each other.
    """
    shape = Dogs.of(dog)
    deviated, _ = add_deviations(shape, SHARPEST, deviations)
    return Pair(deviated, output_dog.beside(deviated, shape)).passing_play


def _passing_play_spread(
    dog: Dog, nominal_play: float, tolerances: Tolerances, output_dog: OutputDog
) -> Spread:
    """Compute the loss of play at the mouth of a slot within the tolerances, m."""
    play_at = partial(_passing_play, dog, output_dog=output_dog)
    losses_by_dimension = {}
    corner = {}
    for dimension, size in tolerances.dimensions.items():
        small, large = (nominal_play - play_at({dimension: sign * size}) for sign in SIGNS)
        losses_by_dimension[dimension] = largest(small, large, 0.0)
        corner[dimension] = where(small >= large, -size, size)
    worst_case = nominal_play - play_at(corner)
    return Spread(losses_by_dimension, worst_case, tolerances.statistical_share)


def tolerance_checks(
    dog: Dog,
    root_radius: float,
    tolerances: Tolerances,
    seated: float,
    kind: Kind = "root_sum_square",
    *,
    output_dog: OutputDog = ALIKE,
) -> tuple[LimitCheck, ...]:
    """Return the checks of contact ratio, clearance and play at the mouth within the tolerances.

    ``root_radius`` and the ``seated`` tolerance of a shift in m. Undercut dogs alone have a play at
    the mouth, which is infinite for the others of ``Dogs``.
    """
    ratios_of = partial(_contact_ratios, output_dog=output_dog)
    spreads = losses(dog, root_radius, tolerances, ratios_of)
    nominal = ratios_of(dog, root_radius, dog)
    seated_share = seated / smallest(dog.height, output_dog.beside(dog).height)
    ratios = [
        nominal[flank] - seated_share - getattr(spread, kind) for flank, spread in spreads.items()
    ]
    gap_losses = {"axial_gap": tolerances.axial_gap, "height": 2.0 * tolerances.height}
    gap_spread = Spread(gap_losses, sum(gap_losses.values()), tolerances.statistical_share)
    contact_ratio = largest(smallest(*ratios), -1.0)
    clearance = dog.axial_gap - getattr(gap_spread, kind)
    rows = [
        ("contact_ratio", contact_ratio, tolerances.contact_ratio),
        ("clearance", clearance, tolerances.clearance),
    ]
    is_undercut: Any = dog.lean < 0.0
    if np.any(is_undercut):
        play = _passing_play(dog, {}, output_dog)
        spread = _passing_play_spread(dog, play, tolerances, output_dog)
        smallest_play = where(is_undercut, play - getattr(spread, kind), math.inf)
        rows.append(("mouth_play", smallest_play, tolerances.mouth_play))
    return checks_of(rows)
