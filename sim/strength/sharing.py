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
184 N/mm (``benchmarks/load_height.py``), which is 21 to 35 N/(mm um).
"""

from __future__ import annotations

import math
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
    return float(base * 2.0 ** (0.5 * (accuracy - 5)) * MICRON)


@lru_cache(maxsize=4096)
def load_share(count: int, scatter: float, wave: float = 0.0) -> float:
    """Compute the load sharing of ``count`` dogs.

    ``scatter`` is the standard deviation of the gaps, ``wave`` the amplitude of their slow error,
    both over the approach of perfect dogs: sigma c N/F and a c N/F.
    """
    gaps = _gaps(count, scatter, wave)
    touching = np.arange(1, count + 1)
    approach = _first((count + np.cumsum(gaps, axis=1)) / touching, gaps)
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
    # A row a dog, the foremost first: few land, and rows of the others are not looked at.
    if wave == 0.0:
        size, gaps = scatter, _normal_rows(count)
    else:
        size, gaps = 1.0, _gaps(count, scatter, wave).T
    found, left = np.empty(SAMPLES), np.arange(SAMPLES)
    summed, squares, following = np.zeros(SAMPLES), np.zeros(SAMPLES), size * gaps[0]
    for place in range(count):
        here, touching = following, place + 1
        summed, squares = summed + here, squares + here**2
        mean = summed / touching
        # The root is real up to the first number of dogs that fits.
        spread = squares / touching - mean**2
        approach = mean + np.sqrt(np.maximum(count / touching - spread, 0.0))
        last = touching == count
        following = np.full(left.size, np.inf) if last else size * gaps[touching, left]
        fits = approach <= following
        found[left[fits]] = approach[fits]
        left, summed, squares, following = (
            part[~fits] for part in (left, summed, squares, following)
        )
        if not left.size:
            break
    return float(1.0 / found.mean() ** 2)


def _gaps(count: int, scatter: float, wave: float) -> Floats:
    """Return gaps beyond the smallest, in their order, (samples, count).

    They are taken from the foremost before they are scaled, so that wide ones lose no digits.
    """
    if wave == 0.0:
        return scatter * _normal_gaps(count)
    larger = max(scatter, wave)
    drawn, phase = _drawn(count)
    around = 2.0 * np.pi * (np.arange(count) / count + phase[:, None])
    return larger * _from_foremost(scatter / larger * drawn + wave / larger * np.cos(around))


@lru_cache(maxsize=64)
def _normal_gaps(count: int) -> Floats:
    """Return gaps of standard deviation 1 beyond the smallest, in their order, (samples, count)."""
    gaps = _from_foremost(_drawn(count)[0])
    gaps.flags.writeable = False
    return gaps


@lru_cache(maxsize=64)
def _normal_rows(count: int) -> Floats:
    """Return the same, a row a dog, (count, samples)."""
    rows = np.ascontiguousarray(_normal_gaps(count).T)
    rows.flags.writeable = False
    return rows


def _drawn(count: int) -> tuple[Floats, Floats]:
    """Draw normal gaps, (samples, count), and the phase of each pair's slow error, (samples,)."""
    rng = np.random.default_rng(SEED)
    return rng.standard_normal((SAMPLES, count)), rng.random(SAMPLES)


def _from_foremost(gaps: Floats) -> Floats:
    ordered: Floats = np.sort(gaps, axis=1)
    return ordered - ordered[:, :1]


def _first(approach: Floats, gaps: Floats) -> Floats:
    """Return the approach of each sample with as many dogs as it touches, (samples,).

    Column j of ``approach`` is that of the j + 1 foremost dogs, which holds while it does not
    reach the next gap.
    """
    beyond = np.concatenate([gaps[:, 1:], np.full((len(gaps), 1), np.inf)], axis=1)
    found: Floats = approach[np.arange(len(gaps)), (approach <= beyond).argmax(axis=1)]
    return found
