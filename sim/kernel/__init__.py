"""Compiled engine: contact, motion, and the summary of a run; values in ``sim.kernel_layout``."""

from __future__ import annotations

from dogshape.sim.kernel.actuator import actuator_force, actuator_rates, air_flow
from dogshape.sim.kernel.compiler import compiled
from dogshape.sim.kernel.contact import (
    FACE_DEPTH_SHARE,
    clip_workspace,
    contact,
    face_overlap,
    faces_meet,
    impact_friction_at,
    overlapping_surfaces,
)
from dogshape.sim.kernel.motion import (
    ENGAGED,
    FULL,
    HELD,
    PAUSED,
    STILL_WINDOW_S,
    UNDERFLOW,
    StepProgress,
    advance,
    contact_loads,
    rates,
    stands_still,
    stays_held,
)
from dogshape.sim.kernel.summary import (
    ShiftSummary,
    contact_means,
    crossing,
    drive_work,
    energy_lost,
    extremes,
    passed_over,
    penetration,
    shift_force,
    summarize,
    touching,
)

__all__ = [
    "ENGAGED",
    "FACE_DEPTH_SHARE",
    "FULL",
    "HELD",
    "PAUSED",
    "STILL_WINDOW_S",
    "UNDERFLOW",
    "ShiftSummary",
    "StepProgress",
    "actuator_force",
    "actuator_rates",
    "advance",
    "air_flow",
    "clip_workspace",
    "compiled",
    "contact",
    "contact_loads",
    "contact_means",
    "crossing",
    "drive_work",
    "energy_lost",
    "extremes",
    "face_overlap",
    "faces_meet",
    "impact_friction_at",
    "overlapping_surfaces",
    "passed_over",
    "penetration",
    "rates",
    "shift_force",
    "stands_still",
    "stays_held",
    "summarize",
    "touching",
]
