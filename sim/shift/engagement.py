"""One engagement: from the start of the force to full depth.

Outcomes are values, not exceptions: a shift that blocks, runs out of time or
diverges is a result like any other. The simulator's monitor records every step
and stops the run; everything else is worked out afterwards from the record.
"""

from __future__ import annotations

import time

import numpy as np
from pydrake.systems.framework import Context, EventStatus

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Run, engaged, failure_of
from dogshape.sim.shift.events import STILL_WINDOW, stands_still
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Series


class _Record:
    """Monitor of a run: keeps every step and says when to stop."""

    def __init__(self, plant: ClutchPlant, point: OperatingPoint) -> None:
        self.plant, self.point = plant, point
        #: Places in the state of what has not made its travel: ring, actuator.
        self.under_way = {1, 6} if plant.clutch.mechanism.has_linkage else {1}
        # Beside where the run begins: the time in which the ring was held.
        self.times: list[float] = plant.held[0][:-1].tolist()
        self.states: list[Series] = [*plant.held[1][:-1]]
        self.blocked, self.failure = False, ""
        self._deadline = time.monotonic() + plant.clutch.solver.time_limit
        self._check_at = STILL_WINDOW
        self._last: Series | None = None

    def __call__(self, context: Context) -> EventStatus | None:
        now, state, clutch = context.get_time(), self.plant.state(), self.plant.clutch
        self.times.append(now)
        self.states.append(state)
        self.under_way -= {i for i in self.under_way if state[i] >= clutch.shift_travel}
        if not self.under_way:
            return self._stop("engaged")
        if len(self.times) > 1:
            self.failure = failure_of(clutch, now, state, len(self.times), self._deadline)
        if self.failure:
            return self._stop("failed")
        if now >= self._check_at:
            last, self._last, self._check_at = self._last, state, now + STILL_WINDOW
            self.blocked = stands_still(clutch, self.point, now, last, state)
        return self._stop("blocked") if self.blocked else None

    def _stop(self, reason: str) -> EventStatus:
        return EventStatus.ReachedTermination(self.plant.plant, reason)


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
    simulator = plant.start(point, relative_angle)
    record = _Record(plant, point)
    simulator.set_monitor(record)
    try:
        record(plant.context)
        simulator.AdvanceTo(plant.clutch.timeout)
    except RuntimeError as error:
        if len(record.times) < 2:
            raise  # not a step was made: the model is wrong, not the motion
        record.failure = str(error).split("\n")[0]
    finally:
        simulator.clear_monitor()
    spent = simulator.get_integrator().get_num_derivative_evaluations()
    times, states = np.array(record.times), np.array(record.states)
    return Run(times, states, record.blocked, record.failure, spent)
