r"""Load case of a design and the load of one dog, :math:`F = K_A T/(r N K_s)`.

*Load height* 0.9: 0.25 degrees of tilt move the resultant there (``tests/verification/
flank_model.py``). *Coast*: a petrol engine brakes with 0.25 to 0.4 of its torque (Heywood 1988).

*Springs*: pairs of dogs of stiffness *c* touch at normal gaps :math:`g_i`; under *F* the rings
approach by *d*, :math:`\sum c (d - g_i)_+ = F`, :math:`K_s = (F/N)/\overline{c (d - g_{min})}`.
*Landing*: the energy :math:`\tfrac12 N c \delta_0^2` is taken by the foremost dogs; the peak over
:math:`c \delta_0` is :math:`1/\sqrt{K_l}`. *Slow errors*: run-out *t* adds a wave of amplitude
*t/2* to the gaps of flanks, tilt :math:`\psi` one of :math:`r_m \psi` to faces. *Accuracy*:
:math:`f_{pT} = (0.001 d + 0.4 d/N + 5) \sqrt 2^{A - 5}` um, *d* in mm (ISO 1328-1), is 3 sd.

*Low dogs* of the output ring share the torque by equal mean pressure, as in the contact of the
shifts: with :math:`N_h` high dogs and the ratio *a* of the areas that touch, *N* in *F* is
:math:`N_h + a (N - N_h)`, and :math:`K_s` is that of all dogs that touch. A low dog then has the
pressure of a high one, less force and a smaller lever. In landings and flank strikes, which may be
shallow, low dogs take no part.

*Stiffness* of a pair of dogs: two dogs with their sectors in series (``dog_stiffness``), loaded at
the load height, times ``dog_stiffness_factor``. Radial teeth of a sleeve have the mesh stiffness of
gears over what touches, c' = 14 N/(mm um) (ISO 6336-1, method C).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np

from dogshape.sim.elementwise import ARRAY, Array, largest, map_elements, where
from dogshape.sim.errors import InputError, Refusal, require_between
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.clutch import CONTACT_SETS, ContactSet
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, Mount, flank_contact
from dogshape.sim.shift.mechanism import NO_MECHANISM
from dogshape.sim.shift.pair import touching_count
from dogshape.sim.strength.dog_stiffness import SMALLEST_LENGTH, FlankLoad, flank_compliance
from dogshape.sim.units import DEG, MM

SAMPLES = 4096  #: pairs of rings; the mean is known to half a percent
SEED = 20261123
MESH_STIFFNESS = 14e9  #: c' of a pair of teeth of a sleeve over their engaged length, N/m2
DEFAULT_CONTACT = CONTACT_SETS["lubricated_steel"]
SIGMAS = 3.0  #: standard deviations of a single pitch deviation in its tolerance
#: Range of tabled errors, over the approach of perfect dogs.
MIN_TABLED_ERROR = 1e-2
MAX_TABLED_ERROR = 1e3
TABLE_POINTS = 201


def pitch_tolerance(accuracy: int, diameter: float, count: int) -> float:
    """Compute the single pitch tolerance of ISO 1328-1:2013, m; ``diameter`` in m."""
    diameter_mm = diameter / MM
    class_5 = 0.001 * diameter_mm + 0.4 * diameter_mm / count + 5.0
    return class_5 * 2.0 ** (0.5 * (accuracy - 5)) * 1e-6


@lru_cache(maxsize=4096)
def load_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the load sharing of ``count`` dogs.

    ``scatter`` is the standard deviation of the gaps, ``wave`` the amplitude of their slow error,
    both over the approach of perfect dogs: sigma c N/F and a c N/F.
    """

    def approach(touching: int, gap_sum: Array, _: Array) -> Array:
        return (count + gap_sum) / touching

    return float(1.0 / _approaches(count, scatter, wave, approach).mean())


