r"""The load case of a design, and what it puts on one dog: :math:`F = K_A T/(r N K_s)`.

*Load height* 0.9: 0.25 degrees of tilt move the resultant there (``tests/verification/
flank_model.py``). *Coast*: a petrol engine brakes with 0.25 to 0.4 of its torque (Heywood 1988).

*Springs*: pairs of dogs of stiffness *c* touch at normal gaps :math:`g_i`; under *F* the rings
approach by *d*, :math:`\sum c (d - g_i)_+ = F`, :math:`K_s = (F/N)/\overline{c (d - g_{min})}`.
*Landing*: the energy :math:`\tfrac12 N c \delta_0^2` is taken by the foremost dogs; the peak over
:math:`c \delta_0` is :math:`1/\sqrt{K_l}`. *Slow errors*: run-out *t* adds a wave of amplitude
*t/2* to the gaps of flanks, tilt :math:`\psi` one of :math:`r_m \psi` to faces. *Accuracy*:
:math:`f_{pT} = (0.001 d + 0.4 d/N + 5) \sqrt 2^{A - 5}` um, *d* in mm (ISO 1328-1), is 3 sd.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dogshape.sim.elementwise import ARRAY, Array, largest, map_elements, where
from dogshape.sim.errors import InputError, refusal, require_between, require_ranges, within
from dogshape.sim.shift.geometry import Dog, Flank
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.units import DEG, MM

SAMPLES = 4096  #: pairs of rings; the mean is known to half a percent
SEED = 20261123
#: Pa/m of the contact in shifts (design set), and m of flank over which c' of ISO 6336-1 gives it
#: (``sim.shift.clutch``): together N/m of a pair of dogs per m of their radial width
STIFFNESS, FLANK_HEIGHT = 5e12, 3.1e-3
SIGMAS = 3.0  #: standard deviations of a single pitch deviation in its tolerance
LEAST_ERROR, MOST_ERROR = 1e-2, 1e3  #: of tabled errors, over the approach of perfect dogs


def pitch_tolerance(accuracy: int, diameter: float, count: int) -> float:
    """Return the single pitch tolerance of ISO 1328-1:2013, m; ``diameter`` in m."""
    size = diameter / MM
    return (0.001 * size + 0.4 * size / count + 5.0) * 2.0 ** (0.5 * (accuracy - 5)) * 1e-6


@lru_cache(maxsize=4096)
def load_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the load sharing of ``count`` dogs.

    ``scatter`` is the standard deviation of the gaps, ``wave`` the amplitude of their slow error,
    both over the approach of perfect dogs: sigma c N/F and a c N/F.
    """
    found = _approaches(count, scatter, wave, lambda touching, total, _: (count + total) / touching)
    return float(1.0 / found.mean())


