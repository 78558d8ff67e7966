"""Validation of a surrogate by references apart, or by designs held out of its own data."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.surrogate.dataset import Dataset, among
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import MIN_DESIGNS, Surrogate
from dogshape.surrogate.references import Reference, reference_of
from dogshape.surrogate.validation_figures import Prediction, Validation, figures, predict

QUICK = Effort(rows=300, steps=20)  #: of the fits to parts of the data


def held_out(
    data: Dataset, mix: Mix, surrogate: Surrogate, folds: int = 6
) -> tuple[Reference, Prediction]:
    """Predict every fully simulated design from fits that never saw it.

    Returns the references and their predictions.
    """
    reference = reference_of(data, mix)
    count = len(reference)
    if count < 2 * MIN_DESIGNS:
        folds = count  # each part fits its own parameters, so it needs all it can have
    if count == 0:
        raise InputError(
            "no design was simulated at every operating point and engaged at each, so nothing "
            "can judge the surrogate; simulate more designs"
        )
    folds = min(folds, count)
    order = np.random.default_rng(0).permutation(count)
    parts: list[Prediction] = []
    for fold in range(folds):
        out = reference.x[order[fold::folds]]
        seen = ~among(data.x, out)
        model = fit(data.subset(seen), like=surrogate, effort=QUICK)
        parts.append(predict(model, out, mix))
    back = np.argsort(np.concatenate([order[fold::folds] for fold in range(folds)]))
    return reference, Prediction(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])[back]
            for field in fields(Prediction)
        )
    )


def validate(surrogate: Surrogate, mix: Mix, reference: Reference | None = None) -> Validation:
    """Judge a surrogate by references apart, or else by holding out designs of its own data."""
    source = "references"
    if reference is None:
        reference, prediction = held_out(surrogate.data, mix, surrogate)
        source = "held out"
    else:
        prediction = predict(surrogate, reference.x, mix)
    return figures(reference, prediction, source, surrogate.data.shifts)
