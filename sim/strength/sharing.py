r"""How many dogs carry: load sharing by number and accuracy of the dogs.

*Springs.* Each pair of dogs is a spring of stiffness *c* that touches when the rings have turned by
its gap :math:`g_i` (along the circumference); gaps are independent, normal, with standard deviation
:math:`\sigma`. Under the force *F* the rings approach by *d*, where
:math:`\sum_i c\,(d - g_i)_+ = F`. The most loaded dog takes :math:`c\,(d - g_{min})`, and

.. math:: K_s = \frac{F/N}{\overline{c\,(d - g_{min})}}

is the equal share over what it takes in the mean of ``SAMPLES`` pairs of rings. It depends on *N*
and :math:`\sigma c N/F` alone. One dog or perfect ones: 1. For two, :math:`z = |g_1 - g_2|` is
half-normal and the larger load is :math:`\min(F, (F + c z)/2)`. Bedding-in
is not in it.

*Landing.* Faces that fly at each other with the energy :math:`\tfrac12 N c\,\delta_0^2`, which
peaks at :math:`F_0 = c\,\delta_0` a dog where all land at once, peak at
:math:`c\,(\delta - h_{min})` on the foremost dog, where :math:`\tfrac12 \sum_i c\,(\delta -
h_i)_+^2` is that energy. Its ratio to :math:`F_0` is :math:`1/\sqrt{K_l}`, :math:`K_l` being the
share of the dogs that would land alike: near 1/N for a slow landing, near 1 for a hard one.

*Slow errors.* Around rings that run out of true the gaps have a wave beside their scatter,
:math:`a \cos(2\pi i/N + \varphi)` with a phase from pair to pair. Flanks: a total radial run-out
*t* that the play of the ring does not take makes *a = t/2*. Faces: rings tilted against each other
by :math:`\psi` make :math:`a = r_m \psi`. Where all dogs of perfect pitch touch, and :math:`F/N` is
approached by 1, the most loaded is approached by

.. math:: 1 + a\,\mathrm{E} \quad \text{(load)}, \qquad
   \sqrt{1 - a^2/2} + a\,\mathrm{E} \quad \text{(landing)}, \qquad
   \mathrm{E} = \frac{N}{\pi} \sin\frac{\pi}{N}.

A tilted ring lands on the few dogs of one side before it is thrown parallel: the share is that of
its first blow, with the moving mass as a whole behind it (an upper bound: it can turn away).

*Accuracy.* ISO 1328-1:2013, formula 5: single pitch tolerance of class *A*

.. math:: f_{pT} = (0.001\,d + 0.4\,m + 5)\,\sqrt 2^{\,A - 5} \quad \text{um},
   \qquad d, m = d/N \text{ in mm},

taken as three standard deviations of the single pitch deviation of a ring. That is the difference
of two neighbouring flanks, as a gap is the difference of a flank of either ring: with flanks that
scatter alike and independently, both have the same standard deviation. Faces are cut with the
flanks and taken to scatter as much along the shaft (an assumption).

*Stiffness.* 25 N/(mm um) of the dogs' radial width where none is given: plane finite elements of
two prototype dogs approach by 11.9 to 16.9 um under 417 N/mm, finer ones by 6.1 to 8.7 um under
184 N/mm (``tests/verification/flank_model.py``), which is 21 to 35 N/(mm um).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.units import MM

SAMPLES = 4096  #: pairs of rings; the mean is known to half a percent
SEED = 20261123
STIFFNESS = 25e9  #: N/m of a pair of dogs per m of their radial width
SIGMAS = 3.0  #: standard deviations of a single pitch deviation in its tolerance
MICRON = 1e-6
STEP = 0.02  #: of the logarithm of a scatter, between kept values

Floats = NDArray[np.float64]


def pitch_tolerance(accuracy: int, diameter: float, count: int) -> float:
    """Return the single pitch tolerance of ISO 1328-1:2013, m; ``diameter`` in m."""
    size = diameter / MM
    base = 0.001 * size + 0.4 * size / count + 5.0
    return base * 2.0 ** (0.5 * (accuracy - 5)) * MICRON


@lru_cache(maxsize=4096)
def load_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the load sharing of ``count`` dogs.

    ``scatter`` is the standard deviation of the gaps, ``wave`` the amplitude of their slow error,
    both over the approach of perfect dogs: sigma c N/F and a c N/F.
    """
    approach = _approach(
        *_gaps(count, scatter, wave), lambda touching, total, _: (count + total) / touching
    )
    return float(1.0 / approach.mean())


