"""Faster and slower half of the shift times of an operating point.

Times over the angle often have two modes: dogs that meet a gap at once, and dogs that first slide
over a crest. A few shifts may then all be of one mode, and mean and deviation of such a sample are
no normal deviates. The times are divided where the variance between both parts is largest (Otsu
1979); of times with one mode both parts are about half.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.terms import Array


@dataclass(frozen=True)
class Modes:
    """Shares, means and standard deviations of both parts, s, (..., 2), the faster first."""

    share: Array
    mean: Array
    sd: Array


def modes_of(times: Array, least: float) -> Modes:
    """Divide ascending times (..., q), s; ``least`` is the least standard deviation, s."""
    size = times.shape[-1]
    count = np.arange(1.0, size)
    middle = times.mean(axis=-1, keepdims=True)
    apart = times - middle
    first = np.cumsum(apart, axis=-1)[..., :-1]
    # Both sums of deviations are opposite, so the variance between is their square's.
    between = first**2 / (count * (size - count))
    place = np.argmax(np.nan_to_num(between), axis=-1)[..., None]
    number = np.concatenate([place + 1.0, size - place - 1.0], axis=-1)
    below = np.take_along_axis(first, place, axis=-1)
    squares = np.cumsum(apart**2, axis=-1)
    lower = np.take_along_axis(squares, place, axis=-1)
    sums = np.concatenate([below, -below], axis=-1)
    every = np.concatenate([lower, squares[..., -1:] - lower], axis=-1)
    variance = (every - sums**2 / number) / np.maximum(number - 1.0, 1.0)
    sd = np.sqrt(np.maximum(variance, least**2))
    return Modes(number / size, middle + sums / number, sd)
