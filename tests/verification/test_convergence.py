"""The default setting against a far smaller tolerance, over designs and operating points."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.common import DESIGNS, angles_of, clutch_of, default_study, measure, point_of
from benchmarks.convergence import POINTS, error, with_accuracy
from sim.plant import ClutchPlant


@pytest.mark.slow
@pytest.mark.parametrize("design", sorted(DESIGNS))
def test_mean_shift_times_are_within_a_percent_of_the_converged(design: str) -> None:
    """Eight operating points, twelve angles each; single shifts within 0.01 % at the median."""
    clutch = clutch_of(default_study(), design)
    default, fine = ClutchPlant(clutch), ClutchPlant(with_accuracy(clutch, 1e-5))
    typical = []
    for index, (mismatch, force) in enumerate(POINTS):
        point = point_of(default_study(), mismatch, force)
        angles = angles_of(clutch, 12, index)
        mean, single = error(measure(default, point, angles), measure(fine, point, angles))
        assert mean < 1.0, (mismatch, force)
        typical.append(single)
    assert np.median(typical) < 0.01


def test_error_falls_with_the_tolerance() -> None:
    """A shift that slides and does not bounce: smooth, so at least of the order of one half."""
    study = default_study()
    clutch, point = clutch_of(study, "prototype"), point_of(study, 10.0, 469.0)
    angles = np.array([0.3, 0.9]) * clutch.dog.pitch_angle
    cells = {
        accuracy: measure(ClutchPlant(with_accuracy(clutch, accuracy)), point, angles)
        for accuracy in (1e-2, 1e-3, 1e-4, 1e-7)
    }
    errors = [error(cells[a], cells[1e-7])[1] for a in (1e-2, 1e-3, 1e-4)]
    order = np.polyfit(np.log([1e-2, 1e-3, 1e-4]), np.log(errors), 1)[0]
    assert order > 0.5
    assert errors[-1] < 1e-3
