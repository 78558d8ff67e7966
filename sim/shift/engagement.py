"""One engagement: from the start of the force to full depth.

Outcomes are values, not exceptions: a shift that blocks, runs out of time or
diverges is a result like any other. The simulator's monitor records every step
and stops the run; everything else is worked out afterwards from the record.
"""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.framework import Context, EventStatus

from dogshape.sim import kernel
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Run, engaged, failure_of
from dogshape.sim.shift.plant import ClutchPlant


def engage(plant: ClutchPlant, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift.

    Times count from the command: a dead time comes before the phases, while the time-out counts
    from the start of the force. Physical failure and a failed integration are outcomes.

    Parameters
    ----------
    plant : built once for a clutch and used again.
    point : mismatch and force.
    relative_angle : output ring's lead over dogs facing dogs at the start of the force, rad.
    """
    first = _run(plant, point, relative_angle)
    return engaged(
        plant.clutch, point, relative_angle, first,
        lambda finer: _run(ClutchPlant(finer), point, relative_angle),
    )  # fmt: skip


def _run(plant: ClutchPlant, point: OperatingPoint, relative_angle: float) -> Run:
    simulator, clutch = plant.start(point, relative_angle), plant.clutch
    # Places in the state of what has not made its travel: ring, actuator.
    under_way = {1, 6} if clutch.mechanism.has_linkage else {1}
    # Beside where the run begins: the time in which the ring was held.
    times, states = plant.held[0][:-1].tolist(), [*plant.held[1][:-1]]
    blocked, failure, last, check_at = False, "", np.full(12, np.nan), kernel.STILL_WINDOW
    deadline = time.monotonic() + clutch.solver.time_limit

    def record(context: Context) -> EventStatus | None:
        """Keep a step, and stop the run where it has ended."""
        nonlocal blocked, failure, last, check_at
        now, state = context.get_time(), plant.state()
        times.append(now)
        states.append(state)
        under_way.difference_update([i for i in under_way if state[i] >= clutch.shift_travel])
        if under_way and len(times) > 1:
            failure = failure_of(clutch, now, state, len(times), deadline)
        if under_way and not failure and now >= check_at:
            left, knots = clutch.timeout - now, point.profile.knots
            blocked = kernel.stands_still(now, last, state, left, clutch.numbers, knots)
            last, check_at = state, now + kernel.STILL_WINDOW
        ended = blocked or failure or not under_way
        return EventStatus.ReachedTermination(plant.plant, "ended") if ended else None

    simulator.set_monitor(record)
    try:
        record(plant.context)
        simulator.AdvanceTo(clutch.timeout)
    except RuntimeError as error:
        if len(times) < 2:
            raise  # not a step was made: the model is wrong, not the motion
        failure = str(error).split("\n")[0]
    finally:
        simulator.clear_monitor()
    spent = simulator.get_integrator().get_num_derivative_evaluations()
    grown = np.diff(times, prepend=-1.0) > 0.0
    return Run(np.array(times)[grown], np.array(states)[grown], blocked, failure, spent)
