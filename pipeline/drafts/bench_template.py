"""The commented ``bench.toml`` that a new bench folder begins with."""

from __future__ import annotations

TEMPLATE = """\
# A bench data set (docs/bench.md). Check each value: the diagnosis takes them as the truth.
name = "my bench"
source = "who measured it, when, and in which report"
timeout_s = 1.0             # after which the stand gives a shift up
shift_travel_mm = 4.65      # travel of the ring at which a shift counts as finished

[dog]
count = 15
chamfer_deg = 8.0           # of the face
traction_deg = 12.0         # side angle of the traction flank
braking_deg = 22.0          # side angle of the braking flank
height_mm = 3.7
outer_diameter_mm = 52.0
inner_diameter_mm = 44.0
axial_gap_mm = 1.0          # between the crests before the shift

[sliding]                   # the ring that is shifted, with all that moves along with it
mass_kg = 0.3
inertia_kgm2 = 0.01
initial_speed_rpm = 0.0

[output]                    # the side that it engages, referred to the dogs
inertia_kgm2 = 0.6048

[contact]                   # what the stand's dogs and oil are believed to have
static_friction = 0.12
dynamic_friction = 0.10
stiction_velocity_m_s = 0.0002
friction_velocity_m_s = 1.0 # read and not used
stiffness_Pa_m = 5e11       # of the simulated contact, pressure per depth
dissipation_s_m = 100.0     # what a blow loses, after Hunt and Crossley

[record]                    # what no table shows (docs/bench.md); "unknown" weighs all readings
time_zero = "unknown"       # "command" or "force": from the force on, no dead time is named
displacement_at = "unknown" # "sleeve" or "actuator": mass behind a soft linkage shows there only
empty_cells = "unknown"     # "not_made" or "failed": failed shifts are evidence of blocking
sense = "unknown"           # "known" where the sign of mismatch_rpm was noted (docs/mismatch.md)

# The linkage, if the actuator does not act on the sleeve itself:
# [sensor]
# linkage_ratio = 3.2       # actuator travel over sleeve travel
# linkage_efficiency = 0.8  # share of the force that arrives

# Standard uncertainties of nominal values (docs/bench.md): alike in the whole series, or of each
# setting anew. Also force_N and mismatch_percent.
# [errors.systematic]
# force_percent = 0.5
# [errors.each_point]
# mismatch_rpm = 0.5
"""