@lru_cache(maxsize=2**16)  # designs of a search have thousands of landings, many of them alike
def landing_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the share of ``count`` dogs that lands, as far as the peak force goes.

    ``scatter`` is the standard deviation of the faces, ``wave`` the amplitude of their slow error,
    both over the approach of perfect ones: sigma c/F_0 and a c/F_0.
    """

    def peak(touching: int, total: Array, squares: Array) -> Array:
        mean = total / touching
        # The root is real up to the first number of dogs that fits; none is looked at beyond.
        root: Array = np.sqrt(np.maximum(count / touching - (squares / touching - mean**2), 0.0))
        return mean + root

    return float(1.0 / _approaches(count, scatter, wave, peak).mean() ** 2)


def exact_share(count: int, size: float, scatter: float, wave: float) -> float:
    """Compute ``load_share`` of errors as for ``tabled_share``."""
    return map_elements(
        lambda n, *errors: load_share(int(n), *errors), count, size * scatter, size * wave
    )


def tabled_share(count: int, size: float, scatter: float, wave: float) -> float:
    """Interpolate ``landing_share``, to 5e-4: landings of a dog differ by their force alone.

    Errors are ``size`` times ``scatter`` and ``wave``, of which the larger is 1.
    """
    if isinstance(count + scatter + wave, ARRAY):  # of ``Dogs``, many of which are alike
        return map_elements(tabled_share, count, size, scatter, wave)
    tabled = (size > LEAST_ERROR) & (size < MOST_ERROR)
    beyond, within_it = where(tabled, LEAST_ERROR, size), where(tabled, size, LEAST_ERROR)
    exact = map_elements(landing_share, int(count), beyond * scatter, beyond * wave)
    found = np.interp(np.log(within_it), *_share_table(int(count), scatter, wave))
    return where(tabled, found, exact)


@lru_cache(maxsize=256)
def _share_table(count: int, scatter: float, wave: float) -> tuple[Array, Array]:
    """Tabulate ``landing_share`` over the log of the size of errors in a fixed proportion, (n,)."""
    sizes = np.geomspace(LEAST_ERROR, MOST_ERROR, 201)
    shares = [landing_share(count, size * scatter, size * wave) for size in sizes.tolist()]
    return np.log(sizes), np.array(shares)


@lru_cache(maxsize=64)
def _gaps(count: int, scatter: float, wave: float) -> Array:
    """Draw gaps beyond the smallest, in their order, (count, samples)."""
    rng = np.random.default_rng(SEED)
    drawn, phase = rng.standard_normal((SAMPLES, count)), rng.random(SAMPLES)
    around = 2.0 * np.pi * (np.arange(count) / count + phase[:, None])
    ordered = np.sort(scatter * drawn + wave * np.cos(around), axis=1).T
    return np.ascontiguousarray(ordered - ordered[0])


def _approaches(
    count: int, scatter: float, wave: float, approach_of: Callable[[int, Array, Array], Array]
) -> Array:
    """Return the approach of each sample, with the fewest dogs that do not reach the next gap.

    ``approach_of`` gives it from a number of foremost dogs and the sums of their gaps and squares.
    """
    larger = max(scatter, wave) or 1.0  # scaled from the foremost, so that no digit is lost
    gaps = _gaps(count, scatter / larger, wave / larger)
    found, left = np.empty(SAMPLES), np.ones(SAMPLES, dtype=bool)
    total, squares, approach = 0.0, 0.0, np.full(SAMPLES, np.inf)
    for touching, here in enumerate(gaps, start=1):
        gap = larger * here
        left &= approach > gap  # a mask takes a third of the time of fewer samples
        if not left.any():
            break
        total, squares = total + gap, squares + gap**2
        approach = approach_of(touching, total, squares)
        np.copyto(found, approach, where=left)
    return found


@dataclass(frozen=True)
class LoadCase:
    """Loads that a dog has to carry, hold and let go: keys of ``[load]`` (``docs/studies.md``), SI.

    Classes of ``spectrum`` replace the ``shifts`` in the fatigue of the root: torque over the rated
    one, negative on the braking flank, and cycles. Without ``accuracy`` (ISO 1328-1) or
    ``pitch_sd``, ``run_out`` and ``tilt`` the load sharing is fixed. Friction of dogs and toothing
    lies between ``friction_hold`` and ``friction_release``; the toothing may have its own ends, and
    faces their own number. A ``spline_friction`` of 0 is a ring without a toothing.
    """

    torque: float = within("torque_Nm", 1e-3, 1e5, 200.0)
    application_factor: float = within("application_factor", 0.5, 10.0, 1.5)
    load_sharing: float = within("load_sharing", 0.01, 1.0, 0.5)
    load_height: float = within("load_height", 0.5, 1.0, 0.9)
    safety: float = within("safety", 1.0, 10.0, 1.2)
    safety_fatigue: float = within("safety_fatigue", 1.0, 10.0, 1.2)
    shifts: float = within("shifts", 1.0, 1e12, 1e5)
    reversal: float = within("reversal", 0.1, 1.0, 0.7)
    friction_release: float = within("friction_release", 0.0, 1.0, 0.12)
    friction_hold: float = within("friction_hold", 0.0, 1.0, 0.05)
    separating_force_limit: float | None = within("separating_force_limit_N", 1.0, 1e6, None)
    wear_angle: float = within("wear_angle_deg", 0.0, 10.0, 1.0 * DEG)
    vibration_force: float = 0.0  #: inertia of the ring in gearbox vibration, N
    coast_share: float = within("coast_share", 0.0, 1.0, 1.0)
    pull_out_force_limit: float | None = within("pull_out_force_limit_N", 1.0, 1e6, None)
    release_by_itself: bool = True
    faces_release: bool = True
    pull_out_share: float = within("pull_out_share", 0.0, 1.0, 1.0)
    spectrum: tuple[tuple[float, float], ...] = ()
    abuse_torque: float | None = within("abuse_torque_Nm", 1e-3, 1e6, None)
    accuracy: int | None = within("accuracy", 1, 11, None)
    pitch_sd: float | None = within("pitch_sd_um", 0.0, 1000.0, None)
    run_out: float = within("run_out_um", 0.0, 1000.0, 0.0)
    tilt: float = within("tilt_mrad", 0.0, 50.0, 0.0)
    contact_stiffness: float = STIFFNESS  #: of the shifts, Pa/m
    face_friction: float | None = None  #: of faces on faces in the shifts; None: that of flanks
    spline_friction: float = NOTHING.spline_friction
    spline_radius: float = NOTHING.spline_radius
    spline_friction_release: float | None = within("spline_friction_release", 0.0, 1.5, None)
    spline_friction_hold: float | None = within("spline_friction_hold", 0.0, 1.5, None)
    landing_share: float | None = within("landing_share", 1e-4, 0.5, None)

    def __post_init__(self) -> None:
        require_ranges(self, "load", "correct the load case")
        remedy = "give classes as [torque over the rated one, cycles]"
        for share, cycles in self.spectrum:
            require_between("load.spectrum: torque", share, -10.0, 10.0, remedy)
            require_between("load.spectrum: cycles", cycles, 1.0, 1e15, remedy)
        most = max((abs(share) for share, _ in self.spectrum), default=1.0)
        require_between("load.spectrum: largest torque", most, 1e-3, 10.0, remedy)
        if self.accuracy is not None and self.pitch_sd is not None:
            raise InputError(
                "load.accuracy and load.pitch_sd_um both say how the dogs scatter; leave out one"
            )
        if self.friction_hold > self.friction_release:
            rule = f"it must not exceed load.friction_release = {self.friction_release:.6g}"
            remedy = "holding is judged with the lower coefficient; exchange or correct them"
            raise InputError(refusal("load.friction_hold", self.friction_hold, "", rule, remedy))

    def require_spline(self) -> None:
        """Raise InputError where the toothing's own interval leaves out its nominal friction."""
        nominal, key = self.spline_friction, "mechanism.spline_friction"
        ends = {"spline_friction_hold": -1.0, "spline_friction_release": 1.0}
        for name, side in ends.items():
            end = getattr(self, name)
            if end is None:
                continue
            if nominal == 0.0:
                raise InputError(f"load.{name} belongs to {key}, which is not given; give it too")
            if side * (end - nominal) < 0.0:
                bound = "at most" if side < 0.0 else "at least"
                rule = f"it must be {bound} {key} = {nominal:.6g}, which shifts are simulated with"
                raise InputError(refusal(f"load.{name}", end, "", rule, "correct one of them"))

    @property
    def face_release_friction(self) -> float:
        """Friction above which faces have to slide: of the shifts, or the flanks' upper end."""
        return self.friction_release if self.face_friction is None else self.face_friction

    @property
    def spline_interval(self) -> tuple[float, float]:
        """Friction of the toothing that holds at least, and that has to be overcome at most.

        The interval of the dogs, widened to the friction of the simulation, unless it has its own.
        """
        nominal, low, high = self.spline_friction, self.spline_friction_hold, self.release_friction
        if nominal == 0.0:
            return 0.0, 0.0
        return min(nominal, self.friction_hold) if low is None else low, high

    @property
    def release_friction(self) -> float:
        """Upper end of the toothing's friction, 0 without a toothing."""
        if self.spline_friction == 0.0:
            return 0.0
        own = self.spline_friction_release
        return max(self.spline_friction, self.friction_release) if own is None else own

    @property
    def design_torque(self) -> float:
        """Torque times application factor, N m."""
        return self.torque * self.application_factor

    def share_of(self, flank: Flank) -> float:
        """Return the torque that a flank carries over the rated one."""
        return 1.0 if flank == "traction" else self.coast_share

    def force_per_dog(
        self, dog: Dog, flank: Flank = "traction", torque: float | None = None
    ) -> float:
        """Tangential force on the dog that carries most, N; by default under its static torque."""
        if torque is None:
            torque = max(self.design_torque * self.share_of(flank), self.abuse_torque or 0.0)
        return torque / (dog.mean_radius * dog.count * self.sharing(dog, torque))

    def scatter(self, dog: Dog) -> float | None:
        """Standard deviation of the dogs' gaps, m; None where the load sharing is fixed."""
        if self.accuracy is None:
            return self.pitch_sd
        return pitch_tolerance(self.accuracy, 2.0 * dog.mean_radius, dog.count) / SIGMAS

    def stiffness(self, dog: Dog) -> float:
        """Stiffness of a pair of dogs, N/m: that of the shifts on a flank of usual height."""
        return self.contact_stiffness * FLANK_HEIGHT * dog.radial_width

    def sharing(self, dog: Dog, torque: float) -> float:
        """Return the equal load of a dog under ``torque`` (N m) over that of the most loaded."""
        if torque == 0.0:
            return self.load_sharing
        equal = torque / (dog.mean_radius * dog.count)
        return self._share(exact_share, dog, equal, 0.5 * self.run_out)

    def landing(self, dog: Dog, line_load: float) -> float:
        """Return the share of the dogs that lands; ``line_load`` in N/m is that of all alike."""
        force = line_load * dog.radial_width
        return self._share(tabled_share, dog, force, dog.mean_radius * self.tilt)

    def blow(self, dog: Dog, force: float) -> float:
        """Return the share of the dogs that takes a strike on flanks; ``force`` in N as above."""
        return self._share(tabled_share, dog, force, 0.5 * self.run_out)

    def _share(self, share: Callable[..., float], dog: Dog, force: float, wave: float) -> float:
        """Compute a share of the dogs; ``load_sharing`` where nothing is said of their errors."""
        scatter = self.scatter(dog)
        if scatter is None and wave == 0.0:
            return self.load_sharing
        drawn = 0.0 if scatter is None else scatter
        larger = largest(drawn, wave)
        size = larger * self.stiffness(dog) / (force + (force == 0.0))
        unit = larger + (larger == 0.0)
        found = share(dog.count, size, drawn / unit, wave / unit)
        return where(force == 0.0, self.load_sharing, found)