@lru_cache(maxsize=2**16)  # designs of a search have thousands of landings, many of them alike
def landing_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the share of ``count`` dogs that lands, by the peak force.

    ``scatter`` is the standard deviation of the faces, ``wave`` the amplitude of their slow error,
    both over the approach of perfect ones: sigma c/F_0 and a c/F_0.
    """

    def peak(touching: int, gap_sum: Array, square_sum: Array) -> Array:
        mean = gap_sum / touching
        variance = square_sum / touching - mean**2
        # The root is real up to the first number of dogs that fits, where the search ends.
        root: Array = np.sqrt(np.maximum(count / touching - variance, 0.0))
        return mean + root

    return float(1.0 / _approaches(count, scatter, wave, peak).mean() ** 2)


Share = Callable[[int, float, float], float]  #: ``load_share`` or ``landing_share``


def tabled_share(share: Share, count: float, size: float, scatter: float, wave: float) -> float:
    """Interpolate a share, to 5e-4: many loads and stiffnesses differ by the error size alone.

    Errors are ``size`` times ``scatter`` and ``wave``, of which the larger is 1.
    """
    if isinstance(count + scatter + wave, ARRAY):  # of ``Dogs``, many of which are equal
        return map_elements(partial(tabled_share, share), count, size, scatter, wave)
    is_tabled = (size > MIN_TABLED_ERROR) & (size < MAX_TABLED_ERROR)
    exact_size = where(is_tabled, MIN_TABLED_ERROR, size)
    tabled_size = where(is_tabled, size, MIN_TABLED_ERROR)
    exact = map_elements(partial(share, int(count)), exact_size * scatter, exact_size * wave)
    interpolated: Any = np.interp(
        np.log(tabled_size), *_share_table(share, int(count), scatter, wave)
    )
    if not isinstance(size, ARRAY):
        interpolated = float(interpolated)
    return where(is_tabled, interpolated, exact)


@lru_cache(maxsize=512)
def _share_table(share: Share, count: int, scatter: float, wave: float) -> tuple[Array, Array]:
    """Tabulate a share; return logarithms of the error size and shares, both (n,)."""
    sizes = np.geomspace(MIN_TABLED_ERROR, MAX_TABLED_ERROR, TABLE_POINTS)
    shares = [share(count, size * scatter, size * wave) for size in sizes.tolist()]
    return np.log(sizes), np.array(shares)


@lru_cache(maxsize=64)
def _gaps(count: int, scatter: float, wave: float) -> Array:
    """Draw the gaps of dogs above the smallest gap, sorted, (count, samples)."""
    rng = np.random.default_rng(SEED)
    deviates = rng.standard_normal((SAMPLES, count))
    phases = rng.random(SAMPLES)
    angles = 2.0 * np.pi * (np.arange(count) / count + phases[:, None])
    gaps = np.sort(scatter * deviates + wave * np.cos(angles), axis=1).T
    return np.ascontiguousarray(gaps - gaps[0])


def _approaches(
    count: int, scatter: float, wave: float, approach_of: Callable[[int, Array, Array], Array]
) -> Array:
    """Compute the approach of the rings at which the touching dogs carry the load, (samples,).

    ``approach_of`` computes it from the number of touching dogs, the sum of their gaps and that of
    the squares, (samples,).
    """
    scale = max(scatter, wave) or 1.0  # keeps all digits of small errors
    unit_gaps = _gaps(count, scatter / scale, wave / scale)
    approaches = np.empty(SAMPLES)
    is_open = np.ones(SAMPLES, dtype=bool)
    gap_sum, square_sum = 0.0, 0.0
    approach = np.full(SAMPLES, np.inf)
    for touching, unit_gap in enumerate(unit_gaps, start=1):
        gap = scale * unit_gap
        is_open &= approach > gap  # a mask takes a third of the time of fewer samples
        if not is_open.any():
            break
        gap_sum = gap_sum + gap
        square_sum = square_sum + gap**2
        approach = approach_of(touching, gap_sum, square_sum)
        np.copyto(approaches, approach, where=is_open)
    return approaches


@dataclass(frozen=True)
class LoadCase:
    """Loads of a dog: keys of ``[load]`` (``docs/studies.md``), SI.

    Classes of ``spectrum`` replace the ``shifts`` in the fatigue of the root: torque over the rated
    one, negative on the braking flank, and cycles. Without ``accuracy`` (ISO 1328-1) or
    ``pitch_sd``, ``run_out`` and ``tilt`` the load sharing is fixed. Friction of dogs and toothing
    lies between ``friction_hold`` and ``friction_release``; the toothing may have an interval and
    faces a coefficient of their own. A ``spline_friction`` of 0 is a ring without a toothing.
    """

    torque: float = quantity("torque_Nm", 1e-3, 1e5, 200.0)
    application_factor: float = quantity("application_factor", 0.5, 10.0, 1.5)
    load_sharing: float = quantity("load_sharing", 0.01, 1.0, 0.5)
    load_height: float = quantity("load_height", 0.5, 1.0, 0.9)
    safety: float = quantity("safety", 1.0, 10.0, 1.2)
    safety_fatigue: float = quantity("safety_fatigue", 1.0, 10.0, 1.2)
    shifts: float = quantity("shifts", 1.0, 1e12, 1e5)
    reversal: float = quantity("reversal", 0.1, 1.0, 0.7)
    friction_release: float = quantity("friction_release", 0.0, 1.0, 0.12)
    friction_hold: float = quantity("friction_hold", 0.0, 1.0, 0.05)
    separating_force_limit: float | None = quantity("separating_force_limit_N", 1.0, 1e6, None)
    wear_angle: float = quantity("wear_angle_deg", 0.0, 10.0, 1.0 * DEG, late=True)
    vibration_force: float = 0.0  #: inertia of the ring in gearbox vibration, N
    coast_share: float = quantity("coast_share", 0.0, 1.0, 1.0, late=True)
    pull_out_force_limit: float | None = quantity("pull_out_force_limit_N", 1.0, 1e6, None)
    release_by_itself: bool = True
    faces_release: bool = True
    pull_out_share: float = quantity("pull_out_share", 0.0, 1.0, 1.0, late=True)
    spectrum: tuple[tuple[float, float], ...] = ()
    abuse_torque: float | None = quantity("abuse_torque_Nm", 1e-3, 1e6, None)
    accuracy: int | None = quantity("accuracy", 1, 11, None)
    pitch_sd: float | None = quantity("pitch_sd_um", 0.0, 1000.0, None)
    run_out: float = quantity("run_out_um", 0.0, 1000.0, 0.0, late=True)
    tilt: float = quantity("tilt_mrad", 0.0, 50.0, 0.0, late=True)
    #: measured over computed stiffness of the dogs at flanks and faces; None without measurement
    dog_stiffness_factor: float | None = quantity("dog_stiffness_factor", 0.05, 20.0, None)
    contact: ContactSet = DEFAULT_CONTACT  #: of the shifts
    face_friction: float | None = None  #: of faces on faces in the shifts; None: that of flanks
    spline_friction: float = NO_MECHANISM.spline_friction
    spline_radius: float = NO_MECHANISM.spline_radius
    spline_friction_release: float | None = quantity("spline_friction_release", 0.0, 1.5, None)
    spline_friction_hold: float | None = quantity("spline_friction_hold", 0.0, 1.5, None)
    landing_share: float | None = quantity("landing_share", 1e-4, 0.5, None)
    #: largest bedding depth of an edge over the case depth; judged
    edge_bedding_share: float = quantity("edge_bedding_share", 0.001, 1.0, 0.05, late=True)
    slots_per_dog: int = 1  #: slots of one ring for each high dog of the other
    #: load of a low dog over that of a high one, of traction and braking flank
    low_shares: tuple[float, float] = (0.0, 0.0)
    mount: Mount = "face"  #: root of the dogs
    mate: Dog | None = None  #: dog of the other ring; None: the dogs of both rings are alike

    def __post_init__(self) -> None:
        require_ranges(self, "load", "correct the load case")
        remedy = "give classes as [torque over the rated one, cycles]"
        for share, cycles in self.spectrum:
            require_between("load.spectrum: torque", share, -10.0, 10.0, remedy)
            require_between("load.spectrum: cycles", cycles, 1.0, 1e15, remedy)
        max_share = max((abs(share) for share, _ in self.spectrum), default=1.0)
        require_between("load.spectrum: largest torque", max_share, 1e-3, high=10.0, remedy=remedy)
        if self.accuracy is not None and self.pitch_sd is not None:
            raise InputError(
                "load.accuracy and load.pitch_sd_um both say how the dogs scatter; leave out one"
            )
        if self.friction_hold > self.friction_release:
            rule = f"it must not exceed load.friction_release = {self.friction_release:.6g}"
            remedy = "holding is judged with the lower coefficient; exchange or correct them"
            sentence = Refusal(
                "load.friction_hold", self.friction_hold, "", rule=rule, remedy=remedy
            )
            raise InputError(sentence)

    def require_spline(self) -> None:
        """Raise InputError if the interval of the toothing excludes its nominal friction."""
        nominal = self.spline_friction
        key = "mechanism.spline_friction"
        signs = {"spline_friction_hold": -1.0, "spline_friction_release": 1.0}
        for name, sign in signs.items():
            end = getattr(self, name)
            if end is None:
                continue
            if nominal == 0.0:
                raise InputError(f"load.{name} belongs to {key}, which is not given; give it too")
            if sign * (end - nominal) < 0.0:
                bound = "at most" if sign < 0.0 else "at least"
                rule = f"it must be {bound} {key} = {nominal:.6g}, which shifts are simulated with"
                remedy = "correct one of them"
                raise InputError(Refusal(f"load.{name}", end, "", rule=rule, remedy=remedy))

    @property
    def face_release_friction(self) -> float:
        """Friction at which faces must slide: that of the shifts, else the flanks' upper end."""
        return self.friction_release if self.face_friction is None else self.face_friction

    @property
    def spline_interval(self) -> tuple[float, float]:
        """Smallest and largest friction of the toothing, 0 without a toothing.

        By default the interval of the dogs, widened to the friction of the simulation.
        """
        if self.spline_friction == 0.0:
            return 0.0, 0.0
        low = self.spline_friction_hold
        if low is None:
            low = min(self.spline_friction, self.friction_hold)
        return low, self.release_friction

    @property
    def release_friction(self) -> float:
        """Upper end of the toothing's friction, 0 without a toothing."""
        if self.spline_friction == 0.0:
            return 0.0
        if self.spline_friction_release is None:
            return max(self.spline_friction, self.friction_release)
        return self.spline_friction_release

    @property
    def stiffness_factor(self) -> float:
        """Stiffness of the dogs over the computed one."""
        return 1.0 if self.dog_stiffness_factor is None else self.dog_stiffness_factor

    @property
    def design_torque(self) -> float:
        """Torque times application factor, N m."""
        return self.torque * self.application_factor

    def share_of(self, flank: Flank) -> float:
        """Return the torque of a flank over the rated one."""
        return 1.0 if flank == "traction" else self.coast_share

    def static_torque(self, flank: Flank) -> float:
        """Return the design torque of a flank, or the abuse torque where it is larger, N m."""
        return max(self.design_torque * self.share_of(flank), self.abuse_torque or 0.0)

    def force_per_dog(
        self, dog: Dog, flank: Flank = "traction", torque: float | None = None
    ) -> float:
        """Compute the tangential force on the most loaded dog, N.

        ``torque`` in N m is by default the static one: design torque of the flank or abuse torque.
        """
        if torque is None:
            torque = self.static_torque(flank)
        bearing = self.bearing(dog, flank)
        return torque / (dog.mean_radius * bearing * self.sharing(dog, torque, flank))

    def touching(self, dog: Dog) -> int:
        """Count the dogs that touch from the crests on: high ones of the output ring."""
        return touching_count(dog, self.slots_per_dog)

    def bearing(self, dog: Dog, flank: Flank) -> float:
        """Compute the number of high dogs that would bear the torque as all dogs do."""
        high_count = self.touching(dog)
        return high_count + self.low_share(flank) * (dog.count - high_count)

    def low_share(self, flank: Flank) -> float:
        """Return the load of a low dog over that of a high one on a flank."""
        return self.low_shares[FLANKS.index(flank)]

    def scatter(self, dog: Dog) -> float | None:
        """Compute the standard deviation of the dogs' gaps, m; None for a fixed load sharing."""
        if self.accuracy is None:
            return self.pitch_sd
        return pitch_tolerance(self.accuracy, 2.0 * dog.mean_radius, dog.count) / SIGMAS

    def stiffness(self, dog: Dog, flank: Flank = "traction") -> float:
        """Compute the stiffness of a pair of dogs at a flank, N/m."""
        mate = dog if self.mate is None else self.mate
        compliances = []
        for own, other in ((dog, mate), (mate, dog)):
            contact = flank_contact(own, own.edge_radius, flank, other)
            if self.mount == "sleeve":
                length = largest(contact.height, SMALLEST_LENGTH)
                compliances.append(0.5 / (MESH_STIFFNESS * length))
                continue
            load = FlankLoad(contact.level(self.load_height), contact.high)
            compliances.append(flank_compliance(own, flank, load))
        return self.stiffness_factor / sum(compliances)

    def sharing(self, dog: Dog, torque: float, flank: Flank = "traction") -> float:
        """Compute the mean load of the dogs under ``torque`` (N m) over the largest load."""
        if torque == 0.0:
            return self.load_sharing
        force = torque / (dog.mean_radius * self.bearing(dog, flank))
        count = where(self.low_share(flank) > 0.0, dog.count, self.touching(dog))
        stiffness = self.stiffness(dog, flank)
        wave = 0.5 * self.run_out
        return self._share(load_share, dog, count, force=force, stiffness=stiffness, wave=wave)

    def landing(self, dog: Dog, force: float, stiffness: float) -> float:
        """Compute the share of the dogs that lands.

        ``force`` in N is that of equal dogs, ``stiffness`` in N/m that of a pair as it lands.
        """
        count = self.touching(dog)
        wave = dog.mean_radius * self.tilt
        return self._share(landing_share, dog, count, force=force, stiffness=stiffness, wave=wave)

    def blow(self, dog: Dog, force: float, flank: Flank = "traction") -> float:
        """Compute the share of the dogs that takes a flank strike; ``force`` of equal dogs, N."""
        count = self.touching(dog)
        stiffness = self.stiffness(dog, flank)
        wave = 0.5 * self.run_out
        return self._share(landing_share, dog, count, force=force, stiffness=stiffness, wave=wave)

    def _share(
        self, share: Share, dog: Dog, count: float, *, force: float, stiffness: float, wave: float
    ) -> float:
        """Compute a share of ``count`` dogs; ``load_sharing`` if their errors are unknown."""
        scatter = self.scatter(dog)
        if scatter is None and wave == 0.0:
            return self.load_sharing
        deviation = 0.0 if scatter is None else scatter
        error = largest(deviation, wave)
        error_size = error * stiffness / (force + (force == 0.0))
        unit = error + (error == 0.0)
        dog_share = tabled_share(share, count, error_size, deviation / unit, wave / unit)
        return where(force == 0.0, self.load_sharing, dog_share)
