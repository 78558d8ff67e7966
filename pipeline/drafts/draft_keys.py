"""Keys of a study that a draft asks for or derives, and their words for a dialogue."""

from __future__ import annotations

from typing import get_args

from dogshape.pipeline.config.operating import KIND
from dogshape.sim.shift.actuators import KINDS, PROFILE
from dogshape.sim.shift.drive import ENGINE_SIDES
from dogshape.sim.shift.geometry import Mount
from dogshape.sim.strength.materials import MATERIALS

DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT = "dog.height_mm"
HEIGHT_RANGE = "variables.height_mm"
FORCE_RANGE = "variables.force_factor"
RISE_RANGE = "variables.rise_factor"
COUNT = "dog.count"
MOUNT = "dog.mount"
RIM = "manufacturing.rim_mm"
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
POINT_SET = "operating.set"
STRIKE_MISMATCH = "strike.mismatch_rpm"
#: Words for the kind of the actuator, which decides its other keys.
ACTUATOR_KIND = {KIND: "kind of the actuator; profile: a force over time"}
#: Words for the numbers of the kinds.
ACTUATOR_NUMBERS = {
    "actuation.preload_N": "preload of the spring at the start of the travel, N",
    "actuation.rate_N_mm": "rate of the spring, N/mm",
    "actuation.start_force_N": "force of the magnet at the start of its stroke, N",
    "actuation.end_force_N": "force of the magnet at the end of its stroke, N",
    "actuation.stroke_mm": "stroke of groove or magnet, mm",
    "actuation.voltage_V": "voltage on the coil, V",
    "actuation.resistance_ohm": "resistance of the warm coil, ohm",
    "actuation.inductance_mH": "inductance of the coil at the start of the stroke, mH",
    "actuation.rated_current_A": "current of both forces, A; 0: voltage over resistance",
    "actuation.ramp_deg": "angle of the drum over which the groove rises, deg",
    "actuation.dwell_deg": "angle of the drum before the groove rises, deg",
    "actuation.drum_speed_rpm": "speed of the drum, 1/min",
    "actuation.stall_torque_Nm": "stall torque of the motor, N m",
    "actuation.no_load_speed_rpm": "no-load speed of the motor, 1/min",
    "actuation.torque_limit_Nm": "torque limit of the motor's control, N m",
    "actuation.rotor_inertia_kgm2": "inertia of rotor and gear at the motor, kg m²",
    "actuation.gear_ratio": "gear ratio, motor over spindle or pinion",
    "actuation.lead_mm": "travel of the fork per revolution of spindle or pinion, mm",
    "actuation.efficiency": "efficiency of gear and spindle",
    "actuation.stiffness_N_mm": "stiffness between drum or spindle and fork, N/mm",
    "actuation.force_limit_N": "largest force that the drive of the drum gives the fork, N",
    "actuation.supply_bar": "supply pressure above the ambient one, bar",
    "actuation.area_cm2": "area of the piston, cm²; of several A + B",
    "actuation.dead_volume_cm3": "volume behind the piston at the start, with pipes, cm³",
    "actuation.conductance_dm3_s_bar": "sonic conductance of the valve (ISO 6358), dm³/(s bar); or "
    "its opening in mm²",
    "actuation.critical_ratio": "critical pressure ratio of the valve (ISO 6358)",
    "actuation.flow_l_min": "rated flow of the valve, l/min",
    "actuation.drop_bar": "pressure drop of the rated flow, bar",
    "actuation.bulk_modulus_MPa": "bulk modulus of the oil with its air, MPa",
    "actuation.back_pressure_bar": "pressure on the back of the piston, bar; 0: none",
    "actuation.back_area_cm2": "area of the back of the piston, cm²; 0: no pressure there",
    "actuation.return_preload_N": "preload of the return spring, N; 0: none",
    "actuation.return_rate_N_mm": "rate of the return spring, N/mm",
}
#: Words for the keys of the actuator.
ACTUATION = {
    **ACTUATOR_NUMBERS,
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
    MOUNT: "root of the dogs: face of a ring, or sleeve for teeth rooted radially",
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
    RIM: "thickness of the sleeve outside its teeth, mm; 0: unknown",
    SPEED: "speed of both shafts, on the wheels' side, 1/min, of a range its middle; "
    "0: the sliding ring stands",
    SIDE: "ring that turns with the engine",
    DRAG: "drag torque on the sliding ring, N m",
    HOLDING_FORCE: "force of latch or detent on the engaged ring, N; 0: unknown",
    PULL_OUT_SHARE: "share of the torque at which the ring is pulled out",
    "load.shifts": "shifts over the life",
    STRIKE_RING: "inertia of the sliding ring alone, a part of that of its side, kg m², "
    "one or two ends of a range; 0: unknown",
    STRIKE_SHAFT: "stiffness of the shaft behind the ring, N m/rad, one or two ends; 0: unknown",
    MATERIAL: "material",
}
#: Questions of a new study by part; the answers to one decide the defaults of the next.
PARTS = {
    "Actuator": ACTUATOR_KIND,
    "Actuation": ACTUATION,
    "Operating points": OPERATION,
    "Dogs and rings": CLUTCH,
    "Use": USE,
}
WORDS = {key: words for part in PARTS.values() for key, words in part.items()}
CHOICES = {
    KIND: (PROFILE, *KINDS),
    MATERIAL: tuple(MATERIALS),
    SIDE: ENGINE_SIDES,
    MOUNT: get_args(Mount),
}
#: Keys of which one value may stand for a list.
LIST_KEYS = (ACTUATOR, "actuation.rise_s", *OPERATION)
ROOF_CREST = 0.5  #: ridge of a roof tip in the middle, for either sign of the mismatch
