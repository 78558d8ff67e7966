r"""Torque that a shift raises in the driveline.

The rings of the simulation have no driveline between them; what their contact gives is its
torque on the sliding ring over time, :math:`M(t)`, which takes up the mismatch:
:math:`J \dot u = -M`, :math:`J = J_1 J_2/(J_1 + J_2)`. A driveline of torsional stiffness *c*
takes it up instead, the output ring's inertia being the vehicle's side behind that spring and
the sliding ring's the near one. Both are two inertias on a spring, at rest before the shift
and driven by M, so that the torque *T* in the spring is Duhamel's integral (Rao, *Mechanical
Vibrations*, section 4.5)

.. math:: \ddot T + \omega^2 T = \omega^2 M, \qquad
   T(t) = \omega \int_0^t M(\tau) \sin \omega(t - \tau)\,d\tau, \qquad \omega = \sqrt{c/J}.

Limits: a strike that takes :math:`\Delta u` of the mismatch in far less than a period has the
impulse :math:`J \Delta u` and makes :math:`T = \Delta u \sqrt{c J}`; many within so short a time
make as much as one that takes all of it. Spread evenly over a time *s*, they make
:math:`2 (J \Delta u/s) \sin(\omega s/2)`, and never more than twice the mean torque once *s* is
longer than half a period.

M is the mean over each step of the trace, and the integral is exact for such steps. A shift
ends just before full depth; then both flanks close, and what mismatch is left there strikes
once more. Nothing damps the swing, so strikes that follow each other in its time add up.

What this leaves out: a driveline that gives way softens the strike itself, whose impulse is
that of rigid rings, and a lighter near side than the sliding ring rings higher.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.loads import Loads
from dogshape.sim.shift.trace import Trace


@dataclass(frozen=True)
class TorquePeaks:
    """Torque peaks of a driveline in a shift, N m.

    Parameters
    ----------
    whole : response to the whole record of contact torque and to what is left at its end.
    strike : closed form for the hardest strike alone.
    closing : closed form for the mismatch left when the flanks close for good; None where
        none closed.
    """

    whole: float
    strike: float
    closing: float | None


def torque_peaks(clutch: Clutch, trace: Trace, loads: Loads, stiffness: float) -> TorquePeaks:
    """Compute the torque peaks of a shift in a driveline of ``stiffness`` in N m/rad."""
    inertia, left = clutch.rings.reduced_inertia, loads.residual_mismatch
    return TorquePeaks(
        whole=response(clutch, trace, stiffness),
        strike=torque_peak(loads.strike_mismatch, stiffness, inertia),
        closing=None if left is None else torque_peak(left, stiffness, inertia),
    )


def torque_peak(mismatch: float, stiffness: float, inertia: float) -> float:
    """Compute the torque in N m with which a driveline takes up a mismatch in one strike.

    ``mismatch`` in rad/s, torsional ``stiffness`` in N m/rad, reduced ``inertia`` in kg m2.
    """
    return abs(mismatch) * math.sqrt(stiffness * inertia)


def response(clutch: Clutch, trace: Trace, stiffness: float) -> float:
    """Compute the largest torque in N m of a driveline under the contact torque of a shift."""
    inertia = clutch.rings.reduced_inertia
    rate = math.sqrt(stiffness / inertia)
    torque = trace.tangential_force[1:] * clutch.dog.mean_radius
    turns = rate * (trace.time - trace.time[0])
    back = np.exp(-1j * turns)
    pushes = torque * (back[:-1] - back[1:]) / 1j
    # T is the imaginary part of the state and its rate over that of the swing the real one.
    state = np.concatenate([[0.0], np.cumsum(pushes)]) / back
    ahead, swing = state.imag[:-1] - torque, np.hypot(state.imag[:-1] - torque, state.real[:-1])
    crest = np.arctan2(state.real[:-1], ahead) % (2.0 * math.pi)
    trough = (crest + math.pi) % (2.0 * math.pi)
    within = np.diff(turns)
    largest = [np.abs(state.imag)]
    for place, value in ((crest, torque + swing), (trough, torque - swing)):
        largest.append(np.abs(np.where(place <= within, value, 0.0)))
    engaged = bool((trace.displacement >= clutch.shift_travel).any())
    last = inertia * float(trace.relative_speed[-1]) * rate if engaged else 0.0
    return max(float(np.concatenate(largest).max()), float(abs(state[-1] + last)))
