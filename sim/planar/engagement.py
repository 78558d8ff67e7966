"""One engagement by the compiled engine: the problem and the result are those of Drake's.

``Solver.accuracy`` is the error of a speed that a step may have, m/s, and ``PLACE`` times it that
of a place. The friction law is that of Drake's scheme: with the dynamic coefficient alone, or one
that falls from the static to the dynamic one where the scheme is ``cenic``.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.planar import kernel
from dogshape.sim.planar.plant import PlanarClutch, planar_clutch, state_size
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import FINER, Engagement, Run, conclude, passed_through
from dogshape.sim.shift.events import STILL_WINDOW, stands_still
from dogshape.sim.shift.outcome import TIME_LIMIT
from dogshape.sim.shift.release import release

Floats = NDArray[np.float64]

PLACE = 1e-4  #: s, error of a place over that of a speed
FIRST = 1e-5  #: s, first step
ROOM = 4096  #: steps that are recorded at once


def engage(plant: PlanarClutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift; see ``sim.shift.engagement.engage``, whose Drake shift this one follows.

    Parameters
    ----------
    plant : clutch, prepared once.
    point : mismatch and force.
    relative_angle : output ring's lead over dogs facing dogs, rad.
    """
    run = _run(plant, point, relative_angle)
    found = conclude(plant.clutch, point, relative_angle, run)
    if not passed_through(run, found):
        return found
    clutch, solver = plant.clutch, plant.clutch.solver
    finer = replace(clutch, solver=replace(solver, max_step=solver.max_step / FINER))
    more = _run(planar_clutch(finer), point, relative_angle)
    again = conclude(clutch, point, relative_angle, more)
    return replace(again, evaluations=run.evaluations + more.evaluations)


def _run(plant: PlanarClutch, point: OperatingPoint, angle: float) -> Run:
    """Integrate from where friction lets the ring go to the end of the travel or the time-out."""
    clutch, solver = plant.clutch, plant.clutch.solver
    size = state_size(clutch.mechanism)
    tolerance = np.array([solver.accuracy, PLACE * solver.accuracy])
    knots = np.array(point.profile.knots())
    times, states = _begin(plant, point, angle)
    now, state, step, spent = float(times[-1]), states[-1].copy(), FIRST, 0
    count, last, blocked, failure = len(times), None, False, ""
    parts, mode = [(times, states)], np.zeros(2)
    end = time.monotonic() + solver.time_limit
    while now < clutch.timeout:
        until = min(STILL_WINDOW * (math.floor(now / STILL_WINDOW + 1e-9) + 1), clutch.timeout)
        room, places = np.empty(ROOM), np.empty((ROOM, kernel.SIZE))
        why, now, step, made, tried = kernel.advance(
            now, step, state, until, plant.numbers, knots, plant.surfaces, plant.law, tolerance,
            solver.max_step, mode, room, places,
        )  # fmt: skip
        parts.append((room[:made], places[:made]))
        count, spent = count + made, spent + tried
        failure = _failure(plant, now, count, time.monotonic() > end)
        if why == kernel.LOST or not np.isfinite(state).all():
            failure = f"the motion is not finite at {now:.6g} s"
        if failure or why == kernel.ENGAGED:
            break
        if why == kernel.PAUSED:
            if stands_still(clutch, point, now, last, state):
                blocked = True
                break
            last = state.copy()
    whole = np.concatenate([part for _, part in parts])[:, :size]
    return Run(np.concatenate([part for part, _ in parts]), whole, blocked, failure, spent)


def _begin(plant: PlanarClutch, point: OperatingPoint, angle: float) -> tuple[Floats, Floats]:
    """Give times and states, (n,) and (n, 12), up to where friction lets the ring go."""
    held, sliding = release(plant.clutch, point.profile), plant.clutch.rings.initial_speed
    output = sliding + point.mismatch
    states = np.zeros((len(held.time), kernel.SIZE))
    states[:, 0], states[:, 2] = angle + output * held.time, sliding * held.time
    states[:, 3], states[:, 5] = output, sliding
    states[:, 6], states[:, 7] = held.displacement, held.speed
    states[:, 8], states[:, 9] = states[:, 2], sliding
    states[:, 10], states[:, 11] = states[:, 0], output
    return held.time, states


def _failure(plant: PlanarClutch, now: float, count: int, late: bool) -> str:
    """Name the limit that a run has passed; empty where there is none."""
    solver = plant.clutch.solver
    if count > solver.max_steps:
        return f"no end after solver.max_steps = {solver.max_steps}, at {now:.6g} s of the shift"
    if late:
        return f"{TIME_LIMIT} = {solver.time_limit:.6g}, at {now:.6g} s of the shift"
    return ""