def neighbour_share(count: int, scatter: float) -> float:
    """Return the load sharing between two kept values, right to 1e-4.

    For thousands of clutches that differ by their tolerances: they share the values at both ends of
    a step of 2 %.
    """
    if scatter <= 0.0:
        return load_share(count, 0.0)
    place = math.log(scatter) / STEP
    low, high = (math.exp(STEP * end) for end in (math.floor(place), math.floor(place) + 1))
    one, other = load_share(count, low), load_share(count, high)
    return one + (other - one) * (scatter - low) / (high - low)


@lru_cache(maxsize=2**16)  # designs of a search have thousands of landings, many of them alike
def landing_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the share of ``count`` dogs that lands, as far as the peak force goes.

    ``scatter`` is the standard deviation of the faces, ``wave`` the amplitude of their slow error,
    both over the approach of perfect ones: sigma c/F_0 and a c/F_0.
    """

    def peak(touching: int, total: Floats, squares: Floats) -> Floats:
        mean = total / touching
        spread = squares / touching - mean**2
        # The root is real up to the first number of dogs that fits; none is looked at beyond.
        root: Floats = np.sqrt(np.maximum(count / touching - spread, 0.0))
        return mean + root

    return float(1.0 / _approach(*_gaps(count, scatter, wave), peak).mean() ** 2)


def _gaps(count: int, scatter: float, wave: float) -> tuple[float, Floats]:
    """Return a scale, and gaps over it beyond the smallest, in their order, (count, samples).

    They are taken from the foremost before they are scaled, so that wide ones lose no digits.
    """
    if wave == 0.0:
        return scatter, _normal_gaps(count)
    larger = max(scatter, wave)
    drawn, phase = _drawn(count)
    around = 2.0 * np.pi * (np.arange(count) / count + phase[:, None])
    return larger, _from_foremost(scatter / larger * drawn + wave / larger * np.cos(around))


@lru_cache(maxsize=64)
def _normal_gaps(count: int) -> Floats:
    """Return gaps of standard deviation 1 beyond the smallest, in their order, (count, samples)."""
    gaps = _from_foremost(_drawn(count)[0])
    gaps.flags.writeable = False
    return gaps


def _drawn(count: int) -> tuple[Floats, Floats]:
    """Draw normal gaps, (samples, count), and the phase of each pair's slow error, (samples,)."""
    rng = np.random.default_rng(SEED)
    return rng.standard_normal((SAMPLES, count)), rng.random(SAMPLES)


def _from_foremost(gaps: Floats) -> Floats:
    """Order gaps (samples, count) and take them from the smallest, (count, samples)."""
    ordered = np.ascontiguousarray(np.sort(gaps, axis=1).T)
    return ordered - ordered[0]


def _approach(scale: float, gaps: Floats, of: Callable[[int, Floats, Floats], Floats]) -> Floats:
    """Return the approach of each sample with as many dogs as it touches, (samples,).

    ``of`` gives it for a number of foremost dogs from the sums of their gaps and of their squares.
    ``scale`` times ``gaps`` (count, samples) are the gaps. An approach holds while it does not
    reach the next one.
    """
    found = np.empty(gaps.shape[1])
    left = np.arange(gaps.shape[1])
    here, total, squares = scale * gaps[0], 0.0 * gaps[0], 0.0 * gaps[0]
    for touching in range(1, len(gaps) + 1):
        total, squares = total + here, squares + here**2
        found[left] = approach = of(touching, total, squares)
        if touching < len(gaps):
            here = scale * gaps[touching, left]
            beyond = approach > here
            left, here = left[beyond], here[beyond]
            total, squares = total[beyond], squares[beyond]
    return found
