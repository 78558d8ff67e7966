"""A shift that begins with a dead time: nothing moves along the shaft until the force starts.

Both rings turn on meanwhile. The relative angle of a shift is that at the start of the force, so
what follows is the same shift, and every time of it is later by the dead time exactly.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from dogshape.sim.shift.phases import Phase
from dogshape.sim.shift.trace import Trace

DEAD_TIME = "dead time"  #: name of the phase before the force starts


def later(time: float | None, delay: float) -> float | None:
    """Move a time by a dead time in s; None stays."""
    return None if time is None else time + delay


def later_phases(phases: tuple[Phase, ...], delay: float) -> tuple[Phase, ...]:
    """Put the dead time in s before the phases of a shift."""
    moved = [Phase(one.name, one.start + delay, one.end + delay) for one in phases]
    return (Phase(DEAD_TIME, 0.0, delay), *moved)


def later_trace(trace: Trace, delay: float) -> Trace:
    """Put the dead time in s before a trace, as one more state at the command, (n + 1,)."""
    kept = [one.name for one in fields(trace) if getattr(trace, one.name) is not None]
    first = {name: getattr(trace, name)[0] for name in kept}
    first["time"] = 0.0
    first["relative_angle"] -= delay * float(trace.relative_speed[0])
    later_times = replace(trace, time=trace.time + delay)
    return Trace(
        **{name: np.concatenate([[value], getattr(later_times, name)])
           for name, value in first.items()}
    )  # fmt: skip
