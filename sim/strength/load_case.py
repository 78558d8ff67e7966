r"""The load case of a design, and what it puts on one dog.

The torque turns both ways, each flank having its own. With load sharing :math:`K_s`
(share of the dogs that carry) and application factor :math:`K_A` the most loaded dog
takes the tangential force :math:`F = K_A T / (r N K_s)`.

Where it acts. Were both rings and what holds them alike, a perfect pair would be symmetric
about the median plane and the resultant of the flank's pressure lie at half the height
that touches, load height 0.5. Flanks out of angle move it to one end, and a flank is stiff
against tilt: plane finite elements of two prototype dogs at 417 N/mm give 0.61, 0.71, 0.89
and 0.95 for 0.05, 0.10, 0.25 and 0.50 degrees between the flanks
(``tests/verification/flank_model.py``). Flanks made to 0.25 degrees thus carry near an edge, on one
ring near its tip: 0.9 is the default. Run-in rings come closer to 0.5; 1 is the edge alone.

Every shift loads a flank once to the design torque and, when the vehicle coasts, the
other; a root that is bent both ways endures 0.7 of a pulsating load (ISO 6336-5). Safety
against fatigue is 1.2, usual for vehicle gearboxes.

A load sharing of 0.5 asks for pitch errors about as small as the dogs give under load, 8 to
17 um for the prototype (the same finite elements); new rings out by more carry on fewer dogs
until they have bedded in. So the share falls with the number of dogs: given an accuracy class of
ISO 1328-1 or the standard deviation of the pitch, it follows from both in place of the fixed one
(``sim.strength.sharing``).

*Coast*. The braking flank carries the share :math:`c` of the torque, :math:`c K_A T`. What a petrol
engine brakes with is its motored friction, 1.9 bar at 3000 and 3.0 bar at 5000 1/min (Heywood,
*Internal Combustion Engine Fundamentals*, 1988, equation 13.6), and half a bar of throttled intake,
against 8.5 to 10.5 bar at full load: 0.25 to 0.4. A supercharged engine has half of that, an
electric machine that recuperates up to 1, which is the default.

Sources: Naunheimer et al., *Automotive Transmissions*, 2011 (application factor);
DIN 5466-1 (load sharing). The MQ200 is rated at 200 N m and its dog ring turns at
input speed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dogshape.sim.elementwise import each
from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.flank import Flank
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.strength.sharing import (
    SIGMAS,
    STIFFNESS,
    landing_share,
    load_share,
    pitch_tolerance,
)
from dogshape.sim.units import from_si


@dataclass(frozen=True)
class LoadCase:
    """Loads that a dog has to carry, hold and let go.

    Parameters
    ----------
    torque : rated torque, N m.
    application_factor, load_sharing : see above.
    load_height : of the resultant, as a share of the height that touches.
    safety, safety_fatigue : against yielding and against fatigue.
    shifts : over the life; each is one load cycle.
    spectrum : classes of torque over the rated one and their cycles over the life, which replace
        the load cycle of each shift in the fatigue of the root; a negative torque loads the
        braking flank.
    abuse_torque : of misuse, N m without further factor, which either flank survives; None for the
        design torque alone.
    reversal : factor on the endurance of a root that is bent both ways.
    friction_release : static coefficient, for release and self-locking.
    friction_hold : low dynamic coefficient, for what has to be held.
    separating_force_limit : that the blocking mechanism holds, N.
    vibration_force : inertia of the ring in gearbox vibration, N, which the blocking mechanism
        holds beside the separating force.
    coast_share : torque on the braking flank over that on the traction flank.
    pull_out_force_limit : that the actuator pulls the ring out with, N; None for no such check.
    accuracy : class of ISO 1328-1 that the dogs are made to; None for the fixed load sharing.
    pitch_sd : standard deviation of a single pitch deviation in place of a class, m.
    run_out : total radial run-out of one ring on the other that no play takes, m.
    tilt : angle between the rings as they land, rad.
    dog_stiffness : of a pair of dogs along the circumference, N/m; None for 25 N/(mm um) of width.
    release_by_itself : whether flanks have to let go under torque without a pull.
    spline_friction, spline_radius : of the toothing that the ring sits on, the latter in m.
    landing_share : share of shifts that may land harder than the checks take
        (``sim.strength.landing``); None for the hardest of those simulated.
    edge_bed : stiffness of the simulated contact, Pa/m, whose blows on edges are taken by a line
        contact of steel (``sim.strength.line_contact``); None for the simulated load itself.
    """

    torque: float = 200.0
    application_factor: float = 1.5
    load_sharing: float = 0.5
    load_height: float = 0.9
    safety: float = 1.2
    safety_fatigue: float = 1.2
    shifts: float = 1e5
    reversal: float = 0.7
    friction_release: float = 0.12
    friction_hold: float = 0.05
    separating_force_limit: float = 5000.0
    vibration_force: float = 0.0
    coast_share: float = 1.0
    pull_out_force_limit: float | None = None
    release_by_itself: bool = True
    spectrum: tuple[tuple[float, float], ...] = ()
    abuse_torque: float | None = None
    accuracy: int | None = None
    pitch_sd: float | None = None
    run_out: float = 0.0
    tilt: float = 0.0
    dog_stiffness: float | None = None
    spline_friction: float = NOTHING.spline_friction
    spline_radius: float = NOTHING.spline_radius
    landing_share: float | None = None
    edge_bed: float | None = None

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("torque_Nm", self.torque, 1e-3, 1e5),
            ("application_factor", self.application_factor, 0.5, 10.0),
            ("load_sharing", self.load_sharing, 0.01, 1.0),
            ("load_height", self.load_height, 0.5, 1.0),
            ("safety", self.safety, 1.0, 10.0),
            ("safety_fatigue", self.safety_fatigue, 1.0, 10.0),
            ("shifts", self.shifts, 1.0, 1e12),
            ("reversal", self.reversal, 0.1, 1.0),
            ("friction_release", self.friction_release, 0.0, 1.0),
            ("friction_hold", self.friction_hold, 0.0, 1.0),
            ("separating_force_limit_N", self.separating_force_limit, 1.0, 1e6),
            ("abuse_torque_Nm", self.abuse_torque, 1e-3, 1e6),
            ("coast_share", self.coast_share, 0.0, 1.0),
            ("pull_out_force_limit_N", self.pull_out_force_limit, 1.0, 1e6),
            ("accuracy", self.accuracy, 1, 11),
            ("pitch_sd_um", _edge("_um", self.pitch_sd), 0.0, 1000.0),
            ("run_out_um", from_si("_um", self.run_out), 0.0, 1000.0),
            ("tilt_mrad", from_si("_mrad", self.tilt), 0.0, 50.0),
            ("dog_stiffness_N_um", _edge("_N_um", self.dog_stiffness), 0.1, 1e5),
            ("landing_share", self.landing_share, 1e-4, 0.5),
        ):
            if value is not None:
                require_between(f"load.{name}", value, low, high, "correct the load case")
        for share, cycles in self.spectrum:
            remedy = "give classes as [torque over the rated one, cycles]"
            require_between("load.spectrum: torque", share, -10.0, 10.0, remedy)
            require_between("load.spectrum: cycles", cycles, 1.0, 1e15, remedy)
        if self.accuracy is not None and self.pitch_sd is not None:
            raise InputError(
                "load.accuracy and load.pitch_sd_um both say how the dogs scatter; leave out one"
            )
        if self.friction_hold > self.friction_release:
            rule = f"it must not exceed load.friction_release = {self.friction_release:.6g}"
            remedy = "holding is judged with the lower coefficient; exchange or correct them"
            message = refusal("load.friction_hold", self.friction_hold, "", rule, remedy)
            raise InputError(message)

    @property
    def design_torque(self) -> float:
        """Torque times application factor, N m."""
        return self.torque * self.application_factor

    def share_of(self, flank: Flank) -> float:
        """Return the torque that a flank carries over the rated one."""
        return 1.0 if flank == "traction" else self.coast_share

    def static_torque(self, flank: Flank) -> float:
        """Return the largest torque that a flank has to survive, N m."""
        return max(self.design_torque * self.share_of(flank), self.abuse_torque or 0.0)

    def force_per_dog(
        self, dog: Dog, flank: Flank = "traction", torque: float | None = None
    ) -> float:
        """Tangential force on the dog that carries most, N; under the static torque by default."""
        torque = self.static_torque(flank) if torque is None else torque
        return torque / (dog.mean_radius * dog.count * self.sharing(dog, torque))

    def scatter(self, dog: Dog) -> float | None:
        """Standard deviation of the dogs' gaps, m; None where the load sharing is fixed."""
        if self.accuracy is None:
            return self.pitch_sd
        return pitch_tolerance(self.accuracy, 2.0 * dog.mean_radius, dog.count) / SIGMAS

    def stiffness(self, dog: Dog) -> float:
        """Stiffness of a pair of dogs, N/m."""
        return self.dog_stiffness or STIFFNESS * dog.radial_width

    def sharing(self, dog: Dog, torque: float) -> float:
        """Return the equal load of a dog under ``torque`` (N m) over that of the most loaded."""
        if torque == 0.0:
            return self.load_sharing
        equal = torque / (dog.mean_radius * dog.count)
        return self._share(self._load_share, dog, equal, 0.5 * self.run_out)

    def _load_share(self, count: int, scatter: float, wave: float) -> float:
        return load_share(count, scatter, wave)

    def _landing_share(self, count: int, scatter: float, wave: float) -> float:
        return landing_share(count, scatter, wave)

    def landing(self, dog: Dog, line_load: float) -> float:
        """Return the share of the dogs that lands; ``line_load`` in N/m is that of all alike."""
        # Thousands of landings differ by less: three digits let them share an answer.
        force = line_load * dog.radial_width
        return self._share(self._landing_share, dog, force, dog.mean_radius * self.tilt, digits=3)

    def blow(self, dog: Dog, force: float) -> float:
        """Return the share of the dogs that takes a strike on flanks; ``force`` in N as above."""
        return self._share(self._landing_share, dog, force, 0.5 * self.run_out, digits=3)

    def _share(
        self,
        share: Callable[[int, float, float], float],
        dog: Dog,
        force: float,
        wave: float,
        digits: int | None = None,
    ) -> float:
        """Compute a share of the dogs; ``load_sharing`` where nothing is said of their errors."""
        scatter = self.scatter(dog)
        if scatter is None and wave == 0.0:
            return self.load_sharing

        def of_one(count: int, force: float, stiffness: float, *errors: float) -> float:
            if force == 0.0:
                return self.load_sharing
            found = [error * stiffness / force for error in errors]
            if digits is not None:
                found = [float(f"{value:.{digits}g}") for value in found]
            return share(int(count), *found)

        errors = 0.0 if scatter is None else scatter, wave
        return each(of_one, dog.count, force, self.stiffness(dog), *errors)


def _edge(unit: str, value: float | None) -> float | None:
    return None if value is None else from_si(unit, value)
