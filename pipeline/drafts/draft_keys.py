"""Keys of a study that a draft asks for or derives, and their words for a dialogue."""

from __future__ import annotations

from dogshape.sim.shift.drive import ENGINE_SIDES
from dogshape.sim.strength.materials import MATERIALS

DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT = "dog.height_mm"
COUNT = "dog.count"
BACKLASH = "dog.backlash_mm"
BACKLASH_DEG = "dog.backlash_deg"
CHAMFER = "dog.chamfer_deg"
CHAMFER_BACK = "dog.chamfer_back_deg"
CHAMFERS = (CHAMFER, CHAMFER_BACK)
CREST = "dog.crest"
PLAY_DEVIATION = "tolerance.backlash_mm"
TORQUE = "load.torque_Nm"
COAST = "load.coast_share"
RELEASE = "load.faces_release"
HOLDING_FORCE = "load.separating_force_limit_N"
PULL_OUT_SHARE = "load.pull_out_share"
MASS = "sliding.mass_kg"
ADDED_MASS = "mechanism.added_mass_kg"
ACTUATOR = "actuation.force_N"
OPERATING = "operating.force_N"
MISMATCH = "operating.mismatch_rpm"
POINTS = "operating.points"
STRIKE_MISMATCH = "strike.mismatch_rpm"
#: Words for the keys of the actuator.
ACTUATION = {
    ACTUATOR: "final forces of the actuator, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "shift.timeout_s": "time after which the control gives up an attempt, s",
    "shift.retraction_s": "time to pull back before the next attempt, s",
}
#: Words for the keys of the operating points, whose forces the actuator must reach.
OPERATION = {
    MISMATCH: "mismatches of the shifts, 1/min, with blanks between, or LOW to HIGH",
    OPERATING: "forces of the shifts, N, likewise",
}
#: Words for the keys of a clutch that a dialogue asks for.
CLUTCH = {
    COUNT: "number of dogs",
    CHAMFER: "chamfer of the face, deg; 0: flat",
    CHAMFER_BACK: "chamfer behind the ridge of a roof tip, deg; 0: no roof",
    CREST: "place of the ridge on the tip, 0 braking edge to 1 traction edge",
    "dog.traction_deg": "side angle of the traction flank, deg; below 0: undercut",
    "dog.braking_deg": "side angle of the braking flank, deg; below 0: undercut",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    BACKLASH: "backlash of the seated pair at the mean radius, mm; or in deg",
    PLAY_DEVIATION: "largest deviation of the backlash either way, mm",
    "dog.edge_radius_mm": "radius of the tip edges, mm",
    MASS: "mass of the sliding ring, kg",
    "sliding.inertia_kgm2": "inertia of the sliding ring and all that turns with it, kg m²",
    "output.inertia_kgm2": "inertia of the output side, referred to the dogs, kg m²",
}
RADIUS = "mechanism.spline_radius_mm"
DRAG = "mechanism.drag_torque_Nm"
MATERIAL = "material.set"
STRIKE_RING = "strike.ring_inertia_kgm2"
STRIKE_SHAFT = "strike.input_stiffness_Nm_rad"
STRIKE = (STRIKE_RING, STRIKE_SHAFT)  #: keys without which no flank strike is judged
#: Keys of the same ring and shaft in the shifts.
NOMINAL = {key: key.replace("strike.", "mechanism.") for key in STRIKE}
SPEED = "drive.shaft_speed_rpm"
SIDE = "drive.engine_side"
#: Words for the use of the clutch, and for keys whose default follows from it.
USE = {
    HEIGHT: "height of the dogs, mm",
    ADDED_MASS: "mass of fork, rod and piston that moves along, kg",
    TORQUE: "rated torque at the dogs, N m",
    COAST: "largest torque on the braking flank (coast, recuperation, reverse) over the rated one; "
    "or in N m",
    RADIUS: "radius of the toothing that the ring slides on, of a sleeve its own teeth's, mm",
    SPEED: "speed of both shafts, on the wheels' side, 1/min, of a range its middle; "
    "0: the sliding ring stands",
    SIDE: "ring that turns with the engine",
    DRAG: "drag torque on the sliding ring, N m",
    HOLDING_FORCE: "force of latch or detent on the engaged ring, N; 0: unknown",
    PULL_OUT_SHARE: "share of the torque at which the ring is pulled out",
    "load.shifts": "shifts over the life",
    STRIKE_RING: "inertia of the ring that strikes, kg m², one or two ends of a range; 0: unknown",
    STRIKE_SHAFT: "stiffness of the shaft behind it, N m/rad, one or two ends; 0: unknown",
    MATERIAL: "material",
}
WORDS = ACTUATION | OPERATION | CLUTCH | USE
CHOICES = {MATERIAL: tuple(MATERIALS), SIDE: ENGINE_SIDES}
#: Keys of which one value may stand for a list.
LIST_KEYS = (ACTUATOR, "actuation.rise_s", *OPERATION)
ROOF_CREST = 0.5  #: ridge of a roof tip in the middle, for either sign of the mismatch
